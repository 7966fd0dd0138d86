#!/usr/bin/env bash
# Kills a run again and again at random moments (SIGKILL, seeded), then lets it finish. Compares every output with those
# of an undisturbed run, byte for byte; for LAZ and for LAS. report.json and the line of report.html with the figures of
# the run are not compared, because they contain its times.
#
#     scripts/kill_and_resume.sh [--method METHOD] [--set SECTION.KEY=VALUE]... [SCENE.laz] [KILLS] [TILE-LENGTH]
#
# Without a scene it uses downtown_ts2.laz of the shared data if it is there, else the shipped sample. If a run
# finishes before all kills are spent, it is compared and another one is started. Needs a release build (or
# CHAINAGE). Exit code 1: an output differs.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/same_outputs.sh
program=${CHAINAGE:-target/release/chainage}
data=${CHAINAGE_SHARED_DATA:-../shared/data}
method=street
settings=()
while [[ ${1:-} == --* ]]; do
    case $1 in
    --method) method=$2 ;;
    --set) settings+=(--set "$2") ;;
    *)
        echo "unknown option $1"
        exit 2
        ;;
    esac
    shift 2
done
scene=${1:-$data/sim/downtown_ts2.laz}
if [ ! -f "$scene" ]; then
    echo "skipped: $scene is not there, the shipped sample is used"
    scene=tests/data/tree_road_sweep.laz
fi
kills=${2:-50}
tile=${3:-5}
scratch=$(mktemp -d "${TMPDIR:-/tmp}/kill.XXXXXX")
trap 'rm -rf "$scratch"' EXIT
RANDOM=20

name=$(basename "$scene" .laz)
mkdir -p "$scratch/laz" "$scratch/las"
cp "$scene" "$scratch/laz/$name.laz"
"$program" run "$scratch/laz/$name.laz" -o "$scratch/unpacked" --output-format las --keep-classification --progress none >/dev/null
mv "$scratch/unpacked/$name.las" "$scratch/las/$name.las"

same() { # TEXT
    same_outputs "$scratch/undisturbed" "$scratch/killed" || {
        echo "kill_and_resume: FAILED for $1"
        exit 1
    }
}

for kind in laz las; do
    input=$scratch/$kind/$name.$kind
    options=(--tile-length "$tile" --method "$method" "${settings[@]}" --progress none)
    run() { # OUT
        if ! "$program" run "$input" -o "$scratch/$1" "${options[@]}" >/dev/null 2>"$scratch/errors"; then
            cat "$scratch/errors"
            exit 1
        fi
    }
    began=$(date +%s%N)
    run undisturbed
    whole_ms=$((($(date +%s%N) - began) / 1000000))
    began=$(date +%s%N)
    run undisturbed # once more: measures the time to find that there is nothing to do
    start_ms=$((($(date +%s%N) - began) / 1000000))
    # Each kill comes at a uniformly random moment within the time of a start and twice an equal share of the work.
    # So one run takes about all kills, and they fall into every pass, because finished work is kept.
    shortest=$((start_ms / 2 + 1))
    span=$((start_ms + 2 * whole_ms / kills + 1))
    spent=0 hit=0 finished=0
    : >"$scratch/passes"
    while [ $spent -lt "$kills" ]; do
        "$program" run "$input" -o "$scratch/killed" "${options[@]}" --threads $((RANDOM % 2 + 1)) >/dev/null 2>&1 &
        child=$!
        sleep "$(awk "BEGIN { print ($shortest + $RANDOM % $span) / 1000 }")"
        kill -9 $child 2>/dev/null || true
        spent=$((spent + 1))
        if { wait $child; } 2>/dev/null; then
            same "$kind, finished after $spent kills"
            rm -rf "$scratch/killed"
            finished=$((finished + 1))
        else
            hit=$((hit + 1))
            { grep -o '"pass":"[^"]*"' "$scratch/killed/.chainage/events.jsonl" || echo '"pass":"none"'; } 2>/dev/null |
                tail -1 | cut -d'"' -f4 >>"$scratch/passes"
        fi
    done
    run killed
    same "$kind"
    rm -rf "$scratch/killed" "$scratch/undisturbed"
    echo "$method${settings[*]:+ ${settings[*]}}, $name.$kind: $hit of $spent kills hit a run of $whole_ms ms, $((finished + 1)) run(s) gave the same bytes"
    echo "  by the pass in progress: $(sort "$scratch/passes" | uniq -c | awk '{ printf "%s %s  ", $2, $1 }')"
done
echo "kill_and_resume: passed"
