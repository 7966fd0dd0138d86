#!/usr/bin/env python3
"""Compares the heights of objects with the highest points that the scanner saw of them, and the bases of trees and buildings with the true ones.

    scripts/study_measures.py PROGRAM DRIVE...

A DRIVE is a folder of `chainage synth` or `score_street.py`, or a scene SCENE.laz with SCENE_reference.csv beside it. Only objects that
overlap with a labelled one with an IoU above 0.8 count, and of class 6 none: the height of a long fence is not that of its highest
point. The top of an object is base_z + height_m. Prints, by class: objects, RMSE of the top, and how many are wrong by more than 0.3 m and
1 m. Then, by drive, for trees and for buildings: objects, and RMSE and median of the distance of their bases in the plane. Needs numpy and laspy[lazrs].
"""

import collections
import csv
import math
import pathlib
import subprocess
import sys
import tempfile

import laspy
import numpy as np

NAMES = {2: "tree", 3: "pole", 4: "vehicle", 5: "building", 7: "small"}
LEAST_IOU = 0.8


def points_of(folder):
    """Object, true instance and z of every point of an output folder."""
    columns = [[], [], []]
    for path in sorted(folder.glob("*.la[sz]")):
        las = laspy.read(path)
        for column, values in zip(columns, (las["cluster_id"], las["gt_instance"], las.z)):
            column.append(np.asarray(values))
    found, true, z = (np.concatenate(column) for column in columns)
    return found.astype(np.int64), true.astype(np.int64), z


def instances(drive):
    """The labelled objects of a drive, each with its row."""
    table = drive / "reference.csv" if drive.is_dir() else drive.with_name(drive.stem + "_reference.csv")
    with open(table, newline="") as file:
        return {int(row["instance"]): row for row in csv.DictReader(file)}


def base_error(found, true):
    """Distance of the bases of a tree or building in the plane; None where the true one is not known."""
    if found["class"] not in "25" or true["class"] != found["class"] or true.get("base_inside", "1") != "1":
        return None
    return math.dist(*((float(row["base_x"]), float(row["base_y"])) for row in (found, true)))


def errors(program, drive):
    """Class, error of the top, and, of trees and buildings, error of the base in the plane, of each object that was found."""
    trajectory = drive / "trajectory.csv" if drive.is_dir() else drive.with_name(drive.stem + "_trajectory.csv")
    labelled = instances(drive)
    with tempfile.TemporaryDirectory() as scratch:
        out = pathlib.Path(scratch) / "out"
        command = [program, "run", drive, "-o", out, "-q", "--outputs", "points,csv"]
        command += ["--trajectory", trajectory] if trajectory.exists() else []
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        with open(out / "objects.csv", newline="") as file:
            table = {int(row["id"]): row for row in csv.DictReader(file)}
        found, true, z = points_of(out)
    numbers, place = np.unique(true, return_inverse=True)
    sizes = np.bincount(place)
    tops = np.full(len(numbers), -np.inf)
    np.maximum.at(tops, place, z)
    order = np.argsort(found, kind="stable")
    objects, first = np.unique(found[order], return_index=True)
    for label, of in zip(objects, np.split(order, first[1:])):
        if label == 0 or not table[label]["height_m"] or int(table[label]["class"]) not in NAMES:
            continue
        places, counts = np.unique(place[of], return_counts=True)
        most = places[counts.argmax()]
        common = counts.max()
        if int(numbers[most]) in labelled and common / (len(of) + sizes[most] - common) > LEAST_IOU:
            top = float(table[label]["base_z"]) + float(table[label]["height_m"])
            yield int(table[label]["class"]), top - tops[most], base_error(table[label], labelled[int(numbers[most])])


def main():
    program, *drives = sys.argv[1:]
    of_class = collections.defaultdict(list)
    bases = collections.defaultdict(list)
    for drive in map(pathlib.Path, drives):
        for code, top, base in errors(program, drive):
            of_class[code].append(top)
            if base is not None:
                for name in (drive.stem, "all"):
                    bases[code, name].append(base)
    print("| class | objects | RMSE, m | above 0.3 m | above 1 m |\n|---|---:|---:|---:|---:|")
    for code, found in sorted(of_class.items()):
        found = np.abs(found)
        rmse = np.sqrt(np.mean(found**2))
        print(f"| {NAMES[code]} | {len(found)} | {rmse:.3f} | {(found > 0.3).sum()} | {(found > 1).sum()} |")
    print("\n| class | drive | objects | RMSE of the base, m | median, m |\n|---|---|---:|---:|---:|")
    for (code, name), found in sorted(bases.items()):
        print(f"| {NAMES[code]} | {name} | {len(found)} | {np.sqrt(np.mean(np.square(found))):.3f} | {np.median(found):.3f} |")


main()
