"""How much each direction of work loads each joint.

The utilisation is the stress amplitude over what the shaft bears without end.
"""

import matplotlib.pyplot as plt
import pandas as pd

import picchio

robot = picchio.load_robot("fanuc_like_3dof")
life = picchio.assess(robot, picchio.load_task(robot.task_path, robot))
load = {done.name: 100 * done.utilisation.max(axis=0) for done in life.operations}
pd.DataFrame(load, index=robot.flexible_names).plot.bar(rot=0, ylabel="utilisation, %")
plt.title(f"{robot.name}: {life.verdict.status}")
plt.show()
