"""A robot whose drives nobody published.

The stiffness of a UR3 is estimated from robots that were measured: every value is a range.
"""

import matplotlib.pyplot as plt
import pandas as pd

import picchio

flex, task = picchio.start("ur3_robot", payload=3.0).save(".")
robot = picchio.load_robot("ur3_robot", flex=flex)
life = picchio.assess(robot, picchio.load_task(task, robot))
ends = 100 * pd.DataFrame({joint.name: joint.intervals["utilisation"] for joint in life.joints}).T
plt.barh(ends.index, ends[1] - ends[0], left=ends[0])
plt.xscale("log")
plt.xlabel("utilisation, %, P10 to P90")
plt.tight_layout()
plt.show()
