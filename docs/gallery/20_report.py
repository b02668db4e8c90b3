"""A report for a customer.

A page for A4, from any result.
"""

import picchio

robot = picchio.load_robot("fanuc_like_3dof")
task = picchio.load_task(robot.task_path, robot)
life = picchio.assess(robot, task)
picchio.report(life, robot=robot, task=task).save("life.html")
