"""Two robots, the same blows.

Each on its own example task: the utilisation of every joint.
"""

import matplotlib.pyplot as plt

import picchio

figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for name, ax in zip(("ur10", "panda"), axes, strict=True):
    robot = picchio.load_robot(name)
    life = picchio.assess(robot, picchio.load_task(robot.task_path, robot), uncertainty=False)
    frame = life.to_frame()
    ax.barh(frame.index, 100 * frame["utilisation"])
    ax.set(title=name, xlabel="utilisation, %")
plt.show()
