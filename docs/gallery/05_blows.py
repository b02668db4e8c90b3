"""Round blows or square ones.

The same impulse as a rectangle and as a half-sine: the joints see no difference.
"""

import matplotlib.pyplot as plt
import numpy as np

import picchio

modes = picchio.modal_analysis("fanuc_like_3dof", [0.3, 1.1, -1.0])
time = np.linspace(0.0, 0.3, 3000)
for style, blows in {
    "-": picchio.PulseTrain(300.0, 0.040, 0.004),
    ":": picchio.HalfSineTrain(300.0 * np.pi / 2, 0.040, 0.004),
}.items():
    rivet = picchio.response_from_rest(modes, blows, hits=3)
    plt.plot(time, 1e3 * rivet.deflection(time, [0, 0, 1])[2], style, lw=3)
plt.xlabel("time, s")
plt.ylabel("joint_3, mrad")
plt.legend(["rectangle", "half-sine"])
plt.show()
