"""What an accelerometer at the tool would read, before the test is made."""

from pathlib import Path

import matplotlib.pyplot as plt

import picchio

plan = """format = "picchio-plan/1"
poses = [[0.3, 0.5, -0.8]]
directions = [[0.0, 0.0, 1.0]]
hits = 6
sample_rate = 2000.0
length = 0.6
excitation = { kind = "pulse_train", force = 300.0, period = 0.040, width = 0.004 }
sensor = [{ channels = "accelerometer.tool", noise = 0.05 }]
"""
Path("plan.toml").write_text(plan)
record = picchio.simulate("fanuc_like_3dof", "plan.toml").campaign.records[0]
plt.plot(record.time, record["accelerometer.tool.z"], lw=0.8)
plt.xlabel("time, s")
plt.ylabel("acceleration along z, m/s²")
plt.show()
