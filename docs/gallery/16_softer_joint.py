"""Records of an arm whose joint_2 is 30 % softer give its stiffness."""

import matplotlib.pyplot as plt

import picchio

plan = {
    "poses": [[0.3, 0.5, -0.8], [-0.4, 0.9, -1.1], [0.6, 0.2, -0.5]],
    "directions": [[0.6, 0.5, 0.62]],
    "excitation": {"kind": "pulse_train", "force": 300.0, "period": 0.040, "width": 0.004},
    "hits": 6,
    "sample_rate": 500.0,
    "length": 1.0,
    "sensor": [{"channels": "deflection", "noise": 1e-6}],
    "effect": [{"effect": "joint_stiffness", "target": "joint_2", "parameters": {"scale": 0.7}}],
}
records = picchio.simulate("fanuc_like_3dof", plan).campaign
found = picchio.identify("fanuc_like_3dof", records)
print(found.fit_report())
found.plot()
plt.show()
