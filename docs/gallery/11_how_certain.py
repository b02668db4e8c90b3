"""How certain is the utilisation?

Every estimate and tolerance is drawn at random; each case is assessed by the exact method.
"""

import matplotlib.pyplot as plt
import numpy as np

import picchio

robot = picchio.load_robot("ur10")
found = picchio.uncertain_life(robot, picchio.load_task(robot.task_path, robot))
for joint, cases in zip(robot.flexible_names, np.atleast_2d(found.utilisation), strict=False):
    plt.hist(np.log10(100 * cases), bins=40, histtype="step", label=joint)
plt.xlabel("log10 of the utilisation, %")
plt.ylabel("cases")
plt.legend(fontsize=8)
plt.show()
