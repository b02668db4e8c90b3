"""Where should the panel stand?

The work may move by 20 cm each way: what other poses gain, and what the place gains.
"""

import matplotlib.pyplot as plt

import picchio

found = picchio.place("fanuc_like_3dof", move=(0.2, 0.2, 0.2, 0.0), placements=20)
found.plot()
plt.show()
