"""Drives of files: run, plan, status, and the table of objects."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from chainage import _native
from chainage.errors import InputError, raised
from chainage.settings import Value, assignments, mebibytes

PathArgument = str | os.PathLike[str]


def _files(files: PathArgument | Sequence[PathArgument]) -> list[PathArgument]:
    return [files] if isinstance(files, str | os.PathLike) else list(files)


def run(
    files: PathArgument | Sequence[PathArgument],
    out: PathArgument,
    *,
    method: str | None = None,
    ground: str | None = None,
    memory: int | str | None = None,
    threads: int | None = None,
    tile_length: float | None = None,
    preset: str | None = None,
    config: PathArgument | None = None,
    fresh: bool = False,
    progress: Callable[[dict[str, Any]], object] | None = None,
    **settings: Value,
) -> dict[str, Any]:
    """Process a drive, or resume an interrupted run.

    Parameters
    ----------
    files : path or sequence of paths
        LAS or LAZ files, folders, or patterns such as ``"drive/*.laz"``.
    out : path
        Output directory. A run in it resumes.
    method : str, optional
        Clustering method, by default ``"street"``.
    ground : str, optional
        Ground filter, by default ``"opening"``.
    memory : int or str, optional
        Memory budget as a whole number of MiB, or as text such as ``"4G"`` or ``"800M"``. By default half of the free memory.
    threads : int, optional
        Worker threads, by default one per core.
    tile_length : float, optional
        Length of a tile in metres of chainage. By default as long as the memory allows.
    preset : str, optional
        Settings of a preset instead of the defaults.
    config : path, optional
        Configuration file.
    fresh : bool, optional
        Whether the state of an earlier run in `out` is discarded.
    progress : callable, optional
        Called with every event of the run, a dict with the key ``"event"``. If it raises an exception, the run stops.
    **settings
        Further settings: ``max_gap_m=0.4`` in the section of `method`, or ``noise__enabled=False``.

    Returns
    -------
    dict
        Points, objects, points by class, tiles, seconds, and warnings.

    Raises
    ------
    ChainageError
        Of the kind of the failure, with the exit code of the program and a hint. Finished tiles are kept.
    KeyboardInterrupt
        After Ctrl-C. Tiles in flight are finished, and the same call resumes.

    Examples
    --------
    >>> import chainage
    >>> chainage.run("drive.laz", "out", method="euclidean", max_gap_m=0.4)["objects"]  # doctest: +SKIP
    318
    """
    named = {"run.memory_mib": None if memory is None else mebibytes(memory), "run.threads": threads}
    named["tiling.tile_length"] = tile_length
    told = None if progress is None else lambda event: progress(json.loads(event))
    with raised():
        return json.loads(
            _native.run(
                _files(files), out, preset, config, assignments(method, ground, named, settings), fresh, told
            )
        )


def plan(
    files: PathArgument | Sequence[PathArgument],
    *,
    method: str | None = None,
    ground: str | None = None,
    memory: int | str | None = None,
    threads: int | None = None,
    tile_length: float | None = None,
    preset: str | None = None,
    config: PathArgument | None = None,
    **settings: Value,
) -> dict[str, Any]:
    """Show the tiles of a run, and estimate its memory and time. Writes nothing.

    The parameters are those of `run`.

    Returns
    -------
    dict
        Tiles (chainage in metres, points, bytes), points of the drive, memory in bytes, and warnings.
    """
    named = {"run.memory_mib": None if memory is None else mebibytes(memory), "run.threads": threads}
    named["tiling.tile_length"] = tile_length
    with raised():
        return json.loads(
            _native.plan(_files(files), preset, config, assignments(method, ground, named, settings))
        )


def status(out: PathArgument) -> dict[str, Any]:
    """Show which passes of a run are done, missing or stale, and why.

    Parameters
    ----------
    out : path
        Output directory of a run.

    Returns
    -------
    dict
        The passes in order with their units, and whether every output is complete.
    """
    with raised():
        return json.loads(_native.status(out))


# Types of the columns in a frame, by the names of the types in the table of columns of README. Lists are objects of Python.
_DTYPES: dict[str, Any] = {"whole number": "int64", "number": "float64", "text": str, "true or false": bool}


def _column(name: str, types: Mapping[str, str], rows: Sequence[Mapping[str, Any]]) -> Any:
    import pandas

    values = [row[name] for row in rows]
    return pandas.Series(values, dtype=_DTYPES.get(types[name], object)) if name in types else pandas.Series(values)


def _crs(member: Mapping[str, Any] | None) -> Any:
    """The coordinate system that the member ``crs`` of a GeoJSON file names, if it names one."""
    import pyproj

    if member is None:
        return None
    name = member["properties"]["name"]
    try:
        return pyproj.CRS.from_user_input(name)
    except pyproj.exceptions.CRSError:
        warnings.warn(f"the coordinate system {name} is not known to pyproj: crs is None", stacklevel=3)
        return None


def objects(out: PathArgument) -> Any:
    """Read the table of objects of a finished run.

    Parameters
    ----------
    out : path
        Output directory of a run.

    Returns
    -------
    geopandas.GeoDataFrame, pandas.DataFrame or list of dict
        One row per object, in ascending order of ``id``: outlines as geometries in the units and the coordinate system of the input
        where GeoPandas is installed, values alone where pandas is, else a list of dicts. A frame has all columns with the same types
        after every run: whole numbers are ``int64``, numbers are ``float64`` (``NaN`` where one is missing). Its ``crs`` is None if
        the files name no EPSG code.
    """
    path = Path(out) / "objects.geojson"
    if not path.is_file():
        raise InputError(
            f"{path} does not exist", "chainage.run(files, out) writes it, unless output.files leaves geojson out"
        )
    collection = json.loads(path.read_text(encoding="utf-8"))
    features = collection["features"]
    rows = [feature["properties"] for feature in features]
    try:
        import pandas
    except ImportError:
        return rows
    types = dict(_native.columns())
    frame = pandas.DataFrame({name: _column(name, types, rows) for name in (rows[0] if rows else types)})
    try:
        import geopandas
        import shapely.geometry
    except ImportError:
        return frame
    outlines = [
        None if feature["geometry"] is None else shapely.geometry.shape(feature["geometry"]) for feature in features
    ]
    return geopandas.GeoDataFrame(frame, geometry=outlines, crs=_crs(collection.get("crs")))
