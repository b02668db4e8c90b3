"""A force that was measured.

A hammer's force from a load cell, and what it does to joint_2 of a bent and of a stretched arm.
"""

import matplotlib.pyplot as plt
import numpy as np

import picchio

time = np.arange(0.0, 0.05, 1e-4)
read = np.where(time < 0.005, 800.0 * np.sin(np.pi * time / 0.005), 0.0)
blow = picchio.MeasuredForce(time, read + np.random.default_rng(1).normal(0.0, 3.0, time.size))
robot = picchio.load_robot("fanuc_like_3dof")
at = np.linspace(0.0, 0.6, 3000)
for name, pose in {"bent": [0.0, 1.1, -1.8], "stretched": [0.0, 0.3, -0.1]}.items():
    modes = picchio.modal_analysis(robot, pose)
    answer = picchio.response_from_rest(modes, blow, hits=1)
    plt.plot(at, 1e3 * answer.deflection(at, [0, 0, 1])[1], label=name)
plt.xlabel("time, s")
plt.ylabel("joint_2, mrad")
plt.legend()
plt.show()
