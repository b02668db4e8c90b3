"""Does a stiffer joint bear more?

The same arm with joint_2 softer and stiffer.
"""

import matplotlib.pyplot as plt

import picchio

robot = picchio.load_robot("fanuc_like_3dof")
factors, peaks = (0.5, 0.7, 1.0, 1.4, 2.0), []
for factor in factors:
    changed = robot.with_stiffness(joint_2=1e5 * factor)
    peaks.append(picchio.assess(changed, steady_check=False).to_frame()["peak_torque"])
plt.plot(factors, peaks, "o-", label=robot.flexible_names)
plt.xlabel("stiffness of joint_2 over the stated one")
plt.ylabel("peak torque of the vibration, N m")
plt.legend()
plt.show()
