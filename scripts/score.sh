#!/usr/bin/env bash
# Scores methods on the labelled scenes and on six synthetic presets, as tables for benches/results: scores side by
# side, OA by class, and the stages of density-peaks.
#
#     scripts/score.sh [METHOD,...] [LENGTH] [FOLDER]        euclidean,density-peaks 300m
#
# A METHOD that ends in .toml is a configuration and is named after its file: euclidean,config/dense-trees.toml.
# FOLDER keeps report.json and the evaluation of every run. Runs that are there already are not repeated. Needs a
# release build (or CHAINAGE) and python3. Labelled scenes that are missing are left out.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${CHAINAGE:-target/release/chainage}
data=${CHAINAGE_SHARED_DATA:-../shared/data}
methods=${1:-euclidean,density-peaks}
length=${2:-300m}
scratch=$(mktemp -d "${TMPDIR:-/tmp}/score.XXXXXX")
trap 'rm -rf "$scratch"' EXIT
kept=${3:-$scratch/kept}
mkdir -p "$kept"
drives=()

names=
for method in ${methods//,/ }; do names=$names,$(basename "$method" .toml); done
names=${names#,}

score() { # NAME INPUT
    local method chosen
    for chosen in ${methods//,/ }; do
        method=$(basename "$chosen" .toml)
        [ ! -f "$kept/$1.$method.eval.json" ] || continue
        rm -rf "$scratch/out"
        case $chosen in
        *.toml) "$program" run "$2" -o "$scratch/out" -c "$chosen" --progress none >/dev/null ;;
        *) "$program" run "$2" -o "$scratch/out" --method "$chosen" --ground voxel-column --progress none >/dev/null ;;
        esac
        cp "$scratch/out/report.json" "$kept/$1.$method.report.json"
        "$program" eval "$scratch/out" --json="$kept/$1.$method.eval.json" >/dev/null
    done
}
for scene in downtown_ts2 avenue_road60; do
    if [ -f "$data/sim/$scene.laz" ]; then
        drives+=("$scene")
        score "$scene" "$data/sim/$scene.laz"
    fi
done
for preset in suburb downtown avenue highway mixed loop; do
    # A loop returns over its first 300 m: it needs 1,100 m.
    [ "$preset" = loop ] && far=1100m || far=$length
    name="synth $preset, $far"
    drives+=("$name")
    missing=0
    for method in ${names//,/ }; do [ -f "$kept/$name.$method.eval.json" ] || missing=1; done
    [ $missing -eq 1 ] || continue
    rm -rf "$scratch/drive" "$scratch/out"
    "$program" synth "$preset" -o "$scratch/drive" --length "$far" --las >/dev/null 2>&1
    score "$name" "$scratch/drive"
done
python3 scripts/score_tables.py "$kept" "$names" "${drives[@]}"
