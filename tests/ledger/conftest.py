"""The simulators of tests/worlds are imported by their folder's name."""

import sys
from pathlib import Path

for folder in (Path(__file__).parents[1], Path(__file__).parent):
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
