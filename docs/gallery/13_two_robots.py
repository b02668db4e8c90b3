"""Two robots, the same blows.

Each on its own example task: the utilisation of every joint.
"""

import matplotlib.pyplot as plt

import picchio

figure, axes = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
for name, ax in zip(("ur10", "panda"), axes, strict=True):
    picchio.assess(name, uncertainty=False).plot(ax=ax).set_title(name, loc="left")
plt.show()
