#!/usr/bin/env python3
"""Reads a cloud-optimised file with laspy, and compares its points with those of labelled copies.

    tests/oracle/copc_oracle.py drive.copc.laz COPY.laz...

Ends with 77 where laspy or lazrs is missing.
"""

import sys

try:
    import laspy
    import lazrs  # noqa: F401, laspy needs it
    import numpy
    from laspy.copc import Bounds
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)


def table(points):
    """The points in an order of their own: place, object and its class."""
    columns = [numpy.round(numpy.asarray(values) * 1e4).astype(numpy.int64) for values in (points.x, points.y, points.z)]
    columns += [numpy.asarray(points["cluster_id"], dtype=numpy.int64)]
    columns += [numpy.asarray(points["object_class"], dtype=numpy.int64)]
    rows = numpy.stack(columns, axis=1)
    return rows[numpy.lexsort(rows.T)]


def main():
    cloud, *copies = sys.argv[1:]
    expected = numpy.concatenate([table(laspy.read(copy)) for copy in copies])
    expected = expected[numpy.lexsort(expected.T)]
    with laspy.CopcReader.open(cloud) as reader:
        found = table(reader.query())
        assert found.shape == expected.shape, (found.shape, expected.shape)
        assert (found == expected).all(), "points differ"
        header = reader.header
        assert header.point_count == len(expected)
        for axis in range(3):
            low, high = expected[:, axis].min() / 1e4, expected[:, axis].max() / 1e4
            assert abs(header.mins[axis] - low) < 1e-3 and abs(header.maxs[axis] - high) < 1e-3
        # A box gives the points in it, so every point is in a node that contains it.
        middle = (header.mins + header.maxs) / 2
        low, high = middle - (header.maxs - header.mins) / 5, middle + (header.maxs - header.mins) / 7
        part = table(reader.query(bounds=Bounds(mins=low, maxs=high)))
        inside = ((expected[:, :3] >= numpy.ceil(low * 1e4)) & (expected[:, :3] <= numpy.floor(high * 1e4))).all(axis=1)
        assert len(part) == inside.sum() > 100, (len(part), inside.sum())
        # Coarse levels are few points, spread over the drive.
        coarse = reader.query(level=0)
        assert 100 < len(coarse) < len(expected) / 2, len(coarse)
        assert numpy.ptp(coarse.x) > 0.8 * numpy.ptp(expected[:, 0]) / 1e4
    print(f"{len(expected):,} points, {len(coarse):,} of them in the root")


if __name__ == "__main__":
    main()
