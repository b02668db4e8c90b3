"""Turn the gun, keep the robot.

The damage of the same rivet, as the tool is tilted in the arm's own plane.
"""

import matplotlib.pyplot as plt
import numpy as np

import picchio

robot = picchio.load_robot("fanuc_like_3dof")
blows = {"kind": "pulse_train", "force": 5000.0, "period": 0.040, "width": 0.004}
tilt, used = np.radians(np.arange(0, 181, 15)), []
for angle in tilt:
    work = {"name": "tilted", "direction": [np.cos(angle), 0, np.sin(angle)],
            "poses": [[0.0, 1.1, -1.0]]}  # fmt: skip
    task = picchio.task_from_dict({"excitation": blows, "operation": [work]}, robot)
    used.append(picchio.assess(robot, task, steady_check=False).to_frame()["utilisation"])
plt.plot(np.degrees(tilt), 100 * np.array(used), label=robot.flexible_names)
plt.xlabel("tilt of the tool, degrees")
plt.ylabel("utilisation, %")
plt.legend()
plt.show()
