"""An S-N curve from tests with run-outs.

Twelve torsion tests; those that did not break by 1e7 cycles count, too.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import picchio

stress = np.array([420, 420, 380, 380, 340, 340, 310, 310, 290, 290, 270, 270])  # MPa
cycles = [6.1e4, 8.9e4, 1.3e5, 2.1e5, 3.0e5, 6.2e5, 9.5e5, 1.6e6, 2.4e6, 1e7, 1e7, 1e7]
table = pd.DataFrame({"stress [MPa]": stress, "cycles": cycles})
table["outcome"] = np.where(table["cycles"] < 1e7, "failed", "run-out")
table.to_csv("tests.csv", index=False)
found = picchio.fit_sn("tests.csv")
print(found.fit_report())
found.plot()
plt.show()
