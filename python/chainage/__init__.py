"""Ground and objects from mobile laser scanning drives of any length.

`run`, `plan`, `status` and `objects` work on drives of files, as the program ``chainage`` does. `cluster`, `ground`, `segment`
and `evaluate` work on points in arrays, and give the same partition for the same points.
"""

from importlib.metadata import version as _version

from chainage.arrays import cluster, evaluate, ground, segment
from chainage.drives import objects, plan, run, status
from chainage.errors import (
    ChainageError,
    InputError,
    InterruptedRunError,
    LockedError,
    OutputError,
    SettingError,
    StateError,
    UnitsFailedError,
)

__version__ = _version("chainage")

__all__ = [
    "ChainageError",
    "InputError",
    "InterruptedRunError",
    "LockedError",
    "OutputError",
    "SettingError",
    "StateError",
    "UnitsFailedError",
    "__version__",
    "cluster",
    "evaluate",
    "ground",
    "objects",
    "plan",
    "run",
    "segment",
    "status",
]
