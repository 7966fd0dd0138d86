#!/usr/bin/env python3
"""Compares ground filters on labelled scenes, synthetic drives and real scans, as tables for benches/results.

    scripts/study_ground.py PROGRAM RESULTS FOLDER [DATA [METHOD ...]]

DATA is the folder with sim, real-labelled and real (default ../shared/data); what is not there is left out. FOLDER takes
synthetic drives and one file of figures for each scene and method; what is there is not done again. So delete the files
of a filter after it has changed. RESULTS takes ground.md: its tables are made anew, the text before the line
"<!-- tables -->" stays. With METHODs of PROGRAM, such as opening, it prints their precision and recall, and writes no page
and no figures. Needs numpy, scipy and laspy[lazrs]; CSF and pysmrf where cloth-simulation-filter and pysmrf are installed.

Beside the filters of PROGRAM: CSF (Zhang et al. 2016, the authors' package) and SMRF (Pingel et al. 2013) with the defaults
of PDAL's filters.smrf; they get the points that the program does not call noise. SMRF is there twice: as written in this file, and of the package pysmrf. PDAL itself is in no registry of Debian
and has no wheel.

Beside the presets of `chainage synth` as they are, drives on steep land are made from them: a height that depends on the
place alone is added to every point, so that what stood upright still does. And a drive gets single returns below its road.
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

from land import changed

# Length and pulse rate of each drive. Mixed changes its street every 350 m, loop returns after 300 m of at least 1100 m.
DRIVES = {
    "suburb": ["300m", "60kHz"],
    "downtown": ["300m", "60kHz"],
    "avenue": ["300m", "60kHz"],
    "highway": ["300m", "60kHz"],
    "parkway": ["300m", "60kHz"],
    "mixed": ["1400m", "30kHz"],
    "loop": ["1100m", "30kHz"],
}
SEED = "1"
# No filter was chosen on these.
OTHER_SEED = "2"
OTHERS = ("suburb", "downtown", "avenue", "highway")
# Drives on other land, and one with returns below its road.
CHANGES = [("avenue", "grade 15 %"), ("suburb", "hillside 30 %"), ("suburb", "embankment"), ("highway", "cutting"),
           ("downtown", "strays")]
SPINNING = ["--scanner", "spinning-64", "--sweeps", "20"]
# Preset and seed of drives of 150 m that see much below the road.
SPINNING_DRIVES = [("downtown", "972"), ("downtown", "913"), ("suburb", "903")]
# Preset, seed and scanner of single sweeps, as in score_street.py.
SWEEPS = [("suburb", "1061", "spinning-64"), ("downtown", "1062", "spinning-64-wide"), ("parkway", "1064", "spinning-64"),
          ("lane", "1065", "spinning-64"), ("suburb", "1067", "spinning-32"), ("suburb", "1072", "spinning-16")]
PROGRAM_METHODS = {
    "voxel-column, 1": ["--ground", "voxel-column", "--set", "voxel-column.lowest_points=1"],
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
    """Classes after `chainage run`, and points per second of its ground pass (decoding and noise included)."""
    out = folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    command = [executable, "run", source, "-o", out, "--progress", "none", "--threads", "1", "--method", "euclidean",
               "--outputs", "points", *arguments]
    subprocess.run(command, check=True, capture_output=True)
    report = json.loads((out / "report.json").read_text())
    seconds = next(entry["seconds"] for entry in report["result"]["passes"] if entry["pass"] == "ground")
    names = [file.name for file in sorted(source.glob("*.la[sz]"))] if source.is_dir() else [source.name]
    classes = np.concatenate([np.asarray(laspy.read(out / name).classification) for name in names])
    shutil.rmtree(out)
    return classes, len(classes) / seconds


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
    shape = tuple(at.max(0) + 1)
    lows = np.full(shape, np.inf)
    np.minimum.at(lows, (at[:, 0], at[:, 1]), xyz[:, 2])
    lows[np.isinf(lows)] = np.nan
    surface = filled(lows)

    cross = ndimage.generate_binary_structure(2, 1)

    def opened(grid, radius):
        """By a diamond, step by step, as PDAL does."""
        for step in [ndimage.grey_erosion] * radius + [ndimage.grey_dilation] * radius:
            grid = step(grid, footprint=cross)
        return grid

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


def pysmrf(xyz):
    """The package pysmrf, with the settings of `smrf` above."""
    import pysmrf as package  # not everybody has it

    start = time.perf_counter()
    x, y, z = (np.ascontiguousarray(column) for column in (xyz - xyz.min(0)).T)
    found = package.classify(x, y, z, cellsize=1.0, windows=18, slope_threshold=0.15, elevation_threshold=0.5,
                             elevation_scaler=1.25)
    return np.asarray(found.is_ground, bool), len(xyz) / (time.perf_counter() - start)


YARDSTICKS = {"SMRF": smrf, "pysmrf": pysmrf, "CSF": csf}
# Codes of low and high noise.
NOISE = (7, 18)
ROW = 100_000_000


def cells(xyz):
    """Number of the cell of 1 m of each point; neighbours differ by 1 and by ROW."""
    return np.floor(xyz[:, :2]).astype(np.int64) @ np.array([ROW, 1])


def raster(xyz, chosen):
    """Cells of the chosen points, with their median height, and how much of it 90 % of the points span."""
    key, z = cells(xyz[chosen]), xyz[chosen][:, 2]
    order = np.lexsort((z, key))
    keys, first, count = np.unique(key[order], return_index=True, return_counts=True)
    at = [z[order][first + (count * share).astype(int)] for share in (0.5, 0.05, 0.95)]
    return keys, at[0], at[2] - at[1]


def relief(keys, z, span):
    """Cells of the true ground that are steep, hold a kerb or another step, or lie at an edge of 1 m and more."""
    rises = []
    for step in (ROW, -ROW, 1, -1):
        at = np.searchsorted(keys, keys + step).clip(max=len(keys) - 1)
        rises.append(np.where(keys[at] == keys + step, np.abs(z[at] - z), np.nan))
    # Along each axis the side that rises less: a kerb is on the other one.
    slope = [np.nan_to_num(np.fmin(rises[0], rises[1])), np.nan_to_num(np.fmin(rises[2], rises[3]))]
    is_edge = (np.nan_to_num(rises).max(0) >= 1.0) | (span >= 1.0)
    return {
        "steep": (np.hypot(*slope) > 0.2) & ~is_edge,
        "kerb": (span - slope[0] - slope[1] > 0.06) & (np.hypot(*slope) < 0.2) & ~is_edge,
        "edge": is_edge,
    }


def figures(xyz, truth, scored, ground, speed):
    """One line of each table."""
    key = cells(xyz)
    keys, inverse = np.unique(key, return_inverse=True)
    low = np.full(len(keys), np.inf)
    np.minimum.at(low, inverse, xyz[:, 2])
    near = xyz[:, 2] < low[inverse] + 0.3
    result = {"ground": float(ground.mean()), "low": float(ground[near].mean()), "speed": speed}
    if not truth.any():
        return result

    def scores(chosen):
        right = float((ground & truth & chosen).sum())
        return [right / max(1.0, float((ground & chosen).sum())), right / max(1.0, float((truth & chosen).sum()))]

    result["precision"], result["recall"] = scores(scored)
    true_keys, true_z, span = raster(xyz, truth & scored)
    for name, some in relief(true_keys, true_z, span).items():
        if some.sum() >= 50:
            result[name] = [*scores(scored & np.isin(key, true_keys[some])), int(some.sum())]
    if ground.any():
        keys, z, _ = raster(xyz, ground)
        _, one, other = np.intersect1d(true_keys, keys, return_indices=True)
        error = np.abs(true_z[one] - z[other])
        result["cells"] = len(one) / len(true_keys)
        result["mean_error"], result["large"] = float(error.mean()), float((error > 0.2).mean())
    return result


def scenes(executable, folder, data):
    """Name and file or folder of every scene; synthetic drives are made where they are missing."""
    found = {}
    for part in ("sim", "real-labelled"):
        for file in sorted((data / part).glob("*.laz")):
            found[f"{file.stem}" + (" (by hand)" if part == "real-labelled" else "")] = file

    def drive(name, preset, *options, seed=SEED):
        target = folder / name.replace(" ", "-")
        if not target.exists():
            command = [executable, "synth", preset, "-o", target, "--las", "--seed", seed, *options]
            subprocess.run(command, check=True, capture_output=True)
        found[name] = target

    for preset, (length, rate) in DRIVES.items():
        drive(f"synth {preset}", preset, "--length", length, "--pulse-rate", rate)
    for preset in OTHERS:
        length, rate = DRIVES[preset]
        drive(f"synth {preset}, seed {OTHER_SEED}", preset, "--length", length, "--pulse-rate", rate, seed=OTHER_SEED)
    drive("synth downtown, spinning", "downtown", *SPINNING)
    for preset, seed in SPINNING_DRIVES:
        options = ["--scanner", "spinning-64", "--length", "150m"]
        drive(f"synth {preset}, spinning drive {seed}", preset, *options, seed=seed)
    for preset, seed, scanner in SWEEPS:
        drive(f"synth {preset}, one sweep of {scanner}", preset, "--scanner", scanner, "--sweeps", "1", seed=seed)
    for preset, change in CHANGES:
        name = f"synth {preset}, {change}"
        target = folder / name.replace(" ", "-")
        if not target.exists():
            changed(found[f"synth {preset}"], target, change)
        found[name] = target
    for file in sorted((data / "real").glob("*.la[sz]")):
        if not (data / "real-labelled" / file.name).exists():
            found[f"{file.stem} (real)"] = file
    return found


def show(value, digits=4):
    return "-" if value is None else f"{value:.{digits}f}"


def table(title, results, methods, value):
    """A line for each scene of which a value is known; values are texts or nothing."""
    lines = [f"## {title}", "", "| scene | " + " | ".join(methods) + " |", "|---" * (len(methods) + 1) + "|"]
    for scene, by_method in results.items():
        values = [value(by_method[method]) if method in by_method else None for method in methods]
        if any(values):
            lines.append(f"| {scene} | " + " | ".join(text or "-" for text in values) + " |")
    return [*lines, ""]


def tables(results, methods):
    """All tables."""
    lines = []

    def pair(name):
        return lambda one: f"{one[name][0]:.4f} / {one[name][1]:.4f}" if name in one else None

    for by_method in results.values():
        for one in by_method.values():
            if "precision" in one:
                one["all"] = [one["precision"], one["recall"]]
    for title, name in (("Precision / recall", "all"),
                        ("Precision / recall in cells of 1 m that hold a kerb or another step", "kerb"),
                        ("Precision / recall in cells that are steeper than 20 %", "steep"),
                        ("Precision / recall at edges of 1 m and more: bridges, walls that hold the land", "edge")):
        lines += table(title, results, methods, pair(name))
    for title, key, digits, scale in (
        ("Mean error of the ground raster (m)", "mean_error", 3, 1),
        ("Share of raster cells that are wrong by more than 0.2 m", "large", 4, 1),
        ("Share of true ground cells that have ground", "cells", 4, 1),
        ("Share of the points that is ground", "ground", 4, 1),
        ("Ground among points in the lowest 0.3 m of cells of 1 m", "low", 4, 1),
        ("Million points per second, one thread", "speed", 2, 1e-6),
    ):
        lines += table(title, results, methods,
                       lambda one, key=key, digits=digits, scale=scale: show(one[key] * scale, digits) if key in one else None)
    return lines


def compare(executable, folder, data, methods):
    """Prints precision and recall of these methods of the program."""
    for name, source in scenes(executable, folder, data).items():
        cloud = read(source)
        for method in methods:
            classes, speed = program(executable, source, folder, PROGRAM_METHODS[method])
            found = figures(*cloud, classes == 2, speed)
            print(f"{name} | {method} | {show(found.get('precision'))} / {show(found.get('recall'))}", flush=True)


def main():
    executable, target, folder = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    data = pathlib.Path(sys.argv[4] if len(sys.argv) > 4 else "../shared/data")
    folder.mkdir(parents=True, exist_ok=True)
    if sys.argv[5:]:
        compare(executable, folder, data, sys.argv[5:])
        return
    results, methods, missing = {}, [*PROGRAM_METHODS, *YARDSTICKS], set()
    for name, source in scenes(executable, folder, data).items():
        cloud, clean = None, None
        for method in methods:
            kept = folder / f"{name}-{method}.json"
            if not kept.exists() and method not in missing:
                cloud = cloud or read(source)
                try:
                    if method in PROGRAM_METHODS:
                        classes, speed = program(executable, source, folder, PROGRAM_METHODS[method])
                        ground = classes == 2
                    else:
                        if clean is None:
                            clean = ~np.isin(program(executable, source, folder, ["--ground", "none"])[0], NOISE)
                        ground = np.zeros(len(clean), bool)
                        ground[clean], speed = YARDSTICKS[method](cloud[0][clean])
                except ImportError as absent:
                    print(f"{method} is left out: {absent}", file=sys.stderr)
                    missing.add(method)
                    continue
                kept.write_text(json.dumps(figures(*cloud, ground, speed)))
                print(name, method, kept.read_text(), flush=True)
            if kept.exists():
                results.setdefault(name, {})[method] = json.loads(kept.read_text())
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout.strip()
    model = [line for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")]
    machine = model[0].split(":")[1].strip() if model else platform.machine()
    page = target / "ground.md"
    text = page.read_text().split("<!-- tables -->")[0] if page.exists() else "# Ground filters\n\n"
    lengths = ", ".join(f"{preset} {length} at {rate}" for preset, (length, rate) in DRIVES.items())
    head = ["<!-- tables -->", "", f"`scripts/study_ground.py` at commit {commit}, {machine}. Synthetic drives, seed {SEED}: "
            f"{lengths}.", ""]
    page.write_text(text + "\n".join(head + tables(results, methods)).rstrip() + "\n")


if __name__ == "__main__":
    main()
