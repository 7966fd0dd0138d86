#!/usr/bin/env bash
# Lets several workers share a run and kills them again and again at random moments (SIGKILL, seeded), and the reductions
# too, while units are computed twice at once. Compares every output with that of one process, byte for byte. report.json and
# the line of report.html with the figures of the run are not compared, because they contain its times.
#
#     scripts/kill_workers.sh [--method METHOD] [--set SECTION.KEY=VALUE]... [SCENE] [KILLS] [TILE-LENGTH]
#
# KILLS are those that hit. If a run is finished before all of them are spent, it is compared and another one is started. Needs a release build (or
# CHAINAGE). Exit code 1: an output differs, or a worker failed that was not killed.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/same_outputs.sh
program=${CHAINAGE:-target/release/chainage}
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
scene=${1:-tests/data/tree_road_sweep.laz}
kills=${2:-200}
tile=${3:-5}
scratch=$(mktemp -d "${TMPDIR:-/tmp}/workers.XXXXXX")
trap 'rm -rf "$scratch"' EXIT
RANDOM=7
options=(--tile-length "$tile" --method "$method" "${settings[@]}" --memory 512M)
alone=$scratch/alone
out=$scratch/out

began=$(date +%s%N)
"$program" run "$scene" -o "$alone" "${options[@]}" --progress none >/dev/null
whole_ms=$((($(date +%s%N) - began) / 1000000))
began=$(date +%s%N)
"$program" run "$scene" -o "$alone" "${options[@]}" --progress none >/dev/null # nothing to do: the time of a start
start_ms=$((($(date +%s%N) - began) / 1000000))
# Each kill comes within twice the time of a start and a sixth of the work, so that a run takes some dozens of them.
span=$((2 * start_ms + whole_ms / 6 + 1))

same() {
    same_outputs "$alone" "$out" || {
        echo "kill_workers: FAILED for $method"
        exit 1
    }
}

due() { # reads the pass and its missing units
    local text
    text=$("$program" next "$out" --json)
    pass=$(sed -n 's/^  "pass": "\{0,1\}\([^",]*\)"\{0,1\},$/\1/p' <<<"$text")
    ranges=$(sed -n 's/^  "ranges": "\(.*\)"$/\1/p' <<<"$text")
}

spent=0 tried=0 runs=0
: >"$scratch/passes"
while [ $spent -lt "$kills" ]; do
    # Every second run leaves the survey to the workers as well.
    more=()
    [ $((runs % 2)) = 0 ] || more=(--leave-survey)
    "$program" plan "$scene" -o "$out" --units "${options[@]}" "${more[@]}" >/dev/null 2>"$scratch/errors"
    due
    while [ "$pass" != null ]; do
        children=()
        if [ -n "$ranges" ]; then
            for _ in 1 2 3; do
                "$program" work "$out" --pass "$pass" --units "$ranges" --threads 1 --wait 0 >/dev/null 2>>"$scratch/errors" &
                children+=($!)
            done
        fi
        "$program" reduce "$out" --after "$pass" --wait 1 >/dev/null 2>&1 &
        reduction=$!
        # All of them are killed, one after the other, until the kills are spent; then they may finish.
        for child in "${children[@]}" $reduction; do
            if [ $spent -lt "$kills" ]; then
                sleep "$(awk "BEGIN { print $((RANDOM % span)) / 1000 }")"
                kill -9 "$child" 2>/dev/null || true
                tried=$((tried + 1))
                if ! { wait "$child"; } 2>/dev/null; then
                    spent=$((spent + 1))
                    echo "$pass" >>"$scratch/passes"
                fi
            elif [ "$child" = $reduction ]; then
                { wait "$child"; } 2>/dev/null || true
            elif ! wait "$child"; then
                cat "$scratch/errors"
                echo "kill_workers: FAILED, a worker failed without being killed"
                exit 1
            fi
        done
        due
    done
    same
    runs=$((runs + 1))
    rm -rf "$out"
done
echo "$method${settings[*]:+ ${settings[*]}}: $spent of $tried kills hit a worker or a reduction, $runs run(s) gave the bytes of one process"
echo "  by the pass in progress: $(sort "$scratch/passes" | uniq -c | awk '{ printf "%s %s  ", $2, $1 }')"
echo "kill_workers: passed"
