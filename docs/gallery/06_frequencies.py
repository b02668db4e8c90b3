"""Natural frequencies as the elbow turns.

The hit rate, 25 Hz, and its multiples are where a blow train excites the arm.
"""

import matplotlib.pyplot as plt
import numpy as np

import picchio

robot = picchio.load_robot("fanuc_like_3dof")
elbow = np.linspace(-2.5, 0.0, 60)
modes = [picchio.modal_analysis(robot, [0.0, 1.0, q]) for q in elbow]
plt.plot(elbow, [each.natural_frequencies for each in modes])
plt.axhline(25.0, color="grey", ls=":", label="hit rate")
plt.xlabel("joint_3, rad")
plt.ylabel("natural frequency, Hz")
plt.legend()
plt.show()
