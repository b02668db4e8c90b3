"""What an accelerometer at the tool would read, before the test is made."""

import matplotlib.pyplot as plt

import picchio

plan = {
    "poses": [[0.3, 0.5, -0.8]],
    "directions": [[0.0, 0.0, 1.0]],
    "excitation": {"kind": "pulse_train", "force": 300.0, "period": 0.040, "width": 0.004},
    "hits": 6,
    "sample_rate": 2000.0,
    "length": 0.6,
    "sensor": [{"channels": "accelerometer.tool", "noise": 0.05}],
}
picchio.simulate("fanuc_like_3dof", plan).plot(channels=["accelerometer.tool.z"])
plt.show()
