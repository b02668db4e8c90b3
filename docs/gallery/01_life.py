"""How much each direction of work loads each joint.

The utilisation is the stress amplitude over what the shaft bears without end.
"""

import matplotlib.pyplot as plt

import picchio

life = picchio.assess("fanuc_like_3dof")
life.plot().set_title(life.verdict.status, loc="left")
plt.show()
