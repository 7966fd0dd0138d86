#!/usr/bin/env python3
"""Compares `chainage cluster` with scikit-learn (core) and scipy (size) on random clouds and on tables.

usage: compare_dbscan.py PROGRAM [TABLE.txt ...]

Tables have two coordinates and no header. Border points are not compared: scikit-learn gives them to the first
cluster that finds them, chainage to the nearest core point. Exit code 1: something differs.
"""

import csv
import io
import subprocess
import sys

try:
    import numpy as np
    from scipy.sparse.csgraph import connected_components
    from sklearn.cluster import DBSCAN
    from sklearn.neighbors import radius_neighbors_graph
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(0)


def labels(program, points, epsilon, variant, min_points):
    """Cluster of every point, as the program sees them."""
    text = io.StringIO()
    csv.writer(text).writerows([[repr(float(value)) for value in row] for row in points])
    command = [program, "cluster", "-", "--no-header", "-o", "-", "--method", "dbscan", "--epsilon", repr(epsilon)]
    command += ["--variant", variant, "--min-points", str(min_points)]
    done = subprocess.run(command, input=text.getvalue(), capture_output=True, text=True, check=True)
    return np.array([int(line.rsplit(",", 1)[1]) for line in done.stdout.splitlines()])


def partition(names):
    """Each point's cluster, named by its first point."""
    _, first, inverse = np.unique(names, return_index=True, return_inverse=True)
    return first[inverse]


def compare(program, name, points, epsilon, min_points):
    """Both variants on one cloud; whether they agree."""
    reference = DBSCAN(eps=epsilon, min_samples=min_points).fit(points)
    core = np.zeros(len(points), dtype=bool)
    core[reference.core_sample_indices_] = True
    found = labels(program, points, epsilon, "core", min_points)
    same_core = np.array_equal(partition(found[core]), partition(reference.labels_[core])) and (found[core] > 0).all()
    same_noise = np.array_equal(found == 0, reference.labels_ == -1)
    graph = radius_neighbors_graph(points, epsilon, include_self=True)
    components = connected_components(graph, directed=False)[1]
    large = np.bincount(components)[components] >= min_points
    found = labels(program, points, epsilon, "size", min_points)
    same_size = np.array_equal(found > 0, large) and np.array_equal(partition(found[large]), partition(components[large]))
    agree = same_core and same_noise and same_size
    print(f"{'same' if agree else 'DIFFERENT'}  {name}: epsilon {epsilon:g}, {core.sum()} core points of {len(points)}, "
          f"{components.max() + 1} components")
    return agree


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    program, agree = sys.argv[1], True
    random = np.random.default_rng(20)
    for dimensions, epsilon in ((2, 0.05), (2, 0.2), (3, 0.15), (3, 0.4), (6, 0.9), (6, 1.3)):
        centres = random.normal(size=(12, dimensions)) * 2
        points = np.vstack([centres[k % 12] + random.normal(size=dimensions) * 0.4 for k in range(1500)])
        agree &= compare(program, f"random {dimensions}-D", points, epsilon, 2 + dimensions)
    for path in sys.argv[2:]:
        points = np.loadtxt(path)[:, :2]
        for epsilon in (0.3, 0.9, 1.7):
            agree &= compare(program, path.rsplit("/", 1)[-1], points, epsilon, 5)
    sys.exit(0 if agree else 1)


main()
