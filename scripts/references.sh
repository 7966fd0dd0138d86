#!/usr/bin/env bash
# Compares results with implementations in Python that share no code: density-peaks on the shipped scene point by point, and
# every figure of eval on a labelled synthetic drive.
#
#     scripts/references.sh
#
# Needs a release build (target/release/chainage, or CHAINAGE), and python3 with numpy, scipy and laspy. Exit code 77: they
# are missing.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${CHAINAGE:-target/release/chainage}
python3 -c 'import numpy, scipy, laspy, lazrs' 2>/dev/null || exit 77
scratch=$(mktemp -d "${TMPDIR:-/tmp}/references.XXXXXX")
trap 'rm -rf "$scratch"' EXIT
quiet=(--progress none --outputs points)

"$program" run tests/data/tree_road_sweep.laz -o "$scratch/peaks" --method density-peaks "${quiet[@]}" >/dev/null
python3 tests/oracle/peaks_oracle.py "$scratch/peaks/tree_road_sweep.laz"

"$program" synth suburb -o "$scratch/drive" --length 60m --seed 3 --pulse-rate 50kHz >/dev/null
for method in euclidean street; do
    "$program" run "$scratch/drive" -o "$scratch/$method" --method "$method" "${quiet[@]}" >/dev/null
    copy=$(ls "$scratch/$method"/*.laz)
    "$program" eval "$copy" --json="$scratch/eval.json" >/dev/null
    python3 tests/oracle/eval_oracle.py "$copy" "$copy" "$scratch/eval.json"
done
