#!/usr/bin/env python3
"""Writes a scene with its records shuffled and cut into five files, and compares the results of chainage.

    scripts/compare_orders.py write SCENE.laz FOLDER
    scripts/compare_orders.py compare LABELLED.laz ORDER.npy SHUFFLED.las SPLIT_1.las ... SPLIT_5.las

Used by scripts/exactness.sh. It compares the partition (every object by its first point) and the classes,
point by point. Needs laspy[lazrs] and numpy.
"""

import pathlib
import sys

import laspy
import numpy as np

FILES = 5


def records(header, points):
    return laspy.ScaleAwarePointRecord(points, header.point_format, header.scales, header.offsets)


def save(path, header, points):
    with laspy.open(path, mode="w", header=header) as writer:
        writer.write_points(records(header, points))


def write(scene, folder):
    las = laspy.read(scene)
    points = las.points.array
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    order = np.random.default_rng(7).permutation(len(points))
    np.save(folder / "order.npy", order)
    save(folder / "shuffled.las", las.header, points[order])
    for number, part in enumerate(np.array_split(points, FILES), 1):
        save(folder / f"split_{number}.las", las.header, part)


def labels(paths):
    files = [laspy.read(path) for path in paths]
    join = lambda field: np.concatenate([np.asarray(field(las)) for las in files])
    place = join(lambda las: np.stack([las.X, las.Y, las.Z], axis=1))
    return join(lambda las: las.cluster_id), join(lambda las: las.classification), place


def partition(label):
    """For every point the index of the first point with its label; -1 without one."""
    first = np.full(int(label.max()) + 1, len(label))
    np.minimum.at(first, label, np.arange(len(label)))
    return np.where(label == 0, -1, first[label])


def compare(labelled, order, shuffled, split):
    label, classes, place = labels([labelled])
    order = np.load(order)
    differences = []
    for name, paths, at in [
        ("shuffled", [shuffled], order),
        ("five files", split, np.arange(len(label))),
    ]:
        other_label, other_classes, other_place = labels(paths)
        if not np.array_equal(other_place, place[at]):
            differences.append(f"{name}: these are not the same points")
        if not np.array_equal(other_classes, classes[at]):
            differences.append(f"{name}: {np.count_nonzero(other_classes != classes[at])} classes")
        wrong = np.count_nonzero(partition(other_label) != partition(label[at]))
        if wrong:
            differences.append(f"{name}: {wrong} points in another object")
    for text in differences:
        print(f"DIFFERS: {labelled}: {text}")
    return not differences


if __name__ == "__main__":
    command, *arguments = sys.argv[1:]
    if command == "write":
        write(*arguments)
    elif not compare(arguments[0], arguments[1], arguments[2], arguments[3:]):
        sys.exit(1)
