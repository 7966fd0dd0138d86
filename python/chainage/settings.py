"""Settings as keywords: how they become assignments `section.key=value` of the configuration."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from numbers import Integral

from chainage import _native

Value = bool | int | float | str | list[str] | os.PathLike[str]

_SIZE = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)(M|MB|MIB|G|GB|GIB)?", re.ASCII | re.IGNORECASE)


def literal(value: Value) -> str:
    """A value in the form of the configuration file (TOML)."""
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if hasattr(value, "item"):
        value = value.item()
    # JSON would write a character beyond U+FFFF as two escapes, which TOML refuses, and DEL as it is.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def mebibytes(memory: int | str) -> int:
    """A memory budget in MiB, by the rules of ``chainage run --memory``.

    Parameters
    ----------
    memory : int or str
        A whole number of MiB, or a text such as ``"800M"``, ``"4G"``, ``"0.5GiB"`` or ``"512"`` (MiB); units in upper or lower case.

    Raises
    ------
    ValueError
        If it is not a size, or is out of range.
    """
    if isinstance(memory, Integral) and not isinstance(memory, bool):
        mib: float = int(memory)
    else:
        found = _SIZE.fullmatch(memory) if isinstance(memory, str) else None
        if found is None:
            raise ValueError(f"memory = {memory!r}: must be a whole number of MiB, or a size like '800M' or '4G'")
        mib = float(found[1]) * (1024 if (found[2] or "M").upper().startswith("G") else 1)
    least, most = _native.memory_range()
    if not least <= mib < most + 1:
        raise ValueError(f"memory = {memory!r}: must be from {least}M to {most >> 10}G")
    return int(mib)


def full_name(key: str) -> str:
    """The name of a setting with dots, of a keyword such as ``noise__enabled``."""
    return key.replace("__", ".", 1)


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
        name = full_name(key)
        if "." not in name:
            if method is None:
                raise ValueError(f"{key} = {value!r}: needs its section, for example street__{key}, or a method")
            name = f"{method}.{name}"
        result.append(f"{name}={literal(value)}")
    return result
