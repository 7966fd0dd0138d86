#!/usr/bin/env bash
# Makes the built-in models of street, src/cluster/street/model.bin (streets) and forest.bin, and their cards, from synthetic drives
# alone. So the models may ship, and no scene that we score with has been learned from.
#
#     scripts/train_model.sh [street|forest] [objects] [SCENES...]
#
# Without a first argument it makes both. With `objects`, the models of voxels stay, and only those of objects are learned: the names
# and the pieces. SCENES are labelled drives that the card of the streets scores its model with (default: the labelled scenes beside
# the repository, where they are there). Needs a release build (or CHAINAGE), 8 GB of disk, and two hours on two cores; with `objects`
# 40 minutes. The same program gives the same bytes.
#
# The built-in models are not what the whole script makes today: their models of voxels were made before the noise and the generator
# changed, because those of today are worse (benches/results/street.md, "What stands at facades"). So choose `objects`. The models
# of objects of forests were made before names learned from doubtful copies and before cars were rounded.
#
# The models of voxels learn from two drives of each kind. Those of objects learn from two others, and from a further kind of drive:
# a spinning scanner that moves. It leaves trails and far crowns, and most pieces of objects.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${CHAINAGE:-target/release/chainage}
data=${CHAINAGE_SHARED_DATA:-../shared/data}
scratch=$(mktemp -d "${TMPDIR:-/tmp}/train.XXXXXX")
trap 'rm -rf "$scratch"' EXIT
export LC_ALL=C # the order of the drives counts
made="street forest"
case ${1:-} in street | forest) made=$1 && shift ;; esac
only_objects=false
case ${1:-} in objects) only_objects=true && shift ;; esac

# One kind of drive per line: name, preset, seed, and options of chainage synth. Add scanners here. The second drive of a kind has
# a seed that is 100 higher, the third 200, the fourth 300. With one drive of each kind for the voxels, F1 of a scene changes by up
# to 0.04 with the seeds (benches/results/street.md).
street="
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
# The models of voxels do not learn from these: with them, scenes get worse (benches/results/street.md, "A model with drives of
# spinning scanners").
moving="
suburb-64-drive     suburb   61 --length 100m --scanner spinning-64
downtown-64-drive   downtown 62 --length 100m --scanner spinning-64-wide
avenue-64-drive     avenue   63 --length 100m --scanner spinning-64
parkway-64-drive    parkway  64 --length 100m --scanner spinning-64-wide
suburb-32-drive     suburb   65 --length 100m --scanner spinning-32
avenue-32-drive     avenue   66 --length 100m --scanner spinning-32
downtown-32-drive   downtown 67 --length 100m --scanner spinning-32
lane-64-drive       lane     68 --length 100m --scanner spinning-64
"
# A model of streets that also learned from these has F1 0.46 instead of 0.32 on a forest and up to 0.04 less on streets: bare stems
# look like poles.
forest="
forest-two-heads    forest   17 --length 70m --pulse-rate 250kHz
forest-one-head     forest   26 --length 60m --pulse-rate 550kHz --heads 1
forest-sparse       forest   36 --length 100m --pulse-rate 60kHz --profiles 80Hz --noise 20mm
forest-64-sweeps    forest   54 --scanner spinning-64-wide --sweeps 20 --drift 30mm
"
make() { # KINDS FOLDER SUFFIX ADDED-TO-THE-SEED
    local name preset seed options
    while read -r name preset seed options; do
        [ -n "$name" ] || continue
        # shellcheck disable=SC2086 # options are words
        "$program" synth "$preset" --seed $((seed + $4)) $options -o "$2/$name$3" >/dev/null
    done <<<"$1"
}

options=(--thin 0.4,0.12 --seed 1 --scratch "$scratch/state" --progress plain)

# voxel-column leaves more of the ground than the default filter. So the models of voxels learn what ground looks like. A model that
# learned with the default filter is better by voxels and worse by objects (benches/results/street.md). The objects are those of the
# default filter, as in a run.
learn_voxels() { # KINDS MODEL CARD OPTIONS...
    local drives
    drives=$(mktemp -d "$scratch/drives.XXXXXX")
    make "$1" "$drives" "" 0
    make "$1" "$drives" -b 100
    "$program" train "$drives"/* "${options[@]}" --ground voxel-column --rounds 150 --leaves 32 -o "$2" --card "$3" "${@:4}"
    rm -rf "$drives"
}

learn_objects() { # KINDS ONTO MODEL CARD
    local drives
    drives=$(mktemp -d "$scratch/drives.XXXXXX")
    make "$1" "$drives" -c 200
    make "$1" "$drives" -d 300
    "$program" train "$drives"/* "${options[@]}" --onto "$2" --rounds 60 --leaves 16 -o "$3" --card "$4"
    rm -rf "$drives"
}

# A model of two stages, with a card that has a part for each. The card of the voxels comes first.
learn() { # KINDS KINDS-OF-OBJECTS MODEL CARD OPTIONS...
    local voxels=$scratch/voxels.model card=$scratch/voxels.md
    if $only_objects; then
        cp "$3" "$voxels"
        awk '/^# Model/ && NR > 1 { exit } { print }' "$4" >"$card"
    else
        learn_voxels "$1" "$voxels" "$card" "${@:5}"
        printf '\n' >>"$card"
    fi
    learn_objects "$2" "$voxels" "$3" "$scratch/objects.md"
    cat "$card" "$scratch/objects.md" >"$scratch/whole.md"
    mv "$scratch/whole.md" "$4"
}

scenes=("$@")
if [ $# -eq 0 ]; then
    for scene in "$data"/sim/*.laz "$data"/real-labelled/*.laz; do
        [ ! -f "$scene" ] || scenes+=("$scene")
    done
fi
[ ${#scenes[@]} -eq 0 ] || set -- --test "${scenes[@]}"
folder=src/cluster/street
case $made in *street*) learn "$street" "$street$moving" $folder/model.bin benches/results/street-model.md "$@" ;; esac
case $made in *forest*) learn "$forest" "$forest" $folder/forest.bin benches/results/forest-model.md ;; esac
