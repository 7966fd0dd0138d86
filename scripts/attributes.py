#!/usr/bin/env python3
"""Compares the measured attributes of objects with the truth, as a table for benches/results/attributes.md.

    scripts/attributes.py [--length 300m] [-o benches/results/attributes.md] [SCENE.laz ...]

Drives of `chainage synth` (suburb, downtown, avenue), and scenes with a SCENE_reference.csv beside them, are processed
with `--method street --ground opening --trajectory` (SCENE_trajectory.csv). An object is compared with the labelled one
if they overlap with an IoU above 0.8 of their points. Bias is the mean of measured minus true; RMSE is of the
differences, of the distance in the plane for the base. Needs a build (CHAINAGE, else target/release/chainage), and numpy, laspy and lazrs.
"""

import argparse
import csv
import math
import os
import pathlib
import subprocess
import tempfile

import laspy
import numpy

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.path.abspath(os.environ.get("CHAINAGE", ROOT / "target/release/chainage"))
PRESETS = ["suburb", "downtown", "avenue"]
NAMES = {2: "tree", 3: "pole", 4: "vehicle", 5: "building", 6: "fence, hedge", 7: "small", 8: "wire"}
LEAST_IOU = 0.8
HEAD = """# Attributes of objects against the truth

Written by `{command}` at commit {commit}: drives of `chainage synth` with seed 7, and labelled scenes, processed with `--method
street --ground opening --trajectory`. An object is compared with the labelled one if they overlap with an IoU above 0.8 of their points.
*Compared*: such pairs. *Measured*: those of them in which neither value is empty. *Bias*: mean of measured minus true. *RMSE*: of these
differences; for the base, of the distance in the plane; for the inclination, of the angle between the two axes.

Heights are compared twice: with the model, and with the highest point that the scanner saw. The true base of a building is the middle of its
front, and that of a fence its middle: on a slope the ground there is not that of the measured base, so the base is also compared with the
labelled ground around it. The true clearance is that of the points of the object, over the true ground and the driven path. Crowns of the model are those of the centres
of leaves. Labelled scenes without these columns have no crowns, stems and inclinations to compare.
"""


def rows(path):
    with open(path, newline="") as text:
        return list(csv.DictReader(text))


def overlaps(points):
    """Pairs (object, instance) with an IoU above the least, from the points of the labelled copy."""
    found = numpy.asarray(points["cluster_id"]).astype(numpy.uint64)
    true = numpy.asarray(points["gt_instance"]).astype(numpy.uint64)
    both, counts = numpy.unique((found << numpy.uint64(32)) | true, return_counts=True)
    of_object = dict(zip(*numpy.unique(found, return_counts=True)))
    of_instance = dict(zip(*numpy.unique(true, return_counts=True)))
    for pair, common in zip(both.tolist(), counts.tolist()):
        a, b = pair >> 32, pair & 0xFFFFFFFF
        if a and b and common / (of_object[a] + of_instance[b] - common) > LEAST_IOU:
            yield a, b


class TrueGround:
    """Height of the labelled ground at a place: the median of its points within 0.5 m in x and in y."""

    def __init__(self, points):
        ground = numpy.asarray(points["gt_class"]) == 1
        places = numpy.column_stack([points.x, points.y, points.z])[ground]
        self.places = places[numpy.argsort(places[:, 0])]

    def at(self, x, y):
        first, last = numpy.searchsorted(self.places[:, 0], [x - 0.5, x + 0.5])
        near = self.places[first:last]
        heights = near[abs(near[:, 1] - y) <= 0.5, 2]
        return float(numpy.median(heights)) if len(heights) >= 5 else math.nan


def number(text):
    return float(text) if text not in (None, "") else math.nan


def compare(out, labelled, reference):
    """Differences of every attribute of every compared object: (class, attribute, difference)."""
    measured = {int(row["id"]): row for row in rows(out / "objects.csv")}
    true = {int(row["instance"]): row for row in rows(reference)}
    points = laspy.read(labelled)
    ground = TrueGround(points)
    for found, instance in overlaps(points):
        a, b = measured[found], true[instance]
        kind = int(b["class"])
        if "base_inside" in b and b["base_inside"] != "1":
            continue
        get = lambda row, name: number(row.get(name))
        dx, dy = (get(a, f"base_{k}") - get(b, f"base_{k}") for k in "xy")
        yield kind, "base in the plane, m", math.hypot(dx, dy)
        yield kind, "base height, m", get(a, "base_z") - get(b, "base_z")
        yield kind, "base over the ground there, m", get(a, "base_z") - ground.at(get(a, "base_x"), get(a, "base_y"))
        yield kind, "height against the model, m", get(a, "height_m") - get(b, "model_height")
        seen = get(b, "zmax") - get(b, "base_z")
        yield kind, "height against its points, m", get(a, "height_m") - seen
        yield kind, "dbh, m", get(a, "dbh_m") - get(b, "dbh")
        crown = get(b, "crown_diameter")
        yield kind, "crown diameter, %", 100 * (get(a, "crown_diameter_m") - crown) / crown
        yield kind, "inclination, deg", leaning_apart(a, b)
        yield kind, "clearance, m", get(a, "clearance_m") - get(b, "clearance")


def leaning_apart(a, b):
    """Angle between the measured and the true axis in degrees."""
    def axis(lean, azimuth):
        lean, azimuth = math.radians(number(lean)), math.radians(number(azimuth))
        return math.sin(lean) * math.sin(azimuth), math.sin(lean) * math.cos(azimuth), math.cos(lean)

    one = axis(a.get("inclination_deg"), a.get("inclination_azimuth_deg"))
    other = axis(b.get("inclination"), b.get("inclination_azimuth"))
    if any(map(math.isnan, one + other)):
        return math.nan
    return math.degrees(math.acos(max(-1.0, min(1.0, sum(x * y for x, y in zip(one, other))))))


def call(*arguments):
    subprocess.run([PROGRAM, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)


def table(name, differences):
    """A table of a drive in Markdown."""
    groups = {}
    for kind, attribute, difference in differences:
        groups.setdefault((kind, attribute), []).append(difference)
    lines = [f"\n## {name}\n", "| class | attribute | compared | measured | bias | RMSE | median of the absolute |", "|---|---|---|---|---|---|---|"]
    for (kind, attribute), values in sorted(groups.items()):
        known = numpy.array([value for value in values if not math.isnan(value)])
        if not len(known):
            continue
        # A distance has no sign, so it has no bias.
        signed = attribute not in ("base in the plane, m", "inclination, deg")
        bias = f"{known.mean():+.3f}" if signed else ""
        rmse = math.sqrt((known**2).mean())
        middle = numpy.median(abs(known))
        label = NAMES.get(kind, str(kind))
        lines.append(f"| {label} | {attribute} | {len(values)} | {len(known)} | {bias} | {rmse:.3f} | {middle:.3f} |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", type=pathlib.Path, metavar="SCENE.laz")
    parser.add_argument("--length", default="300m", help="length of each synthetic drive")
    parser.add_argument("--presets", nargs="*", default=PRESETS)
    parser.add_argument("--keep", type=pathlib.Path, help="folder for the drives and runs, which are then reused")
    parser.add_argument("-o", "--output", type=pathlib.Path)
    choice = parser.parse_args()
    commit = subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout.strip()
    command = f"scripts/attributes.py --length {choice.length} {' '.join(scene.name for scene in choice.scenes)}".strip()
    text = [HEAD.format(commit=commit, command=command)]
    with tempfile.TemporaryDirectory() as scratch:
        folder = choice.keep or pathlib.Path(scratch)
        cases = []
        for preset in choice.presets:
            drive = folder / preset
            if not (drive / "reference.csv").exists():
                call("synth", preset, "-o", drive, "--length", choice.length, "--seed", "7")
            cases.append((f"synth {preset}, {choice.length}", drive / f"{preset}_0001.laz", drive / "reference.csv", drive / "trajectory.csv"))
        for scene in choice.scenes:
            beside = lambda what: scene.with_name(f"{scene.stem}_{what}.csv")
            cases.append((scene.stem, scene, beside("reference"), beside("trajectory")))
        for name, points, reference, trajectory in cases:
            out = folder / f"out-{points.stem}"
            call("run", points, "-o", out, "--method", "street", "--ground", "opening", "--trajectory", trajectory, "--progress", "none")
            text.append(table(name, compare(out, out / points.name, reference)))
    result = "".join(text)
    print(result)
    if choice.output:
        choice.output.write_text(result)


if __name__ == "__main__":
    main()
