#!/usr/bin/env python3
"""Draws a labelled point cloud as a PNG: in parallel projection, or in perspective from a place of the trajectory.

    scripts/render.py FILES.laz -o picture.png --by cluster_id [--azimuth 30] [--elevation 35] [--width 1600]
    scripts/render.py FILES.laz -o picture.png --by gt_class --trajectory trajectory.csv --at 40 [--up 6] [--tilt 8]

--at is in metres along the trajectory. The view from there is along the trajectory, --up metres above it, --tilt degrees
down. Nearer points are drawn larger, and edges of depth are dark.

--by takes cluster_id (or any integer dimension: one colour per value, 0 is grey), gt_class (classes of `chainage
synth`), class (LAS classes), ground (found brown, missed blue, wrong red, by `gt_class`), intensity, or height. --box xmin
ymin xmax ymax cuts a window. --ground false leaves ground out. --tiles M draws every tile of M metres along x with its own
ids, as a tile-by-tile tool would number them (the dimension is then `cluster_id` combined with the tile). Needs numpy,
laspy[lazrs] and pillow.
"""

import argparse
import csv

import laspy
import numpy as np
from PIL import Image

CLASS_COLOURS = {2: (150, 130, 100), 7: (255, 0, 0), 18: (255, 0, 255)}
# Noise, ground, tree, pole, car, building, fence or hedge, person or small furniture, wire.
SYNTH_COLOURS = [(255, 0, 0), (176, 164, 146), (74, 146, 62), (226, 170, 30), (58, 96, 200), (190, 112, 92),
                 (132, 186, 86), (214, 60, 170), (30, 30, 30)]


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+")
    parser.add_argument("-o", "--out", required=True)
    parser.add_argument("--by", default="cluster_id")
    parser.add_argument("--azimuth", type=float, default=30.0, help="degrees, direction from which one looks")
    parser.add_argument("--elevation", type=float, default=35.0, help="degrees above the horizon; 90 is a map")
    parser.add_argument("--width", type=int, default=1600)
    parser.add_argument("--size", type=int, default=1, help="pixels per point")
    parser.add_argument("--box", type=float, nargs=4, metavar=("XMIN", "YMIN", "XMAX", "YMAX"))
    parser.add_argument("--ground", choices=["true", "false"], default="true")
    parser.add_argument("--trajectory", metavar="CSV", help="draw in perspective, from a place of this trajectory")
    parser.add_argument("--at", type=float, default=20.0, help="metres along the trajectory")
    parser.add_argument("--up", type=float, default=6.0, help="metres above it")
    parser.add_argument("--tilt", type=float, default=8.0, help="degrees below the horizon in the middle")
    parser.add_argument("--turn", type=float, default=0.0, help="degrees to the right of the way")
    parser.add_argument("--view", type=float, default=75.0, help="degrees from the left edge to the right")
    return parser.parse_args()


def colours_of(ids):
    """One colour per id by hashing, bright enough to be distinguished; 0 is grey."""
    mixed = ids.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed ^= mixed >> np.uint64(29)
    mixed *= np.uint64(0xBF58476D1CE4E5B9)
    mixed ^= mixed >> np.uint64(32)
    hue = (mixed & np.uint64(0xFFFF)).astype(float) / 65536.0 * 6.0
    light = 0.75 + 0.25 * ((mixed >> np.uint64(16)) & np.uint64(0xFF)).astype(float) / 255.0
    part = np.abs(((hue[:, None] + np.array([0.0, 4.0, 2.0])) % 6.0) - 3.0) - 1.0
    rgb = (0.25 + 0.75 * np.clip(part, 0, 1)) * light[:, None]
    rgb[ids == 0] = 0.45
    return (rgb * 255).astype(np.uint8)


def ramp(values, low, high):
    share = np.clip((values - low) / max(high - low, 1e-9), 0, 1)
    stops = np.array([[20, 20, 90], [30, 140, 160], [120, 200, 80], [250, 230, 60]], float)
    at = share * (len(stops) - 1)
    k = np.minimum(at.astype(int), len(stops) - 2)
    f = (at - k)[:, None]
    return (stops[k] * (1 - f) + stops[k + 1] * f).astype(np.uint8)


def load(args):
    xyz, rgb = [], []
    for name in args.files:
        las = laspy.read(name)
        points = np.stack([las.x, las.y, las.z], 1)
        keep = np.ones(len(points), bool)
        if args.box:
            x0, y0, x1, y1 = args.box
            keep &= (points[:, 0] >= x0) & (points[:, 0] <= x1) & (points[:, 1] >= y0) & (points[:, 1] <= y1)
        classes = np.asarray(las.classification)
        if args.ground == "false":
            keep &= classes != 2
        if args.by == "class":
            table = np.full((256, 3), 90, np.uint8)
            table[:, 2] = 170
            for code, colour in CLASS_COLOURS.items():
                table[code] = colour
            colours = table[classes]
        elif args.by == "ground":
            found, true = classes == 2, np.asarray(las["gt_class"]) == 1
            colours = np.array([(186, 190, 196), (40, 80, 255), (255, 0, 0), (166, 140, 104)], np.uint8)[2 * found + true]
        elif args.by == "gt_class":
            colours = np.array(SYNTH_COLOURS, np.uint8)[np.asarray(las["gt_class"])]
        elif args.by == "intensity":
            values = np.asarray(las.intensity, float)
            low, high = np.percentile(values, [1, 99])
            # Square root: most of a street is dark asphalt far away.
            grey = (np.sqrt(np.clip((values - low) / max(high - low, 1), 0, 1)) * 225 + 30).astype(np.uint8)
            colours = np.repeat(grey[:, None], 3, 1)
        elif args.by == "height":
            low, high = np.percentile(points[:, 2], [1, 99])
            colours = ramp(points[:, 2], low, high)
        else:
            ids = np.asarray(las[args.by]).astype(np.int64)
            colours = colours_of(ids)
            colours[(classes == 2) & (ids == 0)] = (190, 182, 168)
        xyz.append(points[keep])
        rgb.append(colours[keep])
    return np.concatenate(xyz), np.concatenate(rgb)


def camera(args):
    """Position, and the directions right, up and ahead, of a viewer on the trajectory who looks along it."""
    with open(args.trajectory, newline="") as rows:
        way = np.array([[float(row[axis]) for axis in "xyz"] for row in csv.DictReader(rows)])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way[:, :2], axis=0).T))])
    here, there = (np.array([np.interp(s, along, way[:, k]) for k in range(3)]) for s in (args.at, args.at + 8.0))
    course = np.arctan2(there[1] - here[1], there[0] - here[0]) - np.radians(args.turn)
    tilt = np.radians(args.tilt)
    ahead = np.array([np.cos(course) * np.cos(tilt), np.sin(course) * np.cos(tilt), -np.sin(tilt)])
    right = np.array([np.sin(course), -np.cos(course), 0.0])
    return here + [0.0, 0.0, args.up], right, np.cross(right, ahead), ahead


def draw_perspective(xyz, rgb, args):
    at, right, up, ahead = camera(args)
    width, height = args.width, args.width * 9 // 16
    focus = width / 2 / np.tan(np.radians(args.view) / 2)
    depth = (xyz - at) @ ahead
    seen = (depth > 2.0) & (depth < 400.0)
    centred, rgb, depth = xyz[seen] - at, rgb[seen], depth[seen]
    column = (width / 2 + focus * (centred @ right) / depth).astype(int)
    row = (height / 2 - focus * (centred @ up) / depth).astype(int)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    column, row, rgb, depth = column[inside], row[inside], rgb[inside], depth[inside]
    # A point is some 4 cm wide. Farther points are drawn first, each with as many pixels as it covers.
    size = np.clip(0.04 * focus / depth, 1, 6).astype(int)
    order = np.argsort(-depth, kind="stable")
    image = np.full((height, width, 3), 255, np.uint8)
    far = np.full((height, width), np.inf)
    for pixels in range(1, 7):
        of_size = order[size[order] == pixels]
        for dx in range(pixels):
            for dy in range(pixels):
                y = np.clip(row[of_size] + dy - pixels // 2, 0, height - 1)
                x = np.clip(column[of_size] + dx - pixels // 2, 0, width - 1)
                nearer = depth[of_size] <= far[y, x]
                y, x, points = y[nearer], x[nearer], of_size[nearer]
                # The last assignment to a pixel is that of the nearest point.
                image[y, x], far[y, x] = rgb[points], depth[points]
    shaded = image * edges(far)[:, :, None]
    Image.fromarray(shaded.astype(np.uint8)).quantize(160).save(args.out, optimize=True)
    print(f"{args.out}: {width} x {height}, {len(xyz)} points")


def edges(far):
    """Eye-dome lighting: share of its light that a pixel keeps if its neighbours are nearer."""
    filled = np.where(np.isinf(far), 500.0, far)
    log = np.log2(filled)
    drop = np.zeros_like(log)
    for dy, dx in [(0, 2), (0, -2), (2, 0), (-2, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]:
        drop += np.maximum(0.0, log - np.roll(log, (dy, dx), (0, 1)))
    return np.where(np.isinf(far), 1.0, np.clip(np.exp(-2.5 * drop / 8 * 3), 0.25, 1.0))


def draw(xyz, rgb, args):
    a, e = np.radians(args.azimuth), np.radians(args.elevation)
    centred = xyz - xyz.mean(0)
    right = np.array([np.cos(a), np.sin(a), 0.0])
    ahead = np.array([-np.sin(a), np.cos(a), 0.0])
    up = ahead * np.sin(e) + np.array([0, 0, np.cos(e)])
    back = -ahead * np.cos(e) + np.array([0, 0, np.sin(e)])
    u, v, depth = centred @ right, centred @ up, centred @ back
    u0, u1 = np.percentile(u, [0.02, 99.98])
    v0, v1 = np.percentile(v, [0.02, 99.98])
    scale = (args.width - 40) / (u1 - u0)
    height = int((v1 - v0) * scale) + 40
    order = np.argsort(depth, kind="stable")
    image = np.full((height, args.width, 3), 255, np.uint8)
    column = ((u - u0) * scale).astype(int)[order] + 20
    row = height - 20 - ((v - v0) * scale).astype(int)[order]
    shade = rgb[order]
    for dx in range(args.size):
        for dy in range(args.size):
            inside = (column + dx >= 0) & (column + dx < args.width) & (row + dy >= 0) & (row + dy < height)
            image[row[inside] + dy, column[inside] + dx] = shade[inside]
    Image.fromarray(image).quantize(160).save(args.out, optimize=True)
    print(f"{args.out}: {args.width} x {height}, {len(xyz)} points")


if __name__ == "__main__":
    ARGS = parse()
    (draw_perspective if ARGS.trajectory else draw)(*load(ARGS), ARGS)
