#!/usr/bin/env python3
"""Processor time of `euclidean` against a chain of public Python packages on the same file.

    scripts/compare_chain.py PROGRAM DRIVE.las [--rounds 3] [--gap 0.5]

The chain reads the file with laspy, filters the ground with CSF (Zhang et al. 2016, the authors' package, with the parameters of
study_ground.py), joins occupied voxels that touch (scipy), drops components of fewer than 50 points, and writes a labelled copy
with laspy. PROGRAM runs `--method euclidean --outputs points` with two threads. Processor time is user and system
time of the whole process: it carries over between machines better than the wall. Prints medians and the ratio.
Needs numpy, scipy, laspy and cloth-simulation-filter.
"""

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time


def chain(source, target, gap):
    """The public chain, in this process."""
    import CSF
    import laspy
    import numpy as np
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    cloud = laspy.read(source)
    points = np.column_stack([cloud.x, cloud.y, cloud.z])
    cloth = CSF.CSF()
    cloth.params.bSloopSmooth = True
    cloth.params.cloth_resolution = 0.5
    cloth.params.rigidness = 2
    cloth.params.class_threshold = 0.3
    cloth.setPointCloud(points - points.min(axis=0))
    ground, rest = CSF.VecInt(), CSF.VecInt()
    cloth.do_filtering(ground, rest, False)
    rest = np.array(rest, dtype=np.int64)
    cells = np.floor((points[rest] - points.min(axis=0)) / gap).astype(np.int64)
    width = cells.max(axis=0) + 3
    keys = ((cells[:, 0] + 1) * width[1] + cells[:, 1] + 1) * width[2] + cells[:, 2] + 1
    occupied, voxel = np.unique(keys, return_inverse=True)
    pairs = []
    for step in [(i, j, k) for i in (0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)]:
        offset = (step[0] * width[1] + step[1]) * width[2] + step[2]
        if offset > 0:
            at = np.searchsorted(occupied, occupied + offset)
            at[at == len(occupied)] = 0
            found = occupied[at] == occupied + offset
            pairs.append((np.flatnonzero(found), at[found]))
    one, other = (np.concatenate(ends) for ends in zip(*pairs))
    size = (len(occupied), len(occupied))
    _, component = connected_components(coo_matrix((np.ones(len(one), bool), (one, other)), shape=size), directed=False)
    label = component[voxel] + 1
    label[np.bincount(label)[label] < 50] = 0
    labels = np.zeros(len(points), np.uint32)
    labels[rest] = label
    cloud.add_extra_dim(laspy.ExtraBytesParams("cluster_id", "u4"))
    cloud.cluster_id = labels
    cloud.write(target)


def processor_seconds(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    wall = time.perf_counter() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("drive")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--gap", type=float, default=0.5, help="edge of a voxel of the chain, in metres")
    parser.add_argument("--chain-to", help=argparse.SUPPRESS)
    choice = parser.parse_args()
    if choice.chain_to:
        return chain(choice.drive, choice.chain_to, choice.gap)
    figures = {"chain": [], "chainage": []}
    for _ in range(choice.rounds):
        with tempfile.TemporaryDirectory(prefix="chain.") as folder:
            copy = os.path.join(folder, "copy.las")
            figures["chain"].append(
                processor_seconds([sys.executable, __file__, "-", choice.drive, "--gap", str(choice.gap), "--chain-to", copy])
            )
            out = os.path.join(folder, "out")
            options = ["--method", "euclidean", "--outputs", "points", "--threads", "2", "--progress", "none"]
            figures["chainage"].append(processor_seconds([choice.program, "run", choice.drive, "-o", out, *options]))
    for name, of in figures.items():
        print(f"{name:9s} processor {statistics.median(p for p, _ in of):7.2f} s, wall {statistics.median(w for _, w in of):7.2f} s")
    ratio = [a[0] / b[0] for a, b in zip(figures["chain"], figures["chainage"])]
    print(f"processor time of the chain / chainage: {statistics.median(ratio):.1f} ({min(ratio):.1f} to {max(ratio):.1f})")


if __name__ == "__main__":
    main()
