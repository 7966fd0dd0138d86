# Types of the native part. Results are JSON unless they are arrays.

from collections.abc import Callable, Sequence
from os import PathLike

import numpy as np
import numpy.typing as npt

class Failure(Exception): ...

def run(
    files: Sequence[str | PathLike[str]],
    out: str | PathLike[str],
    preset: str | None,
    config: str | PathLike[str] | None,
    assignments: Sequence[str],
    fresh: bool,
    progress: Callable[[str], object] | None,
) -> str: ...
def plan(
    files: Sequence[str | PathLike[str]],
    preset: str | None,
    config: str | PathLike[str] | None,
    assignments: Sequence[str],
) -> str: ...
def status(out: str | PathLike[str]) -> str: ...
def columns() -> list[tuple[str, str]]: ...
def memory_range() -> tuple[int, int]: ...
def label(
    xyz: npt.NDArray[np.float64],
    scale: tuple[float, float, float],
    offset: tuple[float, float, float],
    assignments: Sequence[str],
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint8], npt.NDArray[np.uint8] | None]: ...
def evaluate(
    pred: npt.NDArray[np.int64],
    reference: npt.NDArray[np.int64],
    class_: npt.NDArray[np.uint16] | None,
    min_points: int,
) -> str: ...
