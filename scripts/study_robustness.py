#!/usr/bin/env python3
"""Degrades labelled scenes step by step and scores `street` on each copy, as a table for benches/results.

    scripts/study_robustness.py PROGRAM FOLDER [DATA]

Prints one row per scene and copy: the share of stacked voxels (the figure of the warning of a sparse drive), F1 over all
objects, trees and poles, the share of matched objects with the right class, and whether the run warned. FOLDER takes the copies
and is not emptied. DATA is the folder with sim (default ../shared/data). Needs numpy and laspy[lazrs].
"""

import json
import pathlib
import subprocess
import sys

import laspy
import numpy as np

SCENES = ("downtown_ts2", "suburb_ts1", "smalltrees_opt")
FOOT_M = 0.3048


def every_second_profile(las):
    """Points of every second rotation of each scanner: a profile begins where the scan angle starts anew."""
    keep = np.zeros(len(las), bool)
    angle = np.asarray(las.scan_angle, float)
    for channel in np.unique(las.scanner_channel):
        of_channel = np.flatnonzero(las.scanner_channel == channel)
        order = of_channel[np.argsort(las.gps_time[of_channel], kind="stable")]
        begins = np.abs(np.diff(angle[order], prepend=angle[order[0]])) > 15_000
        keep[order] = np.cumsum(begins) % 2 == 0
    return las[keep]


def thinned(share):
    def thin(las):
        return las[np.random.default_rng(1).random(len(las)) < share]
    return thin


def one_head(las):
    return las[las.scanner_channel == las.scanner_channel[0]]


def without_time(las):
    las.gps_time = np.zeros(len(las))
    return las


def in_feet(las):
    x, y, z = (np.asarray(axis) / FOOT_M for axis in (las.x, las.y, las.z))
    las.header.vlrs = [vlr for vlr in las.header.vlrs if vlr.user_id != "LASF_Projection"]
    las.change_scaling(scales=[0.001] * 3, offsets=np.floor([x.min(), y.min(), z.min()]))
    las.x, las.y, las.z = x, y, z
    return las


COPIES = {
    "as it is": (lambda las: las, []),
    "50 % of the points": (thinned(0.50), []),
    "25 %": (thinned(0.25), []),
    "10 %": (thinned(0.10), []),
    "5 %": (thinned(0.05), []),
    "one head": (one_head, []),
    "every second profile": (every_second_profile, []),
    "no GPS time": (without_time, []),
    "in feet": (in_feet, ["--set", "input.unit=foot"]),
}


def stacked(las):
    """Share of the voxels of 0.15 m with points of objects that have another one above or below."""
    of_object = np.asarray(las.gt_instance) > 0
    place = np.stack([np.asarray(axis)[of_object] for axis in (las.x, las.y, las.z)], 1)
    voxels = np.unique(np.floor((place - place.min(0)) / 0.15).astype(np.int64), axis=0)
    on_another = np.all(np.diff(voxels, axis=0) == [0, 0, 1], axis=1)
    return (np.append(False, on_another) | np.append(on_another, False)).mean()


def main():
    program, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    data = pathlib.Path(sys.argv[3] if len(sys.argv) > 3 else "../shared/data")
    print("| scene | copy | stacked | all | trees | poles | class right | warning |\n|---|---|---|---|---|---|---|---|")
    for scene in SCENES:
        for name, (change, options) in COPIES.items():
            las = change(laspy.read(data / "sim" / f"{scene}.laz"))
            share = f"{stacked(las):.2f}" if name != "in feet" else ""
            work = folder / scene / name.replace(" ", "-").replace("%", "percent")
            work.mkdir(parents=True, exist_ok=True)
            las.write(str(work / "copy.laz"))
            out = work / "out"
            run = subprocess.run([program, "run", work / "copy.laz", "-o", out, "-q", "--no-report", *options, "--outputs", "points"],
                                 capture_output=True, text=True)
            if run.returncode:
                print(f"| {scene} | {name} | {share} | exit {run.returncode}: {run.stderr.strip().splitlines()[-1]} |")
                continue
            subprocess.run([program, "eval", out / "copy.laz", f"--json={work / 'eval.json'}"], capture_output=True, check=True)
            score = json.loads((work / "eval.json").read_text())
            f1 = {one["name"].split()[0]: one["f1"] for one in score["classes"]}
            right = score["object_classes"]["overall"]["class_right_of_matched"]
            warned = next((line for line in run.stderr.splitlines() if "sparse" in line), "")
            print(f"| {scene} | {name} | {share} | {score['overall']['f1']:.3f} | {f1.get('tree', 0):.3f} | "
                  f"{f1.get('pole', 0):.3f} | {right:.3f} | {'yes' if warned else 'no'} |", flush=True)
            (work / "copy.laz").unlink()


if __name__ == "__main__":
    main()
