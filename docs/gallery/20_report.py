"""A report for a customer.

A page for A4, from any result.
"""

import picchio

robot = picchio.load_robot("fanuc_like_3dof")
life = picchio.assess(robot, picchio.load_task(robot.task_path, robot))
picchio.report(life).save("life.html")
