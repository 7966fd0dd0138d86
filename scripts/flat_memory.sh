#!/usr/bin/env bash
# Peak memory is the same for any length of drive: a scene once, 4 and 16 times in a row, with one memory budget.
#
#     scripts/flat_memory.sh [--method METHOD] [SCENE.laz] [MEMORY-MIB] [COPIES...]
#
# METHOD is euclidean by default. For each length it prints points, time and peak resident set (mapped pages
# included). These are medians by peak of five runs, because it is chance whether both workers need most at the same
# moment. Exit code 1 if the largest peak exceeds the smallest by more than 10 %, or the budget by more than 150
# MiB. Needs a release build (or CHAINAGE), python3 with laspy[lazrs] and, for 16 copies of the default scene, 12 GB
# of disk.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${CHAINAGE:-target/release/chainage}
data=${CHAINAGE_SHARED_DATA:-../shared/data}
method=euclidean
if [ "${1:-}" = --method ]; then
    method=$2
    shift 2
fi
scene=${1:-$data/sim/avenue_road60.laz}
memory=${2:-300}
shift $(($# < 2 ? $# : 2))
copies=("$@")
[ ${#copies[@]} -gt 0 ] || copies=(1 4 16)
if [ ! -f "$scene" ]; then
    echo "skipped: $scene is not there"
    exit 0
fi
if ! python3 -c 'import laspy, lazrs' 2>/dev/null; then
    echo "skipped: python3 with laspy[lazrs] is not there"
    exit 0
fi
scratch=$(mktemp -d "${TMPDIR:-/tmp}/flat.XXXXXX")
trap 'rm -rf "$scratch"' EXIT

smallest=0 largest=0
for count in "${copies[@]}"; do
    python3 scripts/repeat_scene.py "$scene" "$scratch/drive.las" "$count"
    : >"$scratch/runs"
    for _ in 1 2 3 4 5; do
        rm -rf "$scratch/out"
        "$program" run "$scratch/drive.las" -o "$scratch/out" --method "$method" --memory "${memory}M" --threads 2 \
            --progress none >/dev/null
        python3 -c "
import json, sys
result = json.load(open(sys.argv[1]))['result']
print(result['peak_resident_bytes'] // 1024, result['points'], result['tiles'], round(result['seconds']))" \
            "$scratch/out/report.json" >>"$scratch/runs"
    done
    read -r peak_kib points tiles seconds < <(sort -n "$scratch/runs" | sed -n 3p)
    echo "$method, $count copies: $points points, $tiles tiles, $seconds s, peak $((peak_kib / 1024)) MiB"
    [ $smallest -ne 0 ] && [ $smallest -le "$peak_kib" ] || smallest=$peak_kib
    [ $largest -ge "$peak_kib" ] || largest=$peak_kib
    rm -rf "$scratch/out" "$scratch/drive.las"
done
if [ $((largest * 100)) -gt $((smallest * 110)) ]; then
    echo "flat_memory: FAILED, peaks of $((smallest / 1024)) to $((largest / 1024)) MiB differ by more than 10 %"
    exit 1
fi
if [ $((largest / 1024)) -gt $((memory + 150)) ]; then
    echo "flat_memory: FAILED, the peak of $((largest / 1024)) MiB exceeds the budget of $memory MiB by more than 150 MiB"
    exit 1
fi
echo "flat_memory: passed"
