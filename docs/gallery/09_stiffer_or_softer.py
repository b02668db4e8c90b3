"""Does a stiffer joint bear more?

The same arm with joint_2 softer and stiffer, each by a sidecar.
"""

from pathlib import Path

import matplotlib.pyplot as plt

import picchio

task = picchio.load_robot("fanuc_like_3dof").task_path
factors, peaks = (0.5, 0.7, 1.0, 1.4, 2.0), []
for factor in factors:
    sidecar = f'format = "picchio-sidecar/1"\njoint.joint_2.stiffness = {1e5 * factor}'
    Path("flex.toml").write_text(sidecar)
    robot = picchio.load_robot("fanuc_like_3dof", flex="flex.toml")
    life = picchio.assess(robot, picchio.load_task(task, robot), steady_check=False)
    peaks.append(life.to_frame()["peak_torque"])
plt.plot(factors, peaks, "o-", label=robot.flexible_names)
plt.xlabel("stiffness of joint_2 over the stated one")
plt.ylabel("peak torque of the vibration, N m")
plt.legend()
plt.show()
