#!/usr/bin/env bash
# Scores a method on the labelled scenes and on every synthetic preset, as a table for benches/results.
#
#     scripts/score.sh [METHOD] [LENGTH]        euclidean 300m
#
# Needs a release build (or CHAINAGE) and python3; the labelled scenes are left out where they are not there.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${CHAINAGE:-target/release/chainage}
data=${CHAINAGE_SHARED_DATA:-../shared/data}
method=${1:-euclidean}
length=${2:-300m}
scratch=$(mktemp -d "${TMPDIR:-/tmp}/score.XXXXXX")
trap 'rm -rf "$scratch"' EXIT

echo "| drive | points | objects | USR | OSR | OA | PQ | F1 | F1* | mean IoU | ARI | ground P | ground R |"
echo "|---|---|---|---|---|---|---|---|---|---|---|---|---|"
score() { # NAME INPUT
    rm -rf "$scratch/out"
    "$program" run "$2" -o "$scratch/out" --method "$method" --progress none >/dev/null
    "$program" eval "$scratch/out" --json "$scratch/eval.json" >/dev/null
    python3 - "$1" "$scratch/eval.json" <<'PY'
import json, sys
report = json.load(open(sys.argv[2]))
overall, ground = report["overall"], report["ground"]
def find(tree, name):
    if isinstance(tree, dict):
        if name in tree:
            return tree[name]
        for value in tree.values():
            found = find(value, name)
            if found is not None:
                return found
    return None
def show(value):
    return f"{value:.3f}" if isinstance(value, (int, float)) else "-"
names = ["usr", "osr", "oa", "pq", "f1", "f1_without_false_positives", "mean_best_iou", "ari"]
cells = [show(find(overall, name)) for name in names] + [show(ground.get("precision")), show(ground.get("recall"))]
print(f"| {sys.argv[1]} | {find(report, 'points')} | {find(overall, 'objects')} | " + " | ".join(cells) + " |")
PY
}
for scene in downtown_ts2 avenue_road60; do
    [ ! -f "$data/sim/$scene.laz" ] || score "$scene" "$data/sim/$scene.laz"
done
for preset in suburb downtown avenue highway mixed loop; do
    rm -rf "$scratch/drive"
    # A loop returns over its first 300 m: it needs 1,100 m.
    [ "$preset" = loop ] && far=1100m || far=$length
    "$program" synth "$preset" -o "$scratch/drive" --length "$far" --las >/dev/null 2>&1
    score "synth $preset, $far" "$scratch/drive"
done
