"""The exceptions of chainage: one per kind of failure, with the exit code of the program and a hint."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from chainage import _native


class ChainageError(Exception):
    """A failure of chainage.

    Attributes
    ----------
    exit_code : int
        Exit code of the program for failures of this kind.
    hint : str or None
        What to do next.
    """

    exit_code = 1

    def __init__(self, text: str, hint: str | None = None) -> None:
        super().__init__(text)
        self.hint = hint

    def __str__(self) -> str:
        text = super().__str__()
        return f"{text} (hint: {self.hint})" if self.hint else text


class SettingError(ChainageError, ValueError):
    """A setting is unknown, has the wrong type, or is out of range."""

    exit_code = 3


class InputError(ChainageError, OSError):
    """An input is missing, cannot be read, or is not acceptable."""

    exit_code = 4


class OutputError(ChainageError, OSError):
    """An output cannot be written."""

    exit_code = 5


class StateError(ChainageError):
    """The output directory belongs to another input, version or setting."""

    exit_code = 6


class LockedError(ChainageError):
    """Another process drives the run in the output directory."""

    exit_code = 7


class UnitsFailedError(ChainageError):
    """Some tiles failed. The others were finished and are kept."""

    exit_code = 8


class InterruptedRunError(ChainageError):
    """The run was stopped. Finished tiles are kept."""

    exit_code = 130


_KINDS: dict[str, type[ChainageError]] = {
    "config": SettingError,
    "input": InputError,
    "output": OutputError,
    "state": StateError,
    "locked": LockedError,
    "units-failed": UnitsFailedError,
    "interrupted": InterruptedRunError,
}


@contextlib.contextmanager
def raised() -> Iterator[None]:
    """Turn a failure of the native part into the exception of its kind."""
    try:
        yield
    except _native.Failure as failure:
        kind, text, hint = failure.args
        raise _KINDS.get(kind, ChainageError)(text, hint) from None
