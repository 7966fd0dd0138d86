#!/usr/bin/env python3
"""Shows what seams do: a street cut into tiles and clustered tile by tile, beside the same street in one run.

    scripts/seams.py STREET.las FOLDER [--tile 25] [--chainage target/release/chainage] [options of scripts/render.py]

Writes FOLDER/tile_by_tile.png and FOLDER/chainage.png and prints the number of ids of both and the number of objects
that are cut. Tile by tile, ids restart in every tile, as they do in tools that process tiles independently. Needs numpy,
laspy[lazrs] and pillow.
"""

import argparse
import pathlib
import shutil
import subprocess
import sys

import laspy
import numpy as np


def run(program, files, out):
    command = [program, "run", *map(str, files), "-o", str(out), "--progress", "none", "--output-format", "las"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("street")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--tile", type=float, default=25.0, help="length of a tile in metres, along x or y")
    parser.add_argument("--chainage", default="target/release/chainage")
    args, render_options = parser.parse_known_args()
    shutil.rmtree(args.folder, ignore_errors=True)
    tiles = args.folder / "tiles"
    tiles.mkdir(parents=True)

    street = laspy.read(args.street)
    places = np.stack([street.x, street.y], 1)
    axis = int(np.argmax(np.ptp(places, axis=0)))
    tile_of = ((places[:, axis] - places[:, axis].min()) // args.tile).astype(int)
    whole = run(args.chainage, [args.street], args.folder / "whole")
    whole_las = next(whole.glob("*.las"))
    ids = np.asarray(laspy.read(whole_las).cluster_id).astype(np.int64)

    alone = np.zeros(len(ids), np.int64)
    for tile in range(tile_of.max() + 1):
        inside = np.flatnonzero(tile_of == tile)
        part = laspy.LasData(street.header, street.points[inside])
        part.write(tiles / f"tile_{tile:02}.las")
        out = run(args.chainage, [tiles / f"tile_{tile:02}.las"], args.folder / f"tile_{tile:02}")
        alone[inside] = np.asarray(laspy.read(out / f"tile_{tile:02}.las").cluster_id)

    labelled = alone > 0
    pieces = np.unique(np.stack([tile_of[labelled], alone[labelled]], 1), axis=0)
    both = labelled & (ids > 0)
    seen = np.unique(np.stack([ids[both], tile_of[both], alone[both]], 1), axis=0)
    cut = np.bincount(seen[:, 0]) > 1
    print(f"in one run:   {len(np.unique(ids[ids > 0]))} objects, as many ids")
    print(f"tile by tile: {len(pieces)} pieces under {len(np.unique(alone[labelled]))} ids; {cut.sum()} objects are cut")

    copy = laspy.read(whole_las)
    copy.cluster_id = alone.astype(np.uint32)
    copy.write(args.folder / "tile_by_tile.las")
    render = [sys.executable, str(pathlib.Path(__file__).with_name("render.py"))]
    for name, file in [("tile_by_tile", args.folder / "tile_by_tile.las"), ("chainage", whole_las)]:
        subprocess.run([*render, str(file), "-o", str(args.folder / f"{name}.png"), *render_options], check=True)


if __name__ == "__main__":
    main()
