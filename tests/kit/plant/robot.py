"""The packaging line as a plug-in: `--robot` and this folder."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[3]))  # a command in a process of its own does not stand there

from tests.kit import plant

ROBOT = plant.PLANT
