"""Natural frequencies as the elbow turns.

The hit rate, 25 Hz, and its multiples are where a blow train excites the arm.
"""

import matplotlib.pyplot as plt
import numpy as np

import picchio

model = picchio.Model(picchio.load_robot("fanuc_like_3dof"))
elbow = np.linspace(-2.5, 0.0, 60)
frequencies = [
    picchio.modal_analysis(model.linear_system([0.0, 1.0, q])).natural_frequencies for q in elbow
]
plt.plot(elbow, frequencies)
plt.axhline(25.0, color="grey", ls=":", label="hit rate")
plt.xlabel("joint_3, rad")
plt.ylabel("natural frequency, Hz")
plt.legend()
plt.show()
