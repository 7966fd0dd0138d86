"""Points in arrays: cluster, ground, segment, evaluate."""

from __future__ import annotations

import json
from collections.abc import Mapping
from numbers import Integral
from typing import Any

import numpy as np
import numpy.typing as npt

from chainage import _native
from chainage.errors import SettingError, raised
from chainage.settings import Value, assignments, full_name

# Only the labelled points are read back.
_OUTPUT: dict[str, Value | None] = {"output.files": ["points"], "output.report": False}
_STEP_M = 0.001
# Largest coordinate, the same as for files: beyond any position on earth.
_FARTHEST = 2e8

# Why settings cannot be given with an array: by section, or by full name.
_REFUSED = {
    "output": "cannot be set here, because no file is written: the labels are returned",
    "axis": "cannot be set here, because no label depends on the axis, and an array has no times",
    "tiling.from": "cannot be set here, because an array has no chainage: select its points instead",
    "tiling.to": "cannot be set here, because an array has no chainage: select its points instead",
    "tiling.beyond": "cannot be set here, because an array has no chainage: select its points instead",
}


def _settings(
    method: str, ground: str | None, named: Mapping[str, Value], further: Mapping[str, Value]
) -> list[str]:
    """The assignments of a call. Refuses settings that make no sense with an array."""
    for key, value in further.items():
        name = full_name(key)
        why = _REFUSED.get(name) or _REFUSED.get(name.partition(".")[0])
        if why:
            raise ValueError(f"{name} = {value!r}: {why}")
    return assignments(method, ground, {**_OUTPUT, **named}, further)


def _refuse_masked(name: str, values: Any) -> None:
    if np.ma.is_masked(values):
        row = np.argwhere(np.ma.getmaskarray(values))[0][0]
        raise ValueError(f"{name}[{row}] is masked: remove or fill the masked values")


def _points(points: Any) -> tuple[npt.NDArray[np.float64], tuple[Any, Any, Any], tuple[Any, Any, Any]]:
    """The coordinates of an array or of laspy.LasData, with the steps and offsets in which they are stored."""
    header = getattr(points, "header", None)
    if header is not None and hasattr(points, "xyz"):
        xyz = np.ascontiguousarray(points.xyz, dtype=np.float64)
        scales, offsets = header.scales, header.offsets
    else:
        _refuse_masked("xyz", points)
        xyz = np.ascontiguousarray(points, dtype=np.float64)
        if xyz.ndim != 2 or xyz.shape[1] != 3:
            raise ValueError(f"xyz has the shape {xyz.shape}: must be (n, 3)")
        scales, offsets = np.full(3, _STEP_M), None
    bad = np.flatnonzero(~((xyz >= -_FARTHEST) & (xyz <= _FARTHEST)).all(axis=1))
    if bad.size:
        expected = f"must be finite, and from -{_FARTHEST:g} to {_FARTHEST:g}"
        raise ValueError(f"xyz[{bad[0]}] = {xyz[bad[0]].tolist()}: {expected}")
    if offsets is None:
        offsets = np.floor(xyz.min(axis=0)) if len(xyz) else np.zeros(3)
    return xyz, tuple(float(x) for x in scales), tuple(float(x) for x in offsets)


def _label(points: Any, settings: list[str]) -> tuple[Any, Any, Any]:
    """Labels, classes and kinds of points. Withheld points of laspy.LasData are left out, as in a run: they get 0."""
    xyz, scales, offsets = _points(points)
    used = np.ones(len(xyz), dtype=bool)
    if hasattr(points, "withheld") and hasattr(points, "header"):
        used = np.asarray(points.withheld) == 0
    if used.all():
        with raised():
            return _native.label(xyz, scales, offsets, settings)
    with raised():
        found = _native.label(np.ascontiguousarray(xyz[used]), scales, offsets, settings)

    def of_all(values: Any) -> Any:
        if values is None:
            return None
        every = np.zeros(len(xyz), dtype=values.dtype)
        every[used] = values
        return every

    labels, classes, kinds = (of_all(values) for values in found)
    return labels, classes, kinds


def cluster(xyz: Any, method: str = "euclidean", **settings: Value) -> npt.NDArray[np.uint32]:
    """Group points into objects. All points are treated as points of objects: ground and noise are not detected.

    Parameters
    ----------
    xyz : array_like, shape (n, 3), or laspy.LasData
        Coordinates in metres. Arrays are rounded to 1 mm. Withheld points of laspy.LasData are left out.
    method : str, optional
        Clustering method: ``"euclidean"``, ``"density-peaks"``, ``"dbscan"``, ``"normalized-cut"``, ``"p-linkage"``
        (surfaces) or ``"street"``.
    **settings
        Settings of the method, such as ``max_gap_m=0.4`` (metres), or further ones, such as ``run__threads=2``. Settings of files are
        refused: ``output``, ``axis`` and the section of a drive.

    Returns
    -------
    ndarray of uint32, shape (n,)
        The object of each point, from 1 on in the order of the first point of an object. 0: of no object, or withheld.

    Examples
    --------
    >>> import chainage, numpy as np
    >>> xyz = np.array([[0, 0, 0], [0.1, 0, 0], [9, 0, 0], [9.1, 0, 0]])
    >>> chainage.cluster(xyz, max_gap_m=0.5, min_points=2)
    array([1, 1, 2, 2], dtype=uint32)
    """
    return _label(xyz, _settings(method, "none", {"noise.enabled": False}, settings))[0]


def ground(xyz: Any, method: str = "opening", **settings: Value) -> npt.NDArray[np.bool_]:
    """Find the ground.

    Parameters
    ----------
    xyz : array_like, shape (n, 3), or laspy.LasData
        Coordinates in metres. Arrays are rounded to 1 mm.
    method : str, optional
        Ground filter: ``"opening"``, ``"voxel-column"`` or ``"upward-growing"``.
    **settings
        Settings of the filter, or further ones by full name, such as ``noise__enabled=False``, except those of files (see `cluster`).

    Returns
    -------
    ndarray of bool, shape (n,)
        Whether a point is ground.
    """
    full = {key if "__" in key or "." in key else f"{method}.{key}": value for key, value in settings.items()}
    return _label(xyz, _settings("euclidean", method, {}, full))[1] == 2


def segment(
    xyz: Any, method: str = "street", **settings: Value
) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint8]]:
    """Separate noise, ground and objects, as a run over files does.

    Parameters
    ----------
    xyz : array_like, shape (n, 3), or laspy.LasData
        Coordinates in metres. Arrays are rounded to 1 mm.
    method : str, optional
        Clustering method.
    **settings
        Settings of the method, or further ones by full name, such as ``ground__method="voxel-column"``, except those of files (see
        `cluster`).

    Returns
    -------
    labels : ndarray of uint32, shape (n,)
        The object of each point. 0: ground, noise, of no object, or withheld.
    classes : ndarray of uint8, shape (n,)
        The class of the object of each point, if the method classifies; else the LAS class of the point (2 is ground).
    """
    labels, classes, kinds = _label(xyz, _settings(method, None, {}, settings))
    return labels, classes if kinds is None else kinds


def _codes(name: str, values: Any, dtype: type[np.integer[Any]]) -> npt.NDArray[Any]:
    """One-dimensional integers as this type. Refuses values that would change in it."""
    _refuse_masked(name, values)
    array = np.asarray(values)
    if array.shape == (0,) and isinstance(values, list | tuple):
        array = array.astype(dtype)  # numpy takes an empty list for floats
    if array.ndim != 1 or array.dtype.kind not in "iub":
        raise ValueError(f"{name} is {array.ndim}-dimensional, of {array.dtype}: must be 1-dimensional, of integers")
    limits = np.iinfo(dtype)
    for row in (array.argmin(), array.argmax()) if array.size else ():
        if not limits.min <= int(array[row]) <= limits.max:
            raise ValueError(f"{name}[{row}] = {array[row]}: must be from {limits.min} to {limits.max}")
    return np.ascontiguousarray(array, dtype=dtype)


def evaluate(pred: Any, ref: Any, cls: Any = None, *, min_points: int = 30) -> dict[str, Any]:
    """Score a segmentation against reference labels.

    Parameters
    ----------
    pred : array_like of int, shape (n,)
        Predicted object of each point, 0 or below for none.
    ref : array_like of int, shape (n,)
        Reference object of each point, 0 or below for none.
    cls : array_like of int, shape (n,), optional
        Reference class of each point, by the codes of ``chainage eval``, 0 to 65535. Without it all objects are of one class.
    min_points : int, optional
        Smallest number of points of an object, at least 1.

    Returns
    -------
    dict
        ``"overall"`` and ``"classes"`` (by name), each with shares from 0 to 1: ``oa``, ``usr``, ``osr``, ``pq``, ``sq``, ``rq``,
        ``f1``, ``ari``, ``mean_best_iou``; ``None`` where a share is not defined.
    """
    if not isinstance(min_points, Integral) or min_points < 1:
        raise SettingError(f"min_points = {min_points!r}: must be a whole number, at least 1")
    predicted, reference = _codes("pred", pred, np.int64), _codes("ref", ref, np.int64)
    classes = None if cls is None else _codes("cls", cls, np.uint16)
    lengths = [len(array) for array in (predicted, reference, classes) if array is not None]
    if len(set(lengths)) > 1:
        raise ValueError(f"pred, ref and cls have {lengths} values: must be as many")
    with raised():
        return json.loads(_native.evaluate(predicted, reference, classes, int(min_points)))
