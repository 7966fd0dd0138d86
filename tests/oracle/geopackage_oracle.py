#!/usr/bin/env python3
"""Reads OUT/objects.gpkg with GDAL (pyogrio, geopandas) and compares it with OUT/objects.csv and the labelled points.

    geopackage_oracle.py OUT LABELLED.laz...

Prints "N objects agree", or fails with what differs. With `--can` it only says by its exit code whether it can run.
"""

import csv
import math
import pathlib
import sqlite3
import struct
import sys
import warnings
import xml.etree.ElementTree

import geopandas
import laspy
import numpy
import pyogrio
import shapely

WITHIN_M = 0.1


def text(value):
    """A value of the table as CSV has it, without rounding."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, (bool, numpy.bool_)):
        return str(bool(value)).lower()
    return str(value)


def same(found, expected):
    if found == expected:
        return True
    try:
        return abs(float(found) - float(expected)) < 1e-9
    except ValueError:
        return False


def main():
    out = pathlib.Path(sys.argv[1])
    path = out / "objects.gpkg"
    warnings.simplefilter("ignore", UserWarning)  # pyogrio leaves out measures
    layers = dict(pyogrio.list_layers(path))
    expected = {"objects": "Polygon", "bases": "Point Z", "axis": "LineString", "tiles": "Polygon"}
    spatial = {name: kind for name, kind in layers.items() if kind is not None}
    assert spatial == expected, layers
    with open(out / "objects.csv", newline="") as table:
        rows = list(csv.DictReader(table))
    objects = geopandas.read_file(path, layer="objects", engine="pyogrio")
    bases = geopandas.read_file(path, layer="bases", engine="pyogrio")
    assert len(objects) == len(rows) == len(bases), (len(objects), len(rows), len(bases))
    for layer in (objects, bases):
        for column in rows[0] if rows else []:
            for found, row in zip(layer[column], rows):
                # Flags of a column with missing ones are read as numbers.
                if row[column] in ("true", "false") and found in (0, 1):
                    found = bool(found)
                assert same(text(found), row[column]), (row["id"], column, found, row[column])
    assert objects.geometry.is_valid.all() and objects.geometry.exterior.is_simple.all()
    for base, row in zip(bases.geometry, rows):
        assert all(same(base.__getattribute__(k), row[f"base_{k}"]) for k in "xyz"), (base, row)
    for area, row in zip(objects.geometry.area, rows):
        # The vertices are rounded to millimetres.
        assert abs(area - float(row["area_m2"])) < 0.001 * (1 + area), (row["id"], area, row["area_m2"])
    assert len({row["uid"] for row in rows}) == len(rows)
    touches = {int(row["id"]): {int(other) for other in row["touches"].split(";") if other} for row in rows}
    assert all(one in touches[other] for one, others in touches.items() for other in others)

    points = [laspy.read(labelled) for labelled in sys.argv[2:]]
    for cloud in points:
        ids = numpy.asarray(cloud["cluster_id"])
        order = numpy.argsort(ids, kind="stable")
        starts = numpy.searchsorted(ids[order], numpy.arange(1, len(rows) + 2))
        for number, outline in enumerate(objects.geometry):
            mine = order[starts[number] : starts[number + 1]]
            places = shapely.points(numpy.asarray(cloud.x)[mine], numpy.asarray(cloud.y)[mine])
            if len(mine):
                furthest = shapely.distance(outline, places).max()
                assert furthest <= WITHIN_M + 0.001, (number + 1, furthest)
        system = cloud.header.parse_crs()
        if system is not None:
            assert objects.crs is not None and objects.crs.equals(system), (objects.crs, system)

    database = sqlite3.connect(path)
    assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    for name in expected:
        stored = database.execute(f"SELECT count(*) FROM {name} WHERE geom NOT NULL").fetchone()
        assert stored == database.execute(f"SELECT count(*) FROM rtree_{name}_geom").fetchone(), name
    for bytes_, start, end in database.execute("SELECT geom, from_m, to_m FROM axis"):
        # Header of 8 bytes and a box of 32; byte order, type 2002 (line with measures), number of places.
        order, kind, count = struct.unpack_from("<BII", bytes_, 40)
        places = struct.unpack_from(f"<{3 * count}d", bytes_, 49)
        measures = places[2::3]
        assert (order, kind, len(bytes_)) == (1, 2002, 49 + 24 * count)
        assert all(a < b for a, b in zip(measures, measures[1:])) and (measures[0], measures[-1]) == (start, end)
    styles = database.execute("SELECT styleQML FROM layer_styles").fetchall()
    assert len(styles) == len(expected)
    for (style,) in styles:
        assert xml.etree.ElementTree.fromstring(style).tag == "qgis"
    print(f"{len(rows)} objects agree")


if sys.argv[1] != "--can":
    main()
