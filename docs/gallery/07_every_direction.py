"""Every direction at once.

How far each joint of a UR10 deflects, by the direction of the blows in a vertical plane.
"""

import matplotlib.pyplot as plt

import picchio

found = picchio.envelope("ur10", [0.0, -1.2, 1.8, -0.6, 1.57, 0.0], hits=12)
found.plot(plane="xz")
plt.show()
