"""How certain is a life?

Stiffness, damping, material and force are drawn at random; each case is assessed exactly.
"""

import matplotlib.pyplot as plt
import numpy as np

import picchio

robot = picchio.load_robot("fanuc_like_3dof")
blows = {"kind": "pulse_train", "force": 5000.0, "period": 0.040, "width": 0.004}
work = {"name": "up", "direction": [0, 0, 1], "poses": [[0.3, 1.1, -1.0]]}
task = picchio.task_from_dict({"excitation": blows, "operation": [work]}, robot)
lives = picchio.uncertain_life(robot, task).lives
plt.hist(np.log10(lives[np.isfinite(lives)]), bins=60)
plt.xlabel("log10 of the rivets to failure")
plt.ylabel(f"cases, {np.isinf(lives).mean():.0%} more are unlimited")
plt.show()
