#!/usr/bin/env python3
"""How well trees are divided if their stems are known and only the distance in the plane decides.

Every point of a tree goes to the stem with the least distance divided by a size. The sizes: 1; the square root of
the height above the stem; the diameter of the trunk to the power of 2/3 (Tao et al. 2015); and the true radius of
the crown, which no method knows. Printed per scene: the share of the trees of 50 points and more with IoU above
0.5, and the share of the points with the right tree. `benches/results/street.md`, "Borders of crowns".

usage: study_crown_borders.py FILE_OR_FOLDER...   (LAS or LAZ with gt_class and gt_instance; needs laspy, scipy)
"""

import sys
from pathlib import Path

import laspy
import numpy as np
from scipy.spatial import cKDTree

TREE = 2
SAMPLE = 400_000


def trees(path):
    """Coordinates and numbers of the points of trees of one scene."""
    files = sorted(path.glob("*.la[sz]")) if path.is_dir() else [path]
    points, numbers = [], []
    for file in files:
        las = laspy.read(file)
        chosen = np.asarray(las["gt_class"]) == TREE
        points.append(np.c_[las.x, las.y, las.z][chosen])
        numbers.append(np.asarray(las["gt_instance"]).astype(np.int64)[chosen])
    return np.concatenate(points), np.concatenate(numbers)


def measures(points):
    """Stem, height above it, diameter of the trunk and radius of the crown of one tree."""
    height = points[:, 2] - np.quantile(points[:, 2], 0.002)
    low = points[height < 1.0]
    stem = np.median((low if len(low) >= 5 else points)[:, :2], axis=0)
    distance = np.hypot(*(points[:, :2] - stem).T)
    breast = points[(height > 1.0) & (height < 1.6)][:, :2]
    spread = np.hypot(*(breast - np.median(breast, axis=0)).T) if len(breast) > 10 else np.array([0.15])
    above = height[distance < 1.0]
    return (*stem, above.max() if len(above) else height.max(), np.clip(2 * np.quantile(spread, 0.8), 0.05, 1.5),
            np.quantile(distance, 0.9))


def study(path):
    points, numbers = trees(path)
    _, tree, count = np.unique(numbers, return_inverse=True, return_counts=True)
    order = np.split(np.argsort(tree, kind="stable"), np.cumsum(count)[:-1])
    x, y, height, trunk, crown = np.array([measures(points[places]) for places in order]).T
    large = count >= 50
    step = max(1, len(points) // SAMPLE)
    places, truth = points[::step, :2], tree[::step]
    distance, near = cKDTree(np.c_[x, y]).query(places, k=min(12, len(x)))
    cells = []
    for size in (np.ones(len(x)), np.sqrt(height), trunk ** (2 / 3), crown):
        found = near[np.arange(len(places)), (distance / size[near]).argmin(axis=1)]
        both = np.bincount(found[found == truth], minlength=len(x))
        union = np.bincount(found, minlength=len(x)) + np.bincount(truth, minlength=len(x)) - both
        iou = both / np.maximum(union, 1)
        cells.append(f"{(iou[large] > 0.5).mean():.3f} ({(found == truth).mean():.3f})")
    print(f"| {path.stem} | {large.sum()} | {' | '.join(cells)} |")


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] in ("-h", "--help"):
        sys.exit(__doc__)
    print("| scene | trees | distance | by root of height | by trunk | by crown (true) |\n|---|---|---|---|---|---|")
    for name in sys.argv[1:]:
        study(Path(name))
