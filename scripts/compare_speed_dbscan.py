#!/usr/bin/env python3
"""Times `dbscan` and the curve of its epsilon against scikit-learn, scipy and Open3D on the same points.

usage: compare_speed_dbscan.py PROGRAM SCENE.laz FOLDER [--install]

The points are those of the scene that the program takes for neither ground nor noise. Epsilon is 0.3 m. For the program
the passes `cluster` and `epsilon` are timed: they read their points from the drive and store their results. For the others
one call is timed, with all points in memory. Medians of three rounds. Libraries that are not installed are skipped with a
line. --install first tries to install Open3D into FOLDER/packages with pip. FOLDER takes state and packages.
"""

import json
import pathlib
import statistics
import subprocess
import sys
import time

try:
    import laspy
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(0)

ROUNDS = 3
EPSILON = 0.3
MIN_POINTS = {"size": 50, "core": 10}
K = 40


def passes(command):
    """Seconds of every pass of a call of the program."""
    done = subprocess.run([*command, "--progress", "json"], check=True, capture_output=True, text=True)
    events = [json.loads(line) for line in done.stderr.splitlines()]
    return {event["pass"]: event["seconds"] for event in events if event["event"] == "pass-finished"}


def report(what, points, seconds):
    """One line: median, spread, rate."""
    middle = statistics.median(seconds)
    print(f"| {what} | {middle:.2f} | {min(seconds):.2f} to {max(seconds):.2f} | {points / middle / 1e6:.3f} |", flush=True)


def timed(call):
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def rounds(call):
    return [call() for _ in range(ROUNDS)]


def ours(program, scene, folder):
    """Times the program; returns the points that are neither ground nor noise."""
    out = folder / "run"
    base = [program, "run", scene, "-o", out, "--method", "dbscan", "--set", f"dbscan.epsilon={EPSILON}", "--output-format", "las"]
    subprocess.run([*base, "--progress", "none", "--fresh"], check=True, capture_output=True)
    labelled = laspy.read(next(out.glob("*.las")))
    points = labelled.xyz[~np.isin(np.asarray(labelled.classification), (2, 7, 18))]
    print(f"\n{len(points)} points of {scene.name}, epsilon {EPSILON} m\n")
    print("| what | median s | from to s | M points/s |\n|---|---:|---:|---:|")
    for threads in (1, 2):
        for variant, least in MIN_POINTS.items():
            more = ["--fresh", "--threads", str(threads), "--set", f"dbscan.variant={variant}", "--set", f"dbscan.min_points={least}"]
            seconds = rounds(lambda: passes([*base, *more])["cluster"])
            report(f"chainage {variant}, {threads} threads", len(points), seconds)
        curve = [program, "estimate-epsilon", scene, "--max-queries", "0", "--scratch", folder, "--threads", str(threads)]
        report(f"chainage curve K = {K}, {threads} threads", len(points), rounds(lambda: passes(curve)["epsilon"]))
    return points


def scikit(points):
    try:
        from sklearn.cluster import DBSCAN
    except ImportError as missing:
        print(f"skipped: {missing}")
        return
    for jobs in (1, 2):
        method = DBSCAN(eps=EPSILON, min_samples=MIN_POINTS["core"], n_jobs=jobs)
        report(f"scikit-learn DBSCAN, {jobs} jobs", len(points), rounds(lambda: timed(lambda: method.fit(points))))


def scipy(points):
    try:
        from scipy.spatial import cKDTree
    except ImportError as missing:
        print(f"skipped: {missing}")
        return
    for workers in (1, 2):
        call = lambda: cKDTree(points).query(points, k=K, workers=workers)
        report(f"scipy kd-tree, K = {K}, {workers} workers", len(points), rounds(lambda: timed(call)))


def open3d(points, folder, install):
    packages = folder / "packages"
    if install:
        command = [sys.executable, "-m", "pip", "install", "--quiet", "--target", packages, "open3d"]
        if subprocess.run(command, check=False).returncode != 0:
            print("Open3D could not be installed")
    sys.path.insert(0, str(packages))
    try:
        import open3d as o3d
    except (ImportError, OSError) as missing:
        print(f"skipped: {missing}")
        return
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points - points.min(axis=0)))
    call = lambda: cloud.cluster_dbscan(EPSILON, MIN_POINTS["core"])
    report(f"Open3D {o3d.__version__} cluster_dbscan, all cores", len(points), rounds(lambda: timed(call)))


def main():
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    program, scene, folder = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    folder.mkdir(parents=True, exist_ok=True)
    points = ours(program, scene, folder)
    scikit(points)
    scipy(points)
    open3d(points, folder, "--install" in sys.argv[4:])


main()
