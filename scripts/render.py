#!/usr/bin/env python3
"""Draws a labelled point cloud as a PNG, in parallel projection, nearest point per pixel.

    scripts/render.py FILES.laz -o picture.png --by cluster_id [--azimuth 30] [--elevation 35] [--width 1600]

--by takes cluster_id (or any integer dimension: one colour per value, 0 is grey), class (LAS classes),
intensity, or height. --box xmin ymin xmax ymax cuts a window; --ground false leaves ground out; --tiles M draws
every tile of M metres along x with ids of its own, as a tile-by-tile tool would number them (dimension is then
`cluster_id` combined with the tile). Needs numpy, laspy[lazrs] and pillow.
"""

import argparse

import laspy
import numpy as np
from PIL import Image

CLASS_COLOURS = {2: (150, 130, 100), 7: (255, 0, 0), 18: (255, 0, 255)}


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
    return parser.parse_args()


def colours_of(ids):
    """One colour per id by hashing, bright enough to be told apart; 0 is grey."""
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
        elif args.by == "intensity":
            values = np.asarray(las.intensity, float)
            low, high = np.percentile(values, [2, 98])
            grey = (np.clip((values - low) / max(high - low, 1), 0, 1) * 225 + 30).astype(np.uint8)
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
    draw(*load(ARGS), ARGS)
