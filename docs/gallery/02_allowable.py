"""Which force does a target life allow?

The number of rivets is prescribed; the largest force follows for each joint.
"""

import matplotlib.pyplot as plt

import picchio

robot = picchio.load_robot("fanuc_like_3dof")
task = picchio.load_task(robot.task_path, robot)
for rivets in (1e4, 1e6, 1e8):
    found = picchio.allowable(robot, task, rivets=rivets, survival=0.99).to_frame()
    plt.plot(found.index, 300 * found["force_factor"], "o-", label=f"{rivets:.0e} rivets")
plt.ylabel("allowable force, N")
plt.legend()
plt.show()
