#!/usr/bin/env python3
"""Draws the objects of a labelled scene of which a run has lost most points: prediction beside reference.

    scripts/worst_objects.py OUT EVAL.json FOLDER [--count 10]

OUT is the folder of a run. `chainage eval OUT --json=EVAL.json` writes EVAL.json. An object's loss is its points times
(1 - best IoU). FOLDER gets sheets of five objects: predicted segments left, reference right, from above and from the side;
colours are segments or objects, light grey is ground, dark grey is no segment. The table of these objects is
printed. Needs numpy, laspy[lazrs] and pillow.
"""

import argparse
import json
import pathlib

import laspy
import numpy as np
from PIL import Image, ImageDraw
from render import colours_of

PANEL = (430, 300)
MARGIN_M = 4.0
GROUND, NOTHING = (222, 218, 210), (90, 90, 90)


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("evaluation", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--count", type=int, default=10)
    return parser.parse_args()


def load(out):
    """Coordinates, predicted and true ids, and whether a point is ground in either."""
    files = sorted([*out.glob("*.las"), *out.glob("*.laz")])
    parts = [laspy.read(name) for name in files]
    xyz = np.concatenate([np.stack([part.x, part.y, part.z], 1) for part in parts])
    predicted = np.concatenate([np.asarray(part.cluster_id) for part in parts]).astype(np.int64)
    true = np.concatenate([np.asarray(part.gt_instance) for part in parts]).astype(np.int64)
    ground = np.concatenate([np.asarray(part.classification) == 2 for part in parts])
    return xyz, predicted, true, ground


def panel(xyz, colours, axes, box, focus):
    """A picture of the points along two axes; the points in `focus` last and larger."""
    image = np.full((PANEL[1], PANEL[0], 3), 255, np.uint8)
    lo, hi = box[0][list(axes)], box[1][list(axes)]
    scale = min((PANEL[0] - 10) / max(hi[0] - lo[0], 0.1), (PANEL[1] - 10) / max(hi[1] - lo[1], 0.1))
    u = (5 + (xyz[:, axes[0]] - lo[0]) * scale).astype(int)
    v = (PANEL[1] - 5 - (xyz[:, axes[1]] - lo[1]) * scale).astype(int)
    other = 3 - sum(axes)
    order = np.argsort(xyz[:, other] if other == 2 else -xyz[:, other], kind="stable")
    for points, size in ((order[~focus[order]], 1), (order[focus[order]], 2)):
        for dx in range(size):
            for dy in range(size):
                inside = (u[points] + dx < PANEL[0]) & (v[points] + dy < PANEL[1]) & (u[points] >= 0) & (v[points] >= 0)
                kept = points[inside]
                image[v[kept] + dy, u[kept] + dx] = colours[kept]
    return Image.fromarray(image)


def strip(scene, entry):
    """The four panels of one object and a line of text."""
    xyz, predicted, true, ground = scene
    of_object = true == entry["object"]
    points = xyz[of_object]
    box = (points.min(0) - MARGIN_M, points.max(0) + MARGIN_M)
    near = np.all((xyz >= box[0]) & (xyz <= box[1]), axis=1)
    here, focus = xyz[near], of_object[near]
    width, depth = (points.max(0) - points.min(0))[:2]
    side = (0, 2) if width >= depth else (1, 2)
    result = Image.new("RGB", (PANEL[0] * 4, PANEL[1] + 22), "white")
    place = 0
    for ids in (predicted[near], true[near]):
        colours = colours_of(ids)
        colours[ids <= 0] = NOTHING
        colours[(ids <= 0) & ground[near]] = GROUND
        for axes in ((0, 1), side):
            result.paste(panel(here, colours, axes, box, focus), (place * PANEL[0], 22))
            place += 1
    text = (f"{entry['class_name']} {entry['object']}: {entry['points']} points, best IoU {entry['best_iou']:.2f}, "
            f"without segment {entry['points_without_segment']}, {entry['what'] or ''}   [prediction x2 | reference x2]")
    ImageDraw.Draw(result).text((6, 5), text, fill="black")
    return result


def main():
    args = parse()
    args.folder.mkdir(parents=True, exist_ok=True)
    objects = json.loads(args.evaluation.read_text())["objects"]
    loss = lambda entry: entry["points"] * (1.0 - (entry["best_iou"] or 0.0))
    worst = sorted((entry for entry in objects if entry["points"] >= 30), key=loss, reverse=True)[: args.count]
    scene = load(args.out)
    print("| object | class | points | best IoU | points lost | USR | OSR | segments of >= 5 % |")
    print("|---|---|---|---|---|---|---|---|")
    strips = []
    for entry in worst:
        ids, counts = np.unique(scene[1][scene[2] == entry["object"]], return_counts=True)
        parts = sorted(((count / entry["points"], id) for id, count in zip(ids, counts) if count >= 0.05 * entry["points"]),
                       reverse=True)
        shares = ", ".join(f"{'none' if id <= 0 else id}: {share:.2f} (of {np.sum(scene[1] == id)})" for share, id in parts)
        print(f"| {entry['object']} | {entry['class_name']} | {entry['points']} | {entry['best_iou']:.2f} | {loss(entry):.0f} "
              f"| {'yes' if entry['under_segmented'] else ''} | {'yes' if entry['over_segmented'] else ''} | {shares} |")
        strips.append(strip(scene, entry))
    for sheet in range(0, len(strips), 5):
        part = strips[sheet:sheet + 5]
        page = Image.new("RGB", (part[0].width, sum(each.height for each in part)), "white")
        for row, each in enumerate(part):
            page.paste(each, (0, row * each.height))
        page.save(args.folder / f"worst-{sheet // 5 + 1}.png")


if __name__ == "__main__":
    main()
