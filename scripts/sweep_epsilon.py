#!/usr/bin/env python3
"""Runs `dbscan` with epsilons around the estimate on a labelled scene, and prints a table of the detected objects.

usage: sweep_epsilon.py PROGRAM SCENE.laz FOLDER

FOLDER takes the state of the runs and the results: SCENE-epsilon.md, SCENE-epsilon.svg and SCENE-epsilon.json. The
estimate is that of `chainage cluster --epsilon auto` on the points that are neither ground nor noise. The sweep goes from
0.4 to 3 times the estimate, like Tables 5 and 6 of Wang et al. 2019 (doi:10.3390/s19010172).
"""

import json
import pathlib
import subprocess
import sys

from charts import plots, save

try:
    import laspy
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(0)

FACTORS = (0.4, 0.6, 0.8, 1.0, 1.2, 1.5, 2.0, 2.5, 3.0)
MIN_POINTS = 50


def run(program, scene, out, epsilon):
    """Objects at one epsilon: the labelled points and the figures of `eval`."""
    settings = [f"dbscan.epsilon={epsilon:.4f}", f"dbscan.min_points={MIN_POINTS}"]
    command = [program, "run", scene, "-o", out, "--method", "dbscan", "--output-format", "las", "--progress", "plain"]
    for setting in settings:
        command += ["--set", setting]
    subprocess.run(command, check=True, capture_output=True)
    labelled = next(pathlib.Path(out).glob("*.las"))
    done = subprocess.run([program, "eval", labelled, "--json", "-"], check=True, capture_output=True, text=True)
    return laspy.read(labelled), json.loads(done.stdout)


def estimate(program, points, folder):
    """The program's estimate over the points that it assigns to objects."""
    table = folder / "objects.csv"
    np.savetxt(table, points, fmt="%.3f", delimiter=",", header="x,y,z", comments="")
    done = subprocess.run(
        [program, "cluster", table, "-o", folder / "objects_labelled.csv", "--method", "dbscan", "--json", "-"],
        check=True, capture_output=True, text=True)
    return json.loads(done.stdout)["result"]["estimate"]


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    program, scene, folder = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    folder.mkdir(parents=True, exist_ok=True)
    out = folder / f"{scene.stem}-run"
    labelled, _ = run(program, scene, out, 0.3)
    objects = ~np.isin(np.asarray(labelled.classification), (2, 7, 18))
    found = estimate(program, labelled.xyz[objects], folder)
    rows = []
    for factor in FACTORS:
        epsilon = factor * found["epsilon"]
        labelled, report = run(program, scene, out, epsilon)
        ids = np.asarray(labelled.cluster_id)[objects]
        rows.append({"factor": factor, "epsilon": epsilon, "clusters": int(ids.max()),
                     "noise": float((ids == 0).mean()), "overall": report["overall"]})
    (folder / f"{scene.stem}-epsilon.json").write_text(json.dumps({"estimate": found, "rows": rows}, indent=1))
    (folder / f"{scene.stem}-epsilon.md").write_text(page(scene, int(objects.sum()), found, rows))
    draw(folder / f"{scene.stem}-epsilon.svg", scene, found, rows)


def page(scene, points, found, rows):
    """The sweep as a table."""
    best = max(rows, key=lambda row: row["overall"]["hoover"][1]["correct"])
    lines = [
        f"# Epsilons around the estimate: {scene.name}", "",
        f"{points} points that `voxel-column` keeps. Estimate: epsilon {found['epsilon']:.5f} m at k0 = {found['k0']:.3f} "
        f"of K = {found['k']} (D_K {found['d_k']:.5f} m, R2 {found['r_squared']:.5f}). "
        f"Variant `size`, at least {MIN_POINTS} points; {rows[0]['overall']['objects']} reference objects.", "",
        f"Most objects are detected correctly at T = 0.5 with epsilon {best['epsilon']:.4f} m, "
        f"{best['factor']} times the estimate.", "",
        "| factor | epsilon m | clusters | noise share | T 0.8: correct | over | under | missed | noise | T 0.5: correct | over "
        "| under | missed | noise | PQ | F1 |",
        "|" + "---:|" * 16,
    ]
    for row in rows:
        overall = row["overall"]
        kinds = ("correct", "over", "under", "missed", "noise")
        hoover = [str(outcome[kind]) for outcome in overall["hoover"] for kind in kinds]
        cells = [row["factor"], f"{row['epsilon']:.4f}", row["clusters"], f"{row['noise']:.4f}", *hoover,
                 f"{overall['pq'] or 0:.3f}", f"{overall['f1'] or 0:.3f}"]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines) + "\n"


def draw(path, scene, found, rows):
    """Shares over epsilon, the estimate marked; nothing if matplotlib is absent."""
    plt = plots()
    if plt is None:
        return
    at = [row["epsilon"] for row in rows]
    figure, axes = plt.subplots(figsize=(8, 4.5))
    objects = rows[0]["overall"]["objects"]
    for index, tolerance in enumerate((0.8, 0.5)):
        correct = [row["overall"]["hoover"][index]["correct"] / objects for row in rows]
        axes.plot(at, correct, "o-", label=f"correct at T = {tolerance}")
    axes.plot(at, [row["overall"]["pq"] or 0 for row in rows], "o-", label="PQ")
    axes.plot(at, [row["noise"] for row in rows], "o--", label="share of points without object")
    axes.axvline(found["epsilon"], color="black", linestyle=":", label="estimate")
    axes.set(xlabel="epsilon in m", ylabel="share", title=scene.stem, ylim=(0, 1))
    axes.legend()
    save(figure, path)


main()
