#!/usr/bin/env python3
"""Scores the classes of segments, and trees as counts, in labelled copies that `chainage run` wrote of labelled scenes.

    scripts/tree_filter.py OUT/SCENE.laz...

Prints one row of a table per file. "tree / not tree" is over segments higher than 2.5 m of which more than 80 % of the
points have one reference class: right, wrong, missed, F1; and F1 over all points of segments. A reference tree (30
points or more) is found if a segment of class tree has an IoU above 0.5 with it. Completeness is the share of reference
trees that are found, correctness the share of tree segments (30 points or more) that found one. Needs numpy and laspy[lazrs].
"""

import pathlib
import sys

import laspy
import numpy as np

TREE = 2


def f1(right, wrong, missed):
    return 2 * right / max(2 * right + wrong + missed, 1)


def row(path):
    las = laspy.read(path)
    segment, reference = np.asarray(las["cluster_id"]), np.asarray(las["gt_instance"])
    found, true = np.asarray(las["object_class"]), np.asarray(las["gt_class"])
    z = np.asarray(las.z)

    of_tree = reference[true == TREE]
    size = np.bincount(reference, minlength=int(reference.max()) + 1)
    trees = [tree for tree in np.unique(of_tree[of_tree > 0]) if size[tree] >= 30]

    inside = segment > 0
    segment, reference, found, true, z = (values[inside] for values in (segment, reference, found, true, z))
    count = int(segment.max()) + 1
    by_class = np.zeros((count, 256), np.int64)
    np.add.at(by_class, (segment, true), 1)
    points = by_class.sum(1)
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, segment, z)
    np.maximum.at(high, segment, z)
    class_of = np.zeros(count, np.int64)
    class_of[segment] = found
    clear = (points > 0) & (by_class.max(1) > 0.8 * points) & (high - low > 2.5)
    is_tree, says_tree = by_class.argmax(1) == TREE, class_of == TREE
    right, wrong, missed = (
        int((clear & one & other).sum())
        for one, other in ((is_tree, says_tree), (~is_tree, says_tree), (is_tree, ~says_tree))
    )
    says, is_one = found == TREE, true == TREE
    of_points = f1((says & is_one).sum(), (says & ~is_one).sum(), (~says & is_one).sum())

    pairs, shared = np.unique(np.stack([segment.astype(np.int64), reference]), axis=1, return_counts=True)
    union = points[pairs[0]] + size[pairs[1]] - shared
    match = (shared > 0.5 * union) & (class_of[pairs[0]] == TREE) & np.isin(pairs[1], trees)
    segments = int((says_tree & (points >= 30)).sum())
    matched = int(match.sum())
    name = pathlib.Path(path).stem
    return (
        f"| {name} | {right} | {wrong} | {missed} | {f1(right, wrong, missed):.3f} | {of_points:.3f} "
        f"| {len(trees)} | {segments} | {matched / max(len(trees), 1):.3f} | {matched / max(segments, 1):.3f} |"
    )


print("| scene | right | wrong | missed | F1 | F1 of points | trees | tree segments | completeness | correctness |")
print("|---|---|---|---|---|---|---|---|---|---|")
for file in sys.argv[1:]:
    print(row(file))
