"""Every direction at once.

How far each joint of a UR10 deflects, by the direction of the blows in a vertical plane.
"""

import matplotlib.pyplot as plt
import numpy as np

import picchio

robot = picchio.load_robot("ur10")
blows = picchio.PulseTrain(force=300.0, period=0.040, width=0.004)
found = picchio.envelope(robot, [0.0, -1.2, 1.8, -0.6, 1.57, 0.0], blows, hits=12)
angle = np.linspace(0.0, 2 * np.pi, 361)
directions = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
axes = plt.subplot(projection="polar")
axes.plot(angle, 1e3 * np.reshape(found.support(directions), (-1, angle.size)).T)
axes.legend(found.joint_names, loc="center left", bbox_to_anchor=(1.1, 0.5))
axes.set_title("largest deflection, mrad")
plt.tight_layout()
plt.show()
