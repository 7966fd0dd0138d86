"""The program to compare with, and the sample that ships with the project."""

import os
import shutil
import sys
from pathlib import Path

import chainage

SAMPLE = Path(__file__).resolve().parents[2] / "tests" / "data" / "tree_road_sweep.laz"

# The one that the wheel has installed, unless another is named: the same code, compiled with optimisation.
_places = [Path(sys.executable).parent, Path(chainage.__file__).parents[1] / "bin"]
INSTALLED = next((place / "chainage" for place in _places if (place / "chainage").exists()), None)
PROGRAM = os.environ.get("CHAINAGE_PROGRAM") or INSTALLED or shutil.which("chainage")
