"""Which force does a target life allow?

The number of rivets is prescribed; the largest force follows for each joint.
"""

import matplotlib.pyplot as plt
import pandas as pd

import picchio

force = {}
for rivets in (1e4, 1e6, 1e8):
    found = picchio.allowable("fanuc_like_3dof", rivets=rivets, survival=0.99).to_frame()
    force[f"{rivets:.0e} rivets"] = 300 * found["force_factor"]  # the task has 300 N
pd.DataFrame(force).plot.bar(rot=0, ylabel="allowable force, N")
plt.show()
