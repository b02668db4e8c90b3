"""One rivet, blow by blow.

Twelve hits from rest, then the ring-down. The solution is a closed form: no time step.
"""

import matplotlib.pyplot as plt
import numpy as np

import picchio

robot = picchio.load_robot("fanuc_like_3dof")
blows = picchio.PulseTrain(force=300.0, period=0.040, width=0.004)  # N, s, s
modes = picchio.modal_analysis(picchio.Model(robot).linear_system([0.3, 1.1, -1.0]))
rivet = picchio.response_from_rest(modes, blows, hits=12)
time = np.linspace(0.0, 1.5, 3000)
for name, angle in zip(robot.flexible_names, rivet.deflection(time, [0, 0, 1]), strict=True):
    plt.plot(time, 1e3 * angle, label=name)
plt.xlabel("time, s")
plt.ylabel("deflection, mrad")
plt.legend()
plt.show()
