#!/usr/bin/env python3
"""Repeats a scene along its longer side: one LAS file of N copies, shifted in space and time.

    scripts/repeat_scene.py SCENE.laz OUT.las 16 [--shuffle] [--files 5]

Used by scripts/flat_memory.sh and by the speed figures. Needs laspy[lazrs] and numpy. Memory stays at a few copies of
one scene. --shuffle permutes the records; --files N cuts the drive into N files OUT_1.las, OUT_2.las, ...
"""

import argparse
import pathlib

import laspy
import numpy as np


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("copies", type=int)
    parser.add_argument("--shuffle", action="store_true", help="permute the records of all copies together")
    parser.add_argument("--files", type=int, default=1, help="cut the drive into so many files")
    return parser.parse_args()


def copy_of(scene, number, axis, step_units, step_s):
    """Record array of copy `number`, shifted by whole record units so that its points stay on the lattice."""
    points = scene.points.array.copy()
    points["XYZ"[axis]] += np.int32(number * step_units)
    if "gps_time" in points.dtype.names:
        points["gps_time"] += number * step_s
    return points


def main():
    args = parse()
    scene = laspy.read(args.scene)
    spans = [np.ptp(scene.X), np.ptp(scene.Y)]
    axis = int(np.argmax(spans))
    scale = scene.header.scales[axis]
    # Whole metres, and a gap of 2 m so that copies do not touch.
    step_units = int((int(spans[axis] * scale) + 2) / scale)
    step_s = 0.0
    if "gps_time" in scene.point_format.dimension_names:
        step_s = float(np.ptp(scene.gps_time)) + 1.0
    copies = (copy_of(scene, number, axis, step_units, step_s) for number in range(args.copies))
    if args.shuffle:
        together = np.concatenate(list(copies))
        np.random.default_rng(1).shuffle(together)
        copies = iter([together])
    total = args.copies * len(scene.points)
    bounds = [total * k // args.files for k in range(args.files + 1)]
    writers = []
    for k in range(args.files):
        name = args.out if args.files == 1 else args.out.with_stem(f"{args.out.stem}_{k + 1}")
        writers.append(laspy.open(name, mode="w", header=scene.header))
    at = 0
    for points in copies:
        for k, writer in enumerate(writers):
            lo, hi = max(bounds[k], at) - at, min(bounds[k + 1], at + len(points)) - at
            if lo < hi:
                part = laspy.ScaleAwarePointRecord(
                    points[lo:hi], scene.point_format, scene.header.scales, scene.header.offsets
                )
                writer.write_points(part)
        at += len(points)
    for writer in writers:
        writer.close()
    print(f"{total} points, {args.copies} copies {step_units * scale:.0f} m apart along {'xy'[axis]}")


if __name__ == "__main__":
    main()
