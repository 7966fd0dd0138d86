"""Builds the wheel: maturin compiles the module, and the program is compiled before and put beside it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from maturin import (  # noqa: F401  (hooks that need no program)
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
    prepare_metadata_for_build_wheel,
)
import maturin

ROOT = Path(__file__).resolve().parents[2]
# Both are compiled into one folder: the module takes the compiled dependencies of the program.
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))


def _put_program():
    os.environ["CARGO_TARGET_DIR"] = str(TARGET)
    subprocess.run(["cargo", "build", "--release", "--locked", "--bin", "chainage"], cwd=ROOT, check=True)
    name = "chainage.exe" if sys.platform == "win32" else "chainage"
    scripts = ROOT / "python" / "chainage.data" / "scripts"
    scripts.mkdir(parents=True, exist_ok=True)
    shutil.copy2(TARGET / "release" / name, scripts / name)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    _put_program()
    return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    _put_program()
    return maturin.build_editable(wheel_directory, config_settings, metadata_directory)


def build_sdist(sdist_directory, config_settings=None):
    return maturin.build_sdist(sdist_directory, config_settings)
