"""Settings as keywords: how they become assignments `section.key=value` of the configuration."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping

Value = bool | int | float | str | list[str] | os.PathLike[str]


def literal(value: Value) -> str:
    """A value in the form of the configuration file (TOML)."""
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if hasattr(value, "item"):
        value = value.item()
    return json.dumps(value)


def mebibytes(memory: int | str) -> int:
    """A memory budget, as a number of MiB or as text such as ``"800M"`` or ``"4G"``."""
    if isinstance(memory, int):
        return memory
    found = re.fullmatch(r"([0-9.]+)\s*(M|MB|MiB|G|GB|GiB)?", memory)
    if found is None:
        raise ValueError(f"memory = {memory!r}: must be a size like '800M' or '4G'")
    return int(float(found[1]) * (1024 if (found[2] or "M").startswith("G") else 1))


def assignments(
    method: str | None, ground: str | None, named: Mapping[str, Value | None], further: Mapping[str, Value]
) -> list[str]:
    """The assignments of a call.

    Parameters
    ----------
    method, ground : str or None
        Names of the clustering method and of the ground filter.
    named : mapping
        Settings by their full name. ``None`` leaves one out.
    further : mapping
        Settings by full name (``"euclidean.max_gap_m"`` or ``euclidean__max_gap_m``), or by the name in the section of the method
        (``max_gap_m``).
    """
    result = []
    for key, value in {"cluster.method": method, "ground.method": ground, **named}.items():
        if value is not None:
            result.append(f"{key}={literal(value)}")
    for key, value in further.items():
        name = key.replace("__", ".", 1)
        if "." not in name:
            if method is None:
                raise ValueError(f"{key} = {value!r}: needs its section, for example street__{key}, or a method")
            name = f"{method}.{name}"
        result.append(f"{name}={literal(value)}")
    return result
