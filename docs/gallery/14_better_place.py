"""Where should the panel stand?

The work may move by 20 cm each way: what other poses gain, and what the place gains.
"""

import matplotlib.pyplot as plt

import picchio

robot = picchio.load_robot("fanuc_like_3dof")
task = picchio.load_task(robot.task_path, robot)
found = picchio.place(robot, task, move=(0.2, 0.2, 0.2, 0.0), placements=20)
steps = {"as it is": found.start, "other poses": found.poses_alone, "other place": found.best}
steps = {name: step for name, step in steps.items() if step}
plt.bar(steps.keys(), [100 * step.utilisation for step in steps.values()])
plt.ylabel("highest utilisation, %")
plt.show()
