"""Points in arrays: cluster, ground, segment, evaluate."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import numpy.typing as npt

from chainage import _native
from chainage.errors import raised
from chainage.settings import Value, assignments

# Only the labelled points are read back.
_OUTPUT: dict[str, Value | None] = {"output.files": ["points"], "output.report": False}
_STEP_M = 0.001


def _points(points: Any) -> tuple[npt.NDArray[np.float64], tuple[Any, Any, Any], tuple[Any, Any, Any]]:
    """The coordinates of an array or of laspy.LasData, with the steps and offsets in which they are stored."""
    header = getattr(points, "header", None)
    if header is not None and hasattr(points, "xyz"):
        xyz = np.ascontiguousarray(points.xyz, dtype=np.float64)
        return xyz, tuple(float(x) for x in header.scales), tuple(float(x) for x in header.offsets)
    xyz = np.ascontiguousarray(points, dtype=np.float64)
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        raise ValueError(f"xyz has the shape {xyz.shape}: must be (n, 3)")
    bad = np.flatnonzero(~np.isfinite(xyz).all(axis=1))
    if bad.size:
        raise ValueError(f"xyz[{bad[0]}] = {xyz[bad[0]].tolist()}: must be finite")
    offsets = np.floor(xyz.min(axis=0)) if len(xyz) else np.zeros(3)
    return xyz, (_STEP_M,) * 3, tuple(float(x) for x in offsets)


def _label(points: Any, settings: list[str]) -> tuple[Any, Any, Any]:
    xyz, scales, offsets = _points(points)
    if len(xyz) == 0:
        none = np.zeros(0, dtype=np.uint8)
        return np.zeros(0, dtype=np.uint32), none, none
    with raised():
        return _native.label(xyz, scales, offsets, settings)


def cluster(xyz: Any, method: str = "euclidean", **settings: Value) -> npt.NDArray[np.uint32]:
    """Group points into objects. All points are taken as points of objects: ground and noise are not looked for.

    Parameters
    ----------
    xyz : array_like, shape (n, 3), or laspy.LasData
        Coordinates in metres. Arrays are rounded to 1 mm.
    method : str, optional
        Clustering method: ``"euclidean"``, ``"density-peaks"``, ``"dbscan"``, ``"normalized-cut"``, ``"p-linkage"``
        (surfaces) or ``"street"``.
    **settings
        Settings of the method, such as ``max_gap_m=0.4`` (metres), or further ones, such as ``run__threads=2``.

    Returns
    -------
    ndarray of uint32, shape (n,)
        The object of each point, from 1 on in the order of the first point of an object. 0: of no object.

    Examples
    --------
    >>> import chainage, numpy as np
    >>> xyz = np.array([[0, 0, 0], [0.1, 0, 0], [9, 0, 0], [9.1, 0, 0]])
    >>> chainage.cluster(xyz, max_gap_m=0.5, min_points=2)
    array([1, 1, 2, 2], dtype=uint32)
    """
    named = {**_OUTPUT, "noise.enabled": False}
    return _label(xyz, assignments(method, "none", named, settings))[0]


def ground(xyz: Any, method: str = "opening", **settings: Value) -> npt.NDArray[np.bool_]:
    """Find the ground.

    Parameters
    ----------
    xyz : array_like, shape (n, 3), or laspy.LasData
        Coordinates in metres. Arrays are rounded to 1 mm.
    method : str, optional
        Ground filter: ``"opening"``, ``"voxel-column"`` or ``"upward-growing"``.
    **settings
        Settings by full name, such as ``noise__enabled=False``.

    Returns
    -------
    ndarray of bool, shape (n,)
        Whether a point is ground.
    """
    full = {key if "__" in key or "." in key else f"{method}.{key}": value for key, value in settings.items()}
    return _label(xyz, assignments("euclidean", method, _OUTPUT, full))[1] == 2


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
        Settings of the method, or further ones by full name, such as ``ground__method="voxel-column"``.

    Returns
    -------
    labels : ndarray of uint32, shape (n,)
        The object of each point. 0: ground, noise, or of no object.
    classes : ndarray of uint8, shape (n,)
        The class of the object of each point, if the method classifies; else the LAS class of the point (2 is ground).
    """
    labels, classes, kinds = _label(xyz, assignments(method, None, _OUTPUT, settings))
    return labels, classes if kinds is None else kinds


def evaluate(pred: Any, ref: Any, cls: Any = None, *, min_points: int = 30) -> dict[str, Any]:
    """Score a segmentation against reference labels.

    Parameters
    ----------
    pred : array_like of int, shape (n,)
        Predicted object of each point, 0 for none.
    ref : array_like of int, shape (n,)
        Reference object of each point, 0 for none.
    cls : array_like of int, shape (n,), optional
        Reference class of each point, by the codes of ``chainage eval``. Without it all objects are of one class.
    min_points : int, optional
        Smallest number of points of an object.

    Returns
    -------
    dict
        ``"overall"`` and ``"classes"`` (by name), each with shares from 0 to 1: ``oa``, ``usr``, ``osr``, ``pq``, ``sq``, ``rq``,
        ``f1``, ``ari``, ``mean_best_iou``; ``None`` where a share is not defined.
    """
    labels = {}
    for name, values in {"pred": pred, "ref": ref}.items():
        array = np.asarray(values)
        if array.ndim != 1 or array.dtype.kind not in "iub":
            raise ValueError(f"{name} has {array.ndim} dimensions of {array.dtype}: must be one, of integers")
        labels[name] = np.ascontiguousarray(array, dtype=np.int64)
    classes = None if cls is None else np.ascontiguousarray(cls, dtype=np.uint16)
    lengths = [len(labels["pred"]), len(labels["ref"])] + ([] if classes is None else [len(classes)])
    if len(set(lengths)) > 1:
        raise ValueError(f"pred, ref and cls have {lengths} values: must be as many")
    with raised():
        return json.loads(_native.evaluate(labels["pred"], labels["ref"], classes, min_points))
