#!/usr/bin/env python3
"""Compares ground filters on labelled scenes, synthetic drives and real scans, as tables for benches/results.

    scripts/study_ground.py PROGRAM RESULTS FOLDER [DATA]

DATA is the folder with sim, real-labelled and real (default ../shared/data); what is not there is left out. FOLDER takes
synthetic drives and one file of figures for each scene and method; what is there is not done again. RESULTS takes
ground.md: its tables are made anew, the text before the line "<!-- tables -->" stays. Needs numpy, scipy and laspy[lazrs];
CSF where cloth-simulation-filter is installed.

Beside the filters of PROGRAM: CSF (Zhang et al. 2016, the authors' package) and SMRF (Pingel et al. 2013, as written in
this file with the defaults of PDAL's filters.smrf).
"""

import json
import pathlib
import platform
import shutil
import subprocess
import sys
import time

import laspy
import numpy as np
from scipy import ndimage

PRESETS = ("suburb", "downtown", "avenue", "highway")
LENGTH = "300m"
RATE = "60000"
PROGRAM_METHODS = {
    "voxel-column": ["--ground", "voxel-column", "--set", "voxel-column.lowest_points=1"],
    "voxel-column, 2": ["--ground", "voxel-column", "--set", "voxel-column.lowest_points=2"],
    "voxel-column, 3": ["--ground", "voxel-column", "--set", "voxel-column.lowest_points=3"],
    "voxel-column, 5": ["--ground", "voxel-column", "--set", "voxel-column.lowest_points=5"],
    "upward-growing": ["--ground", "upward-growing"],
    "opening": ["--ground", "opening"],
}


def read(path):
    """Points in metres and what is known of them; `none` and `unsure` are left out of the scores."""
    xyz, truth, scored = [], [], []
    for file in sorted(path.glob("*.la[sz]")) if path.is_dir() else [path]:
        las = laspy.read(file)
        names = set(las.point_format.extra_dimension_names)
        xyz.append(np.stack([las.x, las.y, las.z], 1))
        classes = np.asarray(las["gt_class"]) if "gt_class" in names else np.zeros(len(las.points), np.uint8)
        truth.append(classes == 1)
        # Labelled by hand: only where labels are complete, and what the eye was not sure of has the class 0.
        by_hand = (np.asarray(las["gt_core"]) == 1) & (classes != 0) if "gt_core" in names else np.ones(len(classes), bool)
        scored.append(by_hand)
    return np.concatenate(xyz), np.concatenate(truth), np.concatenate(scored)


def program(executable, source, folder, arguments):
    """Ground after `chainage run`, and points per second of its pass (decoding and noise included)."""
    out = folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    command = [executable, "run", source, "-o", out, "--progress", "none", "--threads", "1", *arguments]
    subprocess.run(command, check=True, capture_output=True)
    report = json.loads((out / "report.json").read_text())
    seconds = next(entry["seconds"] for entry in report["result"]["passes"] if entry["pass"] == "ground")
    names = [file.name for file in sorted(source.glob("*.la[sz]"))] if source.is_dir() else [source.name]
    ground = np.concatenate([np.asarray(laspy.read(out / name).classification) == 2 for name in names])
    shutil.rmtree(out)
    return ground, len(ground) / seconds


def csf(xyz):
    """Cloth simulation with the package's defaults for flat urban scenes."""
    import CSF  # not everybody has it

    start = time.perf_counter()
    filter_ = CSF.CSF()
    filter_.params.bSloopSmooth = True
    filter_.params.cloth_resolution = 0.5
    filter_.params.rigidness = 2
    filter_.params.class_threshold = 0.3
    filter_.setPointCloud(xyz - xyz.min(0))
    inside, outside = CSF.VecInt(), CSF.VecInt()
    filter_.do_filtering(inside, outside, False)
    ground = np.zeros(len(xyz), bool)
    ground[np.array(inside, int)] = True
    return ground, len(xyz) / (time.perf_counter() - start)


def filled(grid):
    """Empty cells take the nearest value."""
    nearest = ndimage.distance_transform_edt(np.isnan(grid), return_distances=False, return_indices=True)
    return grid[tuple(nearest)]


def smrf(xyz, cell=1.0, slope=0.15, window=18.0, threshold=0.5, scalar=1.25):
    """Pingel et al. 2013; empty cells by their nearest neighbour."""
    start = time.perf_counter()
    at = np.floor((xyz[:, :2] - xyz[:, :2].min(0)) / cell).astype(int)
    shape = at.max(0) + 1
    lows = np.full(shape, np.inf)
    np.minimum.at(lows, (at[:, 0], at[:, 1]), xyz[:, 2])
    lows[np.isinf(lows)] = np.nan
    surface = filled(lows)

    def opened(grid, radius):
        steps = np.arange(-radius, radius + 1)
        return ndimage.grey_opening(grid, footprint=(steps[:, None] ** 2 + steps[None, :] ** 2) <= radius ** 2)

    # Low outliers: the surface turned over, opened once with a steep slope.
    is_low = -surface - opened(-surface, 1) > 5.0 * cell
    is_object, last = np.zeros(shape, bool), surface
    for radius in range(1, int(np.ceil(window / cell)) + 1):
        now = opened(last, radius)
        is_object |= last - now > slope * radius * cell
        last = now
    surface = filled(np.where(is_object | is_low | np.isnan(lows), np.nan, surface))
    steep = np.hypot(*np.gradient(surface, cell)) if min(shape) > 1 else np.zeros(shape)
    place = (xyz[:, :2] - xyz[:, :2].min(0)) / cell - 0.5
    height = ndimage.map_coordinates(surface, place.T, order=1, mode="nearest")
    allowed = threshold + scalar * ndimage.map_coordinates(steep, place.T, order=1, mode="nearest")
    return np.abs(xyz[:, 2] - height) <= allowed, len(xyz) / (time.perf_counter() - start)


def raster(xyz, chosen):
    """Median height of the chosen points by cell of 1 m."""
    cell = np.floor(xyz[chosen][:, :2]).astype(np.int64)
    key = cell[:, 0] * 10_000_000 + cell[:, 1]
    z = xyz[chosen][:, 2]
    order = np.lexsort((z, key))
    keys, first, count = np.unique(key[order], return_index=True, return_counts=True)
    return keys, z[order][first + count // 2]


def figures(xyz, truth, scored, ground, speed):
    """One line of a table."""
    keys, inverse = np.unique(np.floor(xyz[:, :2]).astype(np.int64) @ np.array([10_000_000, 1]), return_inverse=True)
    low = np.full(len(keys), np.inf)
    np.minimum.at(low, inverse, xyz[:, 2])
    near = xyz[:, 2] < low[inverse] + 0.3
    result = {"ground": float(ground.mean()), "low": float(ground[near].mean()), "speed": speed}
    if truth.any():
        right = float((ground & truth & scored).sum())
        result["precision"] = right / max(1.0, float((ground & scored).sum()))
        result["recall"] = right / float((truth & scored).sum())
        true_keys, true_z = raster(xyz, truth & scored)
        keys, z = raster(xyz, ground)
        _, one, other = np.intersect1d(true_keys, keys, return_indices=True)
        error = np.abs(true_z[one] - z[other])
        result["cells"] = len(one) / len(true_keys)
        result["mean_error"], result["large"] = float(error.mean()), float((error > 0.2).mean())
    return result


def scenes(executable, folder, data):
    found = {}
    for part in ("sim", "real-labelled"):
        for file in sorted((data / part).glob("*.laz")):
            found[f"{file.stem}" + (" (by hand)" if part == "real-labelled" else "")] = file
    for preset in PRESETS:
        drive = folder / f"synth-{preset}"
        if not drive.exists():
            subprocess.run([executable, "synth", preset, "-o", drive, "--length", LENGTH, "--pulse-rate", f"{RATE}Hz", "--las"],
                           check=True, capture_output=True)
        found[f"synth {preset}"] = drive
    for file in sorted((data / "real").glob("*.la[sz]")):
        if not (data / "real-labelled" / file.name).exists():
            found[f"{file.stem} (real)"] = file
    return found


def show(value, digits=4):
    return "-" if value is None else f"{value:.{digits}f}"


def tables(results, methods):
    lines = []
    for title, key, digits in (("Precision", "precision", 4), ("Recall", "recall", 4),
                               ("Mean error of the ground raster (m)", "mean_error", 3),
                               ("Share of raster cells that are wrong by more than 0.2 m", "large", 4),
                               ("Share of true ground cells that have ground", "cells", 4),
                               ("Share of the points that is ground", "ground", 4),
                               ("Ground among points in the lowest 0.3 m of cells of 1 m", "low", 4),
                               ("Million points per second, one thread", "speed", 2)):
        lines += [f"## {title}", "", "| scene | " + " | ".join(methods) + " |", "|---" * (len(methods) + 1) + "|"]
        for scene, by_method in results.items():
            values = [by_method.get(method, {}).get(key) for method in methods]
            if any(value is not None for value in values):
                scale = 1e-6 if key == "speed" else 1
                cells = [show(None if value is None else value * scale, digits) for value in values]
                lines.append(f"| {scene} | " + " | ".join(cells) + " |")
        lines.append("")
    return lines


def main():
    executable, target, folder = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    data = pathlib.Path(sys.argv[4] if len(sys.argv) > 4 else "../shared/data")
    folder.mkdir(parents=True, exist_ok=True)
    results, methods = {}, [*PROGRAM_METHODS, "SMRF", "CSF"]
    for name, source in scenes(executable, folder, data).items():
        cloud = None
        for method in methods:
            kept = folder / f"{name}-{method}.json"
            if not kept.exists():
                cloud = cloud or read(source)
                try:
                    if method in PROGRAM_METHODS:
                        ground, speed = program(executable, source, folder, PROGRAM_METHODS[method])
                    else:
                        ground, speed = {"SMRF": smrf, "CSF": csf}[method](cloud[0])
                except ImportError as missing:
                    print(f"{method} is left out: {missing}", file=sys.stderr)
                    continue
                kept.write_text(json.dumps(figures(*cloud, ground, speed)))
            results.setdefault(name, {})[method] = json.loads(kept.read_text())
            print(name, method, results[name][method], flush=True)
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout.strip()
    model = [line for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")]
    machine = model[0].split(":")[1].strip() if model else platform.machine()
    page = target / "ground.md"
    text = page.read_text().split("<!-- tables -->")[0] if page.exists() else "# Ground filters\n\n"
    head = ["<!-- tables -->", "", f"`scripts/study_ground.py` at commit {commit}, {machine}; synthetic drives of {LENGTH} "
            f"at {int(RATE) // 1000} kHz.", ""]
    page.write_text(text + "\n".join(head + tables(results, methods)).rstrip() + "\n")


if __name__ == "__main__":
    main()
