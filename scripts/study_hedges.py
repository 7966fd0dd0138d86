#!/usr/bin/env python3
"""Counts what the column `hedge` says of the objects of class 6, by what they are in truth.

    scripts/study_hedges.py PROGRAM FOLDER

FOLDER/drives has the drives that `score_street.py PROGRAM FOLDER` makes: their `reference.csv` says of which kind an object is. An
object is of the kind of most of its points. Prints one row per group of drives and kind: objects, the share of them that are
hedges, and the same share of their points. Nothing was chosen on drives from seed 1000 on that are no sweeps. Needs numpy and
laspy[lazrs].
"""

import collections
import csv
import pathlib
import subprocess
import sys
import tempfile

import laspy
import numpy as np

FENCE = 6
HEDGES = ("hedge", "bush", "shrub")
OTHERS = ("fence", "wall", "rail")


def group(drive):
    name, _, seed = drive.rpartition("-")
    seed = int(seed)
    if name in ("speed", "grade", "hillside", "cutting", "embankment", "bridges", "tunnel"):
        return "land and speeds"
    if 1061 <= seed <= 1072:
        return "single sweeps"
    return "drives, seeds from 1000" if seed >= 1000 else "drives, seeds below 1000"


def points_of(folder):
    """Object, class of the object, and true instance of every point of an output folder."""
    columns = [[], [], []]
    for path in sorted(folder.glob("*.la[sz]")):
        las = laspy.read(path)
        for column, name in zip(columns, ("cluster_id", "object_class", "gt_instance")):
            column.append(np.asarray(las[name], np.int64))
    return [np.concatenate(column) for column in columns]


def rows_of(program, drive):
    """Of each object of class 6: true kind, whether the program calls it a hedge, points."""
    with open(drive / "reference.csv") as file:
        kinds = {int(row["instance"]): row["kind"] for row in csv.DictReader(file)}
    with tempfile.TemporaryDirectory() as scratch:
        out = pathlib.Path(scratch) / "out"
        command = [program, "run", drive, "-o", out, "-q", "--outputs", "points,csv"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        with open(out / "objects.csv") as file:
            hedge = {int(row["id"]): row["hedge"] for row in csv.DictReader(file) if int(row["class"]) == FENCE}
        labels, classes, truth = points_of(out)
    of_class = classes == FENCE
    labels, truth = labels[of_class], truth[of_class]
    order = np.argsort(labels, kind="stable")
    labels, truth = labels[order], truth[order]
    found, first = np.unique(labels, return_index=True)
    for label, instances in zip(found, np.split(truth, first[1:])):
        of, counts = np.unique(instances, return_counts=True)
        yield kinds.get(int(of[counts.argmax()]), "none"), hedge[int(label)] == "true", len(instances)


def main():
    program, folder = sys.argv[1:]
    table = collections.defaultdict(list)
    for drive in sorted((pathlib.Path(folder) / "drives").iterdir()):
        if (drive / "reference.csv").exists():
            for kind, hedge, points in rows_of(program, drive):
                kind = kind if kind in HEDGES + OTHERS else "something else"
                table[group(drive.name), kind].append((hedge, points))
    print("| drives | kind | objects | called hedge | of their points |\n|---|---|---|---|---|")
    for (of, kind), rows in sorted(table.items()):
        hedge, points = (np.array(column) for column in zip(*rows))
        print(f"| {of} | {kind} | {len(rows)} | {hedge.mean():.1%} | {points[hedge].sum() / points.sum():.1%} |")


main()
