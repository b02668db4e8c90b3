"""The steady state that a rivet never reaches.

Half a second of blows is too short for an arm at 5 Hz and 3 % damping.
"""

import matplotlib.pyplot as plt
import numpy as np

import picchio

blows = picchio.PulseTrain(force=300.0, period=0.040, width=0.004)
modes = picchio.modal_analysis("fanuc_like_3dof", [0.3, 1.1, -1.0])
time = np.linspace(0.0, 4.0, 8000)
real = picchio.response_from_rest(modes, blows, hits=100).deflection(time, [0, 0, 1])[1]
steady = picchio.steady_state(modes, blows).deflection(time % blows.period, [0, 0, 1])[1]
plt.plot(time, 1e3 * real, label="from rest")
plt.plot(time, 1e3 * steady, label="steady state", lw=1)
plt.axvline(12 * blows.period, color="grey", ls=":", label="a rivet ends")
plt.xlabel("time, s")
plt.ylabel("joint_2, mrad")
plt.legend()
plt.show()
