"""The program that the wheel has installed, and the sample that ships with the project."""

import shutil
import sys
from pathlib import Path

SAMPLE = Path(__file__).resolve().parents[2] / "tests" / "data" / "tree_road_sweep.laz"

_installed = Path(sys.executable).with_name("chainage")
PROGRAM = _installed if _installed.exists() else shutil.which("chainage")
