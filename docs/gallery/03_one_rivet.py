"""One rivet, blow by blow.

Twelve hits from rest, then the ring-down. The solution is a closed form: no time step.
"""

import matplotlib.pyplot as plt

import picchio

blows = picchio.PulseTrain(force=300.0, period=0.040, width=0.004)  # N, s, s
modes = picchio.modal_analysis("fanuc_like_3dof", [0.3, 1.1, -1.0])
picchio.response_from_rest(modes, blows, hits=12).plot(direction=[0, 0, 1])
plt.show()
