#!/usr/bin/env python3
"""Moves the settings of `density-peaks` around their defaults, one at a time, and prints tables of the scores.

    scripts/study_density_peaks.py PROGRAM RESULTS FOLDER [SCENE.laz...]

Drives: the scenes named, and 60 m each of the presets avenue and mixed. FOLDER takes state and synthetic drives; results
that are there are not computed again. RESULTS takes density-peaks-study.md and density-peaks-study.svg. VS moves the voxels of all
steps and keeps the other lengths in metres, as in Table 2 of the paper. The other settings are in voxels of 0.3 m.
"""

import json
import pathlib
import platform
import subprocess
import sys

from charts import plots, save

PRESETS = ("avenue", "mixed")
LENGTH = "60m"
SWEEPS = {
    "VS": (0.2, 0.25, 0.3, 0.4, 0.5),
    "search_radius": (6, 9, 13, 17, 22),
    "merge_below": (0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.14),
    "scale_above": (2, 5, 8, 12, 1000),
}
DEFAULTS = {"VS": 0.3, "search_radius": 13, "merge_below": 0.08, "scale_above": 5}
COLUMNS = ("oa", "f1", "f1_without_false_positives", "pq")


def settings_of(name, value):
    """The --set arguments of one value of one setting."""
    if name != "VS":
        return {f"density-peaks.{name}": value}
    metres = {"min_density": 1.2, "min_separation": 0.9, "scale_above": 1.5, "search_radius": 3.9}
    lengths = {f"density-peaks.{key}": round(length / value, 6) for key, length in metres.items()}
    return {"density-peaks.voxel": value, "voxel-column.voxel": value, "noise.voxel": value, **lengths}


def score(program, drive, out, name, value):
    """The results of `run` and `eval`; kept in a file beside the state."""
    kept = out.parent / f"{out.name}-{name}-{value}.json"
    if kept.exists():
        return json.loads(kept.read_text())
    settings = [part for pair in settings_of(name, value).items() for part in ("--set", "=".join(map(str, pair)))]
    command = [program, "run", drive, "-o", out, "--method", "density-peaks", "--progress", "none", *settings]
    subprocess.run(command, check=True, capture_output=True)
    done = subprocess.run([program, "eval", out, "--json", "-"], check=True, capture_output=True, text=True)
    report = json.loads(done.stdout)
    stages = json.loads((out / "report.json").read_text())["result"]["stages"]
    result = {"overall": report["overall"], "classes": report["classes"], "stages": stages}
    kept.write_text(json.dumps(result))
    return result


def drives_of(program, folder, scenes):
    drives = {pathlib.Path(scene).stem: scene for scene in scenes if pathlib.Path(scene).exists()}
    for preset in PRESETS:
        drive = folder / f"synth-{preset}"
        if not drive.exists():
            subprocess.run([program, "synth", preset, "-o", drive, "--length", LENGTH, "--las"], check=True,
                           capture_output=True)
        drives[f"synth {preset}, {LENGTH}"] = drive
    return drives


def show(value):
    return f"{value:.3f}" if isinstance(value, (int, float)) else "-"


def page(results):
    """Every figure as tables, a table for each setting."""
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout.strip()
    model = [line for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")]
    machine = model[0].split(":")[1].strip() if model else platform.machine()
    lines = ["# Settings of `density-peaks` around their defaults", "",
             f"`scripts/study_density_peaks.py` at commit {commit}, {machine}. One setting is moved at a time, the others stay. "
             "Defaults in bold. OA, F1, F1* (no false segments counted) and PQ as `chainage eval` defines them; OA by class beside them.",
             "", "![OA and F1* over each setting](density-peaks-study.svg)"]
    names = []
    for by_drive in results.values():
        for runs in by_drive.values():
            for run in runs.values():
                names += [entry["name"] for entry in run["classes"] if entry["name"] not in names]
    for setting, by_drive in results.items():
        head = ["drive", setting, "centres", "after merging", "OA", "F1", "F1*", "PQ", *(f"OA {name}" for name in names)]
        lines += ["", f"## {setting}", "", "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
        for drive, runs in by_drive.items():
            for value, run in runs.items():
                classes = {entry["name"]: entry.get("oa") for entry in run["classes"]}
                shown = f"**{value}**" if value == DEFAULTS[setting] else str(value)
                cells = [drive, shown, run["stages"]["centres"], run["stages"]["clusters_after_merging"],
                         *(show(run["overall"].get(column)) for column in COLUMNS),
                         *(show(classes.get(name)) for name in names)]
                lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines) + "\n"


def draw(path, results):
    """OA and F1* over each setting; nothing if matplotlib is absent."""
    plt = plots()
    if plt is None:
        return
    figure, axes = plt.subplots(2, len(results), figsize=(4 * len(results), 7), sharey="row")
    for column, (setting, by_drive) in enumerate(results.items()):
        for row, (measure, name) in enumerate((("oa", "OA"), ("f1_without_false_positives", "F1*"))):
            at = axes[row][column]
            for drive, runs in by_drive.items():
                values = range(len(runs))
                at.plot(values, [run["overall"].get(measure) or 0 for run in runs.values()], "o-", label=drive)
            at.set_xticks(range(len(SWEEPS[setting])), [str(value) for value in SWEEPS[setting]])
            at.axvline(SWEEPS[setting].index(DEFAULTS[setting]), color="grey", linewidth=0.8)
            at.set_xlabel(setting + (" (m)" if setting == "VS" else ""))
            at.grid(alpha=0.3)
            if column == 0:
                at.set_ylabel(name)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=4, frameon=False)
    figure.tight_layout(rect=(0, 0, 1, 0.95))
    save(figure, path)


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    program, target, folder = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    folder.mkdir(parents=True, exist_ok=True)
    results = {}
    drives = drives_of(program, folder, sys.argv[4:])
    for setting, values in SWEEPS.items():
        for drive, path in drives.items():
            out = folder / f"{drive.replace(' ', '_').replace(',', '')}-run"
            runs = {value: score(program, path, out, setting, value) for value in values}
            results.setdefault(setting, {})[drive] = runs
            print(setting, drive, [show(run["overall"]["oa"]) for run in runs.values()], flush=True)
    (target / "density-peaks-study.md").write_text(page(results))
    draw(target / "density-peaks-study.svg", results)


if __name__ == "__main__":
    main()
