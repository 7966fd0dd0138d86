"""Copies of synthetic drives on other land, in a tunnel, or with returns below the road, for the studies.

A height that depends on the place alone is added to every point, so that what stood upright still does.
"""

import laspy
import numpy as np
from scipy.spatial import cKDTree

# A tunnel: half of its width in metres, the height up to which its walls are upright, and its points per square metre.
TUNNEL = 6.0, 3.0, 400


def lay(name, xy, way):
    """Height that a change of the land adds, from places and the trajectory (x and y of both)."""
    along = way[-1] - way[0]
    along = along / np.hypot(*along)
    centred = xy - way.mean(0)
    if name == "grade 15 %":
        return 0.15 * centred @ along
    if name == "hillside 30 %":
        return 0.30 * centred @ np.array([-along[1], along[0]])
    # From 12 m beside the way of the scanner the land falls or rises by 1 : 1.5, over 5 m of height.
    distance = cKDTree(way).query(xy)[0]
    side = np.clip((distance - 12.0) / 1.5, 0.0, 5.0)
    return {"embankment": -side, "cutting": side}[name]


def tunnel(las, xy, way):
    """The points with a vault over the middle third of the way, which hides what is outside of it."""
    half, upright, density = TUNNEL
    start, end = len(way) // 3, 2 * len(way) // 3
    distance, nearest = cKDTree(way).query(xy)
    inside = (nearest >= start) & (nearest < end)
    ground = np.asarray(las["gt_class"]) == 1
    road = np.median(np.asarray(las.z)[inside & ground & (distance < half)])
    kept = ~inside | (distance < half) & (np.asarray(las.z) < road + upright + half)
    # Places on the vault: along the way, and around it from one foot to the other.
    random = np.random.default_rng(1)
    steps = np.diff(way[start:end], axis=0)
    lengths = np.hypot(*steps.T)
    around = 2 * upright + np.pi * half
    count = int(density * around * lengths.sum())
    step = random.choice(len(steps), count, p=lengths / lengths.sum())
    along = way[start + step] + steps[step] * random.random((count, 1))
    left = np.stack([-steps[:, 1], steps[:, 0]], 1)[step] / lengths[step, None]
    at = random.random(count) * around
    angle = np.clip((at - upright) / half, 0.0, np.pi)
    aside = half * np.cos(angle)
    up = np.where(at < upright, at, np.where(at > around - upright, around - at, upright + half * np.sin(angle)))
    vault = las.points.array[random.choice(len(xy), count)].copy()
    scales, offsets = las.header.scales, las.header.offsets
    places = np.column_stack([along + left * aside[:, None], road + up]) + random.normal(0.0, 0.005, (count, 3))
    for axis, name in enumerate("XYZ"):
        vault[name] = np.round((places[:, axis] - offsets[axis]) / scales[axis])
    vault["gt_class"] = 5
    vault["gt_instance"] = 1_000_000
    every = np.concatenate([las.points.array[kept], vault])
    return laspy.ScaleAwarePointRecord(every, las.point_format, scales, offsets)


def changed(source, target, change):
    """A copy of a synthetic drive on other land, or with strays below its road."""
    target.mkdir()
    way = np.loadtxt(source / "trajectory.csv", delimiter=",", skiprows=1, usecols=(1, 2))[::20]
    for file in source.glob("*.las"):
        las = laspy.read(file)
        xy = np.stack([las.x, las.y], 1)
        if change == "strays":
            # One of 400 points of the ground gets a return 0.4 to 0.6 m below it, which is noise.
            random = np.random.default_rng(1)
            ground = np.flatnonzero(np.asarray(las["gt_class"]) == 1)
            chosen = random.choice(ground, len(ground) // 400, replace=False)
            points = las.points.array
            strays = points[chosen].copy()
            strays["Z"] -= (random.uniform(0.4, 0.6, len(chosen)) / las.header.scales[2]).astype(strays["Z"].dtype)
            strays["gt_class"] = 0
            las.points = laspy.ScaleAwarePointRecord(np.concatenate([points, strays]), las.point_format,
                                                     las.header.scales, las.header.offsets)
        elif change == "tunnel":
            las.points = tunnel(las, xy, way)
        else:
            las.z = np.asarray(las.z) + lay(change, xy, way)
        las.write(target / file.name)


