"""A robot whose drives nobody published.

The stiffness of a UR3 is estimated from robots that were measured: every value is a range.
"""

import matplotlib.pyplot as plt

import picchio

picchio.assess("ur3_robot").plot()
plt.show()
