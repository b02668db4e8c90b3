"""The 3-D scene.

One HTML file, offline: the vibration, the rivets, and the double ball of directions.
"""

import picchio

picchio.view("ur10").save("scene.html")
