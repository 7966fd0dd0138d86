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
)
import maturin

ROOT = Path(__file__).resolve().parents[2]
# Both are compiled into one folder: the module takes the compiled dependencies of the program where it can.
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
# CI builds with the profile dev, whose dependencies the tests have compiled already.
PROFILE = os.environ.get("CHAINAGE_WHEEL_PROFILE", "release")
# A program that is compiled already, of the same sources. CI has one.
PROGRAM = os.environ.get("CHAINAGE_WHEEL_PROGRAM")


SCRIPTS = ROOT / "python" / "chainage.data" / "scripts"


def _put_program():
    os.environ["CARGO_TARGET_DIR"] = str(TARGET)
    os.environ["MATURIN_PEP517_ARGS"] = f"--locked --profile {PROFILE}"
    name = "chainage.exe" if sys.platform == "win32" else "chainage"
    program = PROGRAM
    if program is None:
        command = ["cargo", "build", "--profile", PROFILE, "--locked", "--bin", "chainage"]
        subprocess.run(command, cwd=ROOT, check=True)
        program = TARGET / ("debug" if PROFILE == "dev" else PROFILE) / name
    SCRIPTS.mkdir(parents=True, exist_ok=True)
    shutil.copy2(program, SCRIPTS / name)


def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    # maturin expects the folder already here.
    SCRIPTS.mkdir(parents=True, exist_ok=True)
    return maturin.prepare_metadata_for_build_wheel(metadata_directory, config_settings)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    _put_program()
    return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    _put_program()
    return maturin.build_editable(wheel_directory, config_settings, metadata_directory)


def build_sdist(sdist_directory, config_settings=None):
    return maturin.build_sdist(sdist_directory, config_settings)
