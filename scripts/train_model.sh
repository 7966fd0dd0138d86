#!/usr/bin/env bash
# Makes the built-in model of street, src/cluster/street/model.bin, and its card from synthetic drives alone. So the
# model may ship, and no scene that we score with has been learned from.
#
#     scripts/train_model.sh [SCENES...]
#
# SCENES are labelled drives that the card scores the model with (default: the labelled scenes beside the repository,
# where they are there). Needs a release build (or CHAINAGE), 5 GB of disk and an hour on two cores.
# The same program gives the same bytes.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${CHAINAGE:-target/release/chainage}
data=${CHAINAGE_SHARED_DATA:-../shared/data}
scratch=$(mktemp -d "${TMPDIR:-/tmp}/train.XXXXXX")
trap 'rm -rf "$scratch"' EXIT

# One kind of drive per line: name, preset, seed, and options of chainage synth. Add scanners here. There are two drives of each
# kind, the second one with a seed that is 100 higher. With one of each, F1 of a scene changes by up to 0.04 with the seeds
# (benches/results/street.md).
drives="
suburb-two-heads    suburb   11 --length 200m --pulse-rate 250kHz
downtown-two-heads  downtown 12 --length 200m --pulse-rate 250kHz
avenue-two-heads    avenue   13 --length 200m --pulse-rate 250kHz
highway-two-heads   highway  14 --length 200m --pulse-rate 250kHz
parkway-two-heads   parkway  15 --length 150m --pulse-rate 250kHz
lane-two-heads      lane     16 --length 150m --pulse-rate 250kHz
suburb-one-head     suburb   21 --length 150m --pulse-rate 550kHz --heads 1
downtown-one-head   downtown 22 --length 150m --pulse-rate 550kHz --heads 1
avenue-one-head     avenue   23 --length 150m --pulse-rate 550kHz --heads 1
parkway-one-head    parkway  24 --length 150m --pulse-rate 550kHz --heads 1
lane-one-head       lane     25 --length 120m --pulse-rate 550kHz --heads 1
suburb-sparse       suburb   31 --length 250m --pulse-rate 60kHz --profiles 80Hz --noise 20mm
downtown-sparse     downtown 32 --length 250m --pulse-rate 60kHz --profiles 80Hz --noise 20mm
avenue-sparse       avenue   33 --length 250m --pulse-rate 60kHz --profiles 80Hz --noise 20mm
parkway-sparse      parkway  34 --length 250m --pulse-rate 60kHz --profiles 80Hz --noise 10mm
lane-sparse         lane     35 --length 200m --pulse-rate 60kHz --profiles 80Hz --noise 20mm
suburb-64-sweeps    suburb   51 --scanner spinning-64 --sweeps 20 --drift 30mm
downtown-64-sweeps  downtown 52 --scanner spinning-64-wide --sweeps 20 --drift 30mm
downtown-64-drift   downtown 58 --scanner spinning-64 --sweeps 25 --drift 60mm
suburb-64-drift     suburb   59 --scanner spinning-64-wide --sweeps 25 --drift 60mm
lane-64-sweeps      lane     53 --scanner spinning-64 --sweeps 20 --drift 30mm
lane-64-drift       lane     60 --scanner spinning-64-wide --sweeps 25 --drift 60mm
"
mkdir "$scratch/drives"
while read -r name preset seed options; do
    [ -n "$name" ] || continue
    # shellcheck disable=SC2086 # options are words
    "$program" synth "$preset" --seed "$seed" $options -o "$scratch/drives/$name" >/dev/null
    # shellcheck disable=SC2086
    "$program" synth "$preset" --seed $((seed + 100)) $options -o "$scratch/drives/$name-b" >/dev/null
done <<<"$drives"
export LC_ALL=C # the order of the drives counts

scenes=("$@")
if [ $# -eq 0 ]; then
    for scene in "$data"/sim/*.laz "$data"/real-labelled/*.laz; do
        [ ! -f "$scene" ] || scenes+=("$scene")
    done
fi
[ ${#scenes[@]} -eq 0 ] || set -- --test "${scenes[@]}"
# voxel-column leaves more of the ground than the default filter. So the model learns what ground looks like. A model that
# learned with the default filter is better by voxels and worse by objects (benches/results/street.md).
"$program" train "$scratch"/drives/* --ground voxel-column --thin 0.4,0.12 --seed 1 --rounds 150 --leaves 32 --scratch "$scratch/state" --progress plain \
    -o src/cluster/street/model.bin --card benches/results/street-model.md "$@"
