#!/usr/bin/env python3
"""Prints the tables of scripts/score.sh: scores side by side, OA by class, and the stages of density-peaks.

    scripts/score_tables.py FOLDER METHOD,... DRIVE...

FOLDER holds DRIVE.METHOD.report.json and DRIVE.METHOD.eval.json.
"""

import json
import pathlib
import sys


def show(value):
    return f"{value:.3f}" if isinstance(value, (int, float)) else "-"


def row(cells):
    print("| " + " | ".join(str(cell) for cell in cells) + " |")


def head(cells):
    row(cells)
    print("|" + "---|" * len(cells))


def scores(drives, methods, load):
    names = ["usr", "osr", "oa", "pq", "f1", "f1_without_false_positives", "mean_best_iou", "ari"]
    head(["drive", "points", "objects", "method", "segments", "USR", "OSR", "OA", "PQ", "F1", "F1*", "mean IoU", "ARI",
          "ground P", "ground R"])
    for drive in drives:
        for method in methods:
            report = load(drive, method, "eval")
            overall, counts, ground = report["overall"], report["counts"], report["ground"]
            row([drive, counts["points"], overall["objects"], method, counts["segments"],
                 *(show(overall.get(name)) for name in names),
                 show(ground.get("precision")), show(ground.get("recall"))])


def classes(drives, methods, load):
    head(["drive", "class", "objects", *(f"{name} {method}" for method in methods for name in ("USR", "OSR", "OA", "F1*"))])
    for drive in drives:
        found = [{entry["class"]: entry for entry in load(drive, method, "eval")["classes"]} for method in methods]
        for number, first in found[0].items():
            cells = [drive, first["name"], first["objects"]]
            for entries in found:
                entry = entries.get(number, {})
                cells += [show(entry.get(name)) for name in ("usr", "osr", "oa", "f1_without_false_positives")]
            row(cells)


def stages(drives, load):
    head(["drive", "points", "voxels", "compression", "voxels of objects", "centres", "clusters before merging",
          "after merging", "halo voxels re-assigned", "halo voxels dropped"])
    for drive in drives:
        found = load(drive, "density-peaks", "report")["result"]["stages"]
        row([drive, found["points"], found["voxels"], show(found["compression"]), found["voxels_of_objects"],
             found["centres"], found["clusters_before_merging"], found["clusters_after_merging"],
             found["halo_voxels_reassigned"], found["halo_voxels_dropped"]])


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    folder, methods, drives = pathlib.Path(sys.argv[1]), sys.argv[2].split(","), sys.argv[3:]

    def load(drive, method, kind):
        return json.loads((folder / f"{drive}.{method}.{kind}.json").read_text())

    print("## Scores\n")
    scores(drives, methods, load)
    print("\nF1 counts a false segment in the class of the object with most of its points. F1* counts none.\n\n## By class\n")
    classes(drives, methods, load)
    if "density-peaks" in methods:
        print("\n## Stages of `density-peaks`\n")
        stages(drives, load)


if __name__ == "__main__":
    main()
