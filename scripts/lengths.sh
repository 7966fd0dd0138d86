#!/usr/bin/env bash
# Memory of synth, run and eval for different lengths of a drive, as a table for benches/results.
#
#     scripts/lengths.sh [KILOMETRES...]        1 4 16
#
# The drive is mixed, as LAS. Its pulse rate gives 12.5 million points per kilometre. The first kilometre of its
# seed has the densest kind of street. run has a budget of 150 MiB, so that the shortest drive has a dozen tiles.
# Peaks are resident sets with mapped pages. run and eval are measured three times, and medians count, because it is
# chance whether the workers need most at the same moment.
# Exit code 1 if the largest peak of a command exceeds its smallest by more than 10 %.
# Needs a release build (or CHAINAGE), GNU time, python3 and, for 16 km, 20 GB of disk.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${CHAINAGE:-target/release/chainage}
lengths=("$@")
[ ${#lengths[@]} -gt 0 ] || lengths=(1 4 16)
scratch=$(mktemp -d "${TMPDIR:-/tmp}/lengths.XXXXXX")
trap 'rm -rf "$scratch"' EXIT

measure() { # KILOMETRES COMMAND ARGUMENTS...: adds a line "km command seconds KiB" to the figures
    local kilometres=$1
    shift
    /usr/bin/time -f "$kilometres $1 %e %M" -a -o "$scratch/figures" "$program" "$@" >/dev/null 2>"$scratch/said" ||
        { cat "$scratch/said"; exit 1; }
}
for kilometres in "${lengths[@]}"; do
    rm -rf "$scratch/drive"
    measure "$kilometres" synth mixed --seed 4 -o "$scratch/drive" --length "${kilometres}km" --pulse-rate 123kHz --las
    for _ in 1 2 3; do
        rm -rf "$scratch/out"
        measure "$kilometres" run "$scratch/drive" -o "$scratch/out" --memory 150M --progress none
        # eval compares the labelled copies with the drive, matched by record order: it reads two sets of files.
        measure "$kilometres" eval "$scratch"/out/*.las --reference "$scratch/drive" --json="$scratch/eval.json"
    done
    python3 -c "import json, sys; print(sys.argv[1], 'points', json.load(open(sys.argv[2]))['counts']['points'], 0)" \
        "$kilometres" "$scratch/eval.json" >>"$scratch/figures"
done

python3 - "$scratch/figures" <<'PY'
import sys
from collections import defaultdict
from statistics import median

figures = defaultdict(lambda: defaultdict(list))
for line in open(sys.argv[1]):
    length, command, number, kib = line.split()
    figures[int(length)][command].append((float(number), int(kib) / 1024))
commands = ["synth", "run", "eval"]
print("| km | points | " + " | ".join(f"{c}, peak MiB | {c}, M points/s" for c in commands) + " |")
print("|---|---|" + "---|---|" * len(commands))
peaks = defaultdict(dict)
for length, of in sorted(figures.items()):
    points = of["points"][0][0]
    cells = []
    for c in commands:
        peaks[c][length] = median(peak for _, peak in of[c])
        cells.append(f"{peaks[c][length]:.0f} | {points / median(seconds for seconds, _ in of[c]) / 1e6:.2f}")
    print(f"| {length} | {points:,.0f} | " + " | ".join(cells) + " |")
bad = 0
for command in commands:
    least, most = min(peaks[command].values()), max(peaks[command].values())
    if most > 1.1 * least:
        print(f"{command}: FAILED, peaks of {least:.0f} to {most:.0f} MiB")
        bad = 1
sys.exit(bad)
PY
