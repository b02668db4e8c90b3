"""The life used, from a log.

Ten minutes of a strong tool's trigger and joints; the ledger remembers what each blow did.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import picchio

time = np.arange(0.0, 600.0, 0.02)
log = pd.DataFrame({"time [s]": 1772352000.0 + time, "trigger": 1.0 * (time % 5 < 0.5)})
log[["joint_1 [rad]", "joint_2 [rad]", "joint_3 [rad]"]] = [0.3, 1.1, -1.0]
log.to_csv("monday.csv", index=False)
robot = picchio.load_robot("fanuc_like_3dof")
blows = {"kind": "pulse_train", "force": 5000.0, "period": 0.040, "width": 0.004}
work = {"name": "up", "direction": [0, 0, 1], "poses": [[0.3, 1.1, -1.0]]}
task = picchio.task_from_dict({"excitation": blows, "operation": [work]}, robot)
found = picchio.count(robot, "monday.csv", "cell.ledger", task=task)
found.plot()
plt.show()
