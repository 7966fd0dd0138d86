#!/usr/bin/env bash
# Memory of synth, run and eval over the length of a drive, as a table for benches/results.
#
#     scripts/lengths.sh [KILOMETRES...]        1 4 16
#
# The preset is mixed, as LAS, with a pulse rate that gives 12.5 million points per kilometre and a seed whose first
# kilometre has the densest kind of street; run has a budget of 300 MiB. Peaks are resident sets with mapped pages.
# Exit code 1 when the largest peak of a command exceeds its smallest by more than 10 % and 5 MiB per kilometre, room for
# what grows with the street and not with the points: the raster of run, the objects of run and eval.
# Needs a release build (or CHAINAGE), GNU time, python3 and, for 16 km, 20 GB of disk.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${CHAINAGE:-target/release/chainage}
lengths=("$@")
[ ${#lengths[@]} -gt 0 ] || lengths=(1 4 16)
scratch=$(mktemp -d "${TMPDIR:-/tmp}/lengths.XXXXXX")
trap 'rm -rf "$scratch"' EXIT

measure() { # KILOMETRES COMMAND ARGUMENTS...: appends "km command seconds KiB" to the figures
    local kilometres=$1
    shift
    /usr/bin/time -f "$kilometres $1 %e %M" -a -o "$scratch/figures" "$program" "$@" >/dev/null 2>"$scratch/said" ||
        { cat "$scratch/said"; exit 1; }
}
for kilometres in "${lengths[@]}"; do
    rm -rf "$scratch/drive" "$scratch/out"
    measure "$kilometres" synth mixed --seed 4 -o "$scratch/drive" --length "${kilometres}km" --pulse-rate 123kHz --las
    measure "$kilometres" run "$scratch/drive" -o "$scratch/out" --memory 300M --progress none
    # The labelled copies against the drive, matched by record order: what eval reads of two sets of files.
    measure "$kilometres" eval "$scratch"/out/*.las --reference "$scratch/drive" --json "$scratch/eval.json"
    python3 -c "import json, sys; print(sys.argv[1], 'points', json.load(open(sys.argv[2]))['counts']['points'], 0)" \
        "$kilometres" "$scratch/eval.json" >>"$scratch/figures"
done

python3 - "$scratch/figures" <<'PY'
import sys
figures = {}
for line in open(sys.argv[1]):
    length, command, number, kib = line.split()
    figures.setdefault(int(length), {})[command] = (float(number), int(kib) / 1024)
commands = ["synth", "run", "eval"]
print("| km | points | " + " | ".join(f"{c}, peak MiB | {c}, M points/s" for c in commands) + " |")
print("|---|---|" + "---|---|" * len(commands))
for length, of in sorted(figures.items()):
    points = of["points"][0]
    cells = [f"{of[c][1]:.0f} | {points / of[c][0] / 1e6:.2f}" for c in commands]
    print(f"| {length} | {points:,.0f} | " + " | ".join(cells) + " |")
bad = 0
for command in commands:
    peaks = [of[command][1] for of in figures.values()]
    room = 5 * (max(figures) - min(figures))
    if max(peaks) > 1.1 * min(peaks) + room:
        print(f"{command}: FAILED, peaks of {min(peaks):.0f} to {max(peaks):.0f} MiB")
        bad = 1
sys.exit(bad)
PY
