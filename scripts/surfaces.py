#!/usr/bin/env python3
"""Makes scenes of known planes, and scores the surfaces that `chainage run --method p-linkage` finds in them.

    scripts/surfaces.py make room|facade|stairs FILE.laz [--noise 0.01] [--density 2000] [--seed 1]
    scripts/surfaces.py score FILE.laz OUT
    scripts/surfaces.py draw OUT/FILE.laz PICTURE.png [--view ELEVATION AZIMUTH]
    scripts/surfaces.py kerb PICTURE.png OUT/FACADE.laz...

`score` says for every plane how many surfaces hold it, and angle and offset of the largest one; then the numbers of
Hoover et al. 1996 at T = 0.8: correct, over-segmented, under-segmented, missed, noise. It needs numpy and laspy[lazrs];
`draw` and `kerb` need matplotlib; `kerb` draws the points of the true kerb of a facade from the road, one band per run.
"""

import argparse
import csv
import json
import pathlib
import sys

import numpy as np

CORNER = np.array([5000.0, 7000.0, 100.0])


def rectangle(rng, density, origin, u, v):
    """Points on a rectangle with sides u and v, evenly at random."""
    origin, u, v = (np.asarray(a, float) for a in (origin, u, v))
    area = np.linalg.norm(np.cross(u, v))
    count = int(round(area * density))
    s, t = rng.random((2, count, 1))
    return origin + s * u + t * v


def room():
    """A room of 6 m by 4.5 m: floor, walls with a niche and a pillar, a slanted ceiling, a table, a cupboard."""
    planes = [
        [((0, 0, 0), (6, 0, 0), (0, 4.5, 0))],  # floor
        [((0, 0, 0), (0, 4.5, 0), (0, 0, 2.5))],  # wall in the west
        [((0, 0, 0), (6, 0, 0), (0, 0, 2.5))],  # wall in the south
        [((6, 0, 0), (0, 4.5, 0), (0, 0, 2.5))],  # wall in the east
        # Wall in the north around a niche of 1.2 m by 2 m that is 0.25 m deep.
        [
            ((0, 4.5, 0), (2, 0, 0), (0, 0, 2.5)),
            ((3.2, 4.5, 0), (2.8, 0, 0), (0, 0, 2.5)),
            ((2, 4.5, 2), (1.2, 0, 0), (0, 0, 0.5)),
        ],
        [((2, 4.75, 0), (1.2, 0, 0), (0, 0, 2))],
        # Ceiling of two halves that rise by 20 degrees to the middle.
        [((0, 0, 2.5), (6, 0, 0), (0, 2.25, 2.25 * np.tan(np.radians(20))))],
        [((0, 4.5, 2.5), (6, 0, 0), (0, -2.25, 2.25 * np.tan(np.radians(20))))],
        [((3.6, 1.2, 0.75), (1.6, 0, 0), (0, 0.8, 0))],  # table
        [((0.8, 2.2, 0), (0.6, 0, 0), (0, 0, 2))],  # cupboard: front, side, top is small
        [((1.4, 2.2, 0), (0, 0.6, 0), (0, 0, 2))],
        [((0.8, 2.8, 0), (0.6, 0, 0), (0, 0, 2))],
        [((0.8, 2.2, 0), (0, 0.6, 0), (0, 0, 2))],
    ]
    return planes


def facade():
    """A facade of 24 m by 9 m with windows 0.2 m behind it, a sloping roof, a pavement, a kerb of 0.12 m and a road."""
    planes = [
        [((0, -6, 0), (24, 0, 0.24), (0, 4, 0.1))],  # road
        [((0, -2, 0.1), (24, 0, 0.24), (0, 0, 0.12))],  # kerb
        [((0, -2, 0.22), (24, 0, 0.24), (0, 2, 0.04))],  # pavement
        [((0, 0, 9), (24, 0, 0), (0, 3, 3))],  # roof
    ]
    wall = []
    for floor in range(3):
        z = 3.0 * floor
        wall.append(((0, 0, z), (24, 0, 0), (0, 0, 0.9)))
        wall.append(((0, 0, z + 2.5), (24, 0, 0), (0, 0, 0.5)))
        for window in range(8):
            x = 3.0 * window
            wall.append(((x, 0, z + 0.9), (0.9, 0, 0), (0, 0, 1.6)))
            wall.append(((x + 2.1, 0, z + 0.9), (0.9, 0, 0), (0, 0, 1.6)))
            planes.append([((x + 0.9, 0.2, z + 0.9), (1.2, 0, 0), (0, 0, 1.6))])
    planes.append(wall)
    return planes


def stairs():
    """Level treads of 1 m by 8 m with risers of 0.12, 0.16, 0.2, 0.3, 0.4 and 0.6 m between them: how narrow may a plane be."""
    planes, z = [], 0.0
    for step, height in enumerate([0.12, 0.16, 0.2, 0.3, 0.4, 0.6]):
        planes.append([((0, step, z), (8, 0, 0), (0, 1, 0))])
        planes.append([((0, step + 1, z), (8, 0, 0), (0, 0, height))])
        z += height
    planes.append([((0, 6, z), (8, 0, 0), (0, 1, 0))])
    return planes


SCENES = {"room": room, "facade": facade, "stairs": stairs}


def normal_of(parts):
    _, u, v = parts[0]
    normal = np.cross(u, v)
    return normal / np.linalg.norm(normal)


def make(arguments):
    import laspy

    rng = np.random.default_rng(arguments.seed)
    xyz, ids = [], []
    for number, parts in enumerate(SCENES[arguments.scene](), 1):
        points = np.concatenate([rectangle(rng, arguments.density, *part) for part in parts])
        xyz.append(points)
        ids.append(np.full(len(points), number))
    xyz, ids = np.concatenate(xyz), np.concatenate(ids)
    order = rng.permutation(len(xyz))
    xyz = xyz[order] + rng.normal(0.0, arguments.noise, xyz.shape) + CORNER
    ids = ids[order]
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = [0.001] * 3, [0.0] * 3
    header.add_extra_dim(laspy.ExtraBytesParams("gt_instance", "uint32"))
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.gt_instance = ids
    las.gps_time = np.arange(len(xyz)) * 1e-5
    las.write(arguments.file)
    truth = {"scene": arguments.scene, "noise": arguments.noise, "density": arguments.density}
    pathlib.Path(arguments.file).with_suffix(".json").write_text(json.dumps(truth))
    print(f"{arguments.file}: {len(xyz)} points of {ids.max()} planes")


def areas(scene):
    return [sum(np.linalg.norm(np.cross(u, v)) for _, u, v in parts) for parts in SCENES[scene]()]


def score(arguments):
    import laspy

    truth = json.loads(pathlib.Path(arguments.file).with_suffix(".json").read_text())
    las = laspy.read(pathlib.Path(arguments.out) / pathlib.Path(arguments.file).name)
    found, true = np.asarray(las.surface_id), np.asarray(las.gt_instance)
    with open(pathlib.Path(arguments.out) / "surfaces.csv", newline="") as file:
        rows = {int(row["id"]): row for row in csv.DictReader(file)}
    table = np.zeros((true.max() + 1, found.max() + 1), int)
    np.add.at(table, (true, found), 1)
    of_true, of_found = table.sum(1), table.sum(0)
    area = areas(truth["scene"])
    worst = [0.0, 0.0]
    print("plane  area m2  surfaces  share  angle deg  offset mm  area found")
    for plane, parts in enumerate(SCENES[truth["scene"]](), 1):
        largest = 1 + table[plane, 1:].argmax()
        parts_of = int((table[plane, 1:] >= 0.1 * of_true[plane]).sum())
        row = rows[largest]
        normal = np.array([float(row[f"normal_{axis}"]) for axis in "xyz"])
        centre = np.array([float(row[f"centre_{axis}"]) for axis in "xyz"])
        expected = normal_of(parts)
        angle = np.degrees(np.arccos(min(1.0, abs(normal @ expected))))
        # Offset at the middle of what is seen of the true plane.
        offset = abs((centre - CORNER - np.array(parts[0][0])) @ expected)
        share = table[plane, largest] / of_true[plane]
        if area[plane - 1] >= 1.0:
            worst = [max(worst[0], angle), max(worst[1], offset * 1000)]
        print(
            f"{plane:5}  {area[plane - 1]:7.2f}  {parts_of:8}  {share:5.3f}  {angle:9.3f}  {offset * 1000:9.2f}"
            f"  {float(row['area_m2']):10.2f}"
        )
    t = 0.8
    correct = over = under = missed = 0
    used = np.zeros(found.max() + 1, bool)
    for plane in range(1, true.max() + 1):
        hits = table[plane, 1:] / of_true[plane]
        inside = table[plane, 1:] / np.maximum(of_found[1:], 1)
        whole = np.flatnonzero((hits >= t) & (inside >= t)) + 1
        pieces = np.flatnonzero(inside >= t) + 1
        if len(whole):
            correct += 1
            used[whole] = True
        elif len(pieces) > 1 and table[plane, pieces].sum() >= t * of_true[plane]:
            over += 1
            used[pieces] = True
        else:
            missed += 1
    for surface in range(1, found.max() + 1):
        held = np.flatnonzero(table[1:, surface] >= t * of_true[1:]) + 1
        if len(held) > 1 and table[held, surface].sum() >= t * of_found[surface]:
            under += 1
            missed -= len([p for p in held])
            used[surface] = True
    sizes = of_found[1:][~used[1:]]
    print(f"planes {true.max()}: correct {correct}, over-segmented {over}, under-segmented {under}, missed {missed}")
    print(f"other surfaces: {len(sizes)} with {sizes.sum()} of {len(true)} points, the largest with {sizes.max(initial=0)}")
    print(f"points without a surface: {of_found[0]} ({of_found[0] / len(true):.4f})")
    print(f"worst of planes of 1 m2 or more: angle {worst[0]:.3f} degrees, offset {worst[1]:.2f} mm")
    return 0


def draw(arguments):
    import laspy
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    las = laspy.read(arguments.file)
    ids = np.asarray(las.surface_id)
    xyz = np.stack([las.x, las.y, las.z], 1)
    keep = np.random.default_rng(0).permutation(len(ids))[: arguments.points]
    xyz, ids = xyz[keep], ids[keep]
    sizes = np.bincount(np.asarray(las.surface_id))
    colours = np.random.default_rng(3).random((ids.max() + 1, 3)) * 0.75 + 0.1
    colours[sizes < arguments.small] = [0.75, 0.75, 0.75]
    colours[0] = [0.85, 0.85, 0.85]
    figure = plt.figure(figsize=(12, 8), dpi=110)
    axes = figure.add_subplot(projection="3d")
    low, high = xyz.min(0), xyz.max(0)
    axes.scatter(*(xyz - low).T, s=arguments.size, c=colours[ids], linewidths=0)
    axes.set_box_aspect(high - low)
    axes.view_init(*arguments.view)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.set_zlabel("z (m)")
    figure.tight_layout()
    figure.savefig(arguments.picture)


def kerb(arguments):
    import laspy
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, bands = plt.subplots(len(arguments.files), 1, figsize=(12, 1.5 * len(arguments.files)), dpi=110, squeeze=False)
    for file, axes in zip(arguments.files, bands[:, 0]):
        las = laspy.read(file)
        true = np.asarray(las.gt_instance) == 2
        ids = np.asarray(las.surface_id)[true]
        x, z = np.asarray(las.x)[true] - CORNER[0], np.asarray(las.z)[true] - CORNER[2]
        order = np.argsort(-np.bincount(ids))
        rank = np.empty(len(order), int)
        rank[order] = np.arange(len(order))
        colours = np.random.default_rng(3).random((len(order), 3)) * 0.75 + 0.1
        # Height above the road, which rises along the facade; stretched five times.
        axes.scatter(x, z - 0.1 - 0.01 * x, s=1.5, c=colours[rank[ids]], linewidths=0)
        axes.set_aspect(5.0)
        axes.set_ylabel("height (m)")
    axes.set_xlabel("along the kerb (m)")
    figure.tight_layout()
    figure.savefig(arguments.picture)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("make")
    one.add_argument("scene", choices=SCENES)
    one.add_argument("file")
    one.add_argument("--noise", type=float, default=0.01)
    one.add_argument("--density", type=float, default=2000.0)
    one.add_argument("--seed", type=int, default=1)
    one.set_defaults(call=make)
    two = commands.add_parser("score")
    two.add_argument("file")
    two.add_argument("out")
    two.set_defaults(call=score)
    three = commands.add_parser("draw")
    three.add_argument("file")
    three.add_argument("picture")
    three.add_argument("--view", type=float, nargs=2, default=[25.0, -60.0])
    three.add_argument("--points", type=int, default=150_000)
    three.add_argument("--size", type=float, default=1.0)
    three.add_argument("--small", type=int, default=30)
    three.set_defaults(call=draw)
    four = commands.add_parser("kerb")
    four.add_argument("picture")
    four.add_argument("files", nargs="+")
    four.set_defaults(call=kerb)
    arguments = parser.parse_args()
    return arguments.call(arguments) or 0


if __name__ == "__main__":
    sys.exit(main())
