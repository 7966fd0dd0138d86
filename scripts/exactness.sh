#!/usr/bin/env bash
# Tiled equals untiled, on real and simulated streets: byte for byte over tile lengths and threads and memory, record
# for record between LAS and LAZ, point for point between one file, five files and shuffled records; and byte for byte
# with `dbscan` and an estimated epsilon, whose sums go over the whole drive. Without SCENE, also byte for byte over the
# tile lengths of a synthetic drive of a spinning scanner, with trails of what moves beside parked cars, and of two files whose
# offsets are beside the lattice, with their cloud-optimised file.
#
#     scripts/exactness.sh [FOLDER-OF-SHARED-DATA] [SCENE...]
#
# A scene of more than 20 MB is compared with fewer tile lengths, and not as LAS or in another order (all of it with ALL=1).
# Needs a release build (target/release/chainage, or CHAINAGE). A missing scene is skipped with a line. Shuffled and
# split files are skipped if python3 has no laspy. Exit code 1: something differs.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/same_outputs.sh
program=${CHAINAGE:-target/release/chainage}
data=${1:-${CHAINAGE_SHARED_DATA:-../shared/data}}
shift || true
scenes=("$@")
synthetic=
[ ${#scenes[@]} -gt 0 ] || synthetic=1
[ -z "$synthetic" ] || scenes=(sim/downtown_ts2.laz sim/avenue_road60.laz real/kitti_street_22.laz real/lille_street.laz)
scratch=$(mktemp -d "${TMPDIR:-/tmp}/exactness.XXXXXX")
everything=$scratch
# What still runs is stopped, if this ends early.
trap 'jobs -p | xargs -r kill 2>/dev/null || true; wait; rm -rf "$everything"' EXIT
failed=0
runs=0
python=
if python3 -c 'import laspy, lazrs' 2>/dev/null; then python=python3; else
    echo "skipped: shuffled and split files (python3 with laspy[lazrs] is not there)"
fi

run() { # OUT FILES... -- OPTIONS...
    local out=$1; shift
    local files=()
    while [ "$1" != -- ]; do files+=("$1"); shift; done
    shift
    if ! "$program" run "${files[@]}" -o "$out" --progress none "$@" >/dev/null 2>"$scratch/errors"; then
        cat "$scratch/errors"
        exit 1
    fi
    runs=$((runs + 1))
}

same() { # ONE OTHER WHAT
    local line
    while read -r line; do
        echo "DIFFERS: $3: $line"
        failed=1
    done < <(same_outputs "$1" "$2" OTHER-TILES)
}

same_epsilon() { # ONE OTHER WHAT
    local one other
    one=$(grep -oE '"epsilon": *[0-9][^,}]*' "$1/report.json" | head -n 1)
    other=$(grep -oE '"epsilon": *[0-9][^,}]*' "$2/report.json" | head -n 1)
    if [ -z "$one" ] || [ "$one" != "$other" ]; then
        echo "DIFFERS: $3: ${one:-no epsilon} and ${other:-no epsilon}"
        failed=1
    fi
}

compare_scene() { # SCENE
    local scene=$1 began=$SECONDS name laz tilings auto_tilings auto large tiles
    if [ ! -f "$data/$scene" ]; then
        echo "skipped: $data/$scene is not there"
        return
    fi
    name=$(basename "$scene" .laz)
    laz=$scratch/in/$name.laz
    mkdir -p "$scratch/in"
    cp "$data/$scene" "$laz"

    tilings=("5 2" "20 1" "20 4" "60 2")
    auto_tilings=("20 2" "60 1")
    large=
    if [ "$(stat -Lc %s "$laz")" -gt 20000000 ] && [ -z "${ALL:-}" ]; then
        tilings=("20 4")
        auto_tilings=("20 2")
        large=1
    fi
    run "$scratch/whole" "$laz" -- --tile-length 1000000 --threads 1
    for tiles in "${tilings[@]}"; do
        set -- $tiles
        run "$scratch/tiled" "$laz" -- --tile-length "$1" --threads "$2"
        same "$scratch/whole" "$scratch/tiled" "$name, tiles of $1 m, $2 threads"
        rm -rf "$scratch/tiled"
    done
    run "$scratch/tiled" "$laz" -- --memory 64M --threads 2
    same "$scratch/whole" "$scratch/tiled" "$name, as the memory allows"
    rm -rf "$scratch/tiled"

    auto=(--method dbscan --set dbscan.epsilon=auto --no-report)
    run "$scratch/auto" "$laz" -- "${auto[@]}" --tile-length 1000000 --threads 1
    for tiles in "${auto_tilings[@]}"; do
        set -- $tiles
        run "$scratch/tiled" "$laz" -- "${auto[@]}" --tile-length "$1" --threads "$2"
        same "$scratch/auto" "$scratch/tiled" "$name, dbscan auto, tiles of $1 m, $2 threads"
        same_epsilon "$scratch/auto" "$scratch/tiled" "$name, dbscan auto, tiles of $1 m, $2 threads"
        rm -rf "$scratch/tiled"
    done

    if [ -n "$large" ]; then
        echo "$name: compared in $((SECONDS - began)) s"
        return
    fi

    # The same points as LAS. Labelled as LAS, they must equal the unpacked labelled LAZ, for any tiles.
    run "$scratch/unpacked" "$laz" -- --output-format las --keep-classification --no-report
    mkdir -p "$scratch/las-in"
    mv "$scratch/unpacked/$name.las" "$scratch/las-in/$name.las"
    run "$scratch/las" "$scratch/las-in/$name.las" -- --tile-length 20 --no-report
    run "$scratch/las-whole" "$scratch/las-in/$name.las" -- --tile-length 1000000 --no-mmap --no-report
    same "$scratch/las-whole" "$scratch/las" "$name as LAS, tiles of 20 m"
    run "$scratch/laz-as-las" "$laz" -- --output-format las --tile-length 5 --no-report
    if ! cmp -s "$scratch/laz-as-las/$name.las" "$scratch/las/$name.las"; then
        echo "DIFFERS: $name, LAZ in and LAS in"
        failed=1
    fi

    if [ -n "$python" ]; then
        python3 scripts/compare_orders.py write "$laz" "$scratch/orders"
        run "$scratch/shuffled" "$scratch/orders/shuffled.las" -- --tile-length 20 --no-report
        run "$scratch/split" "$scratch"/orders/split_?.las -- --tile-length 20 --no-report
        if ! python3 scripts/compare_orders.py compare "$scratch/whole/$name.laz" "$scratch/orders/order.npy" \
            "$scratch/shuffled/shuffled.las" "$scratch"/split/split_?.las; then
            failed=1
        fi
    fi
    echo "$name: compared in $((SECONDS - began)) s"
}

compare_spinning() {
    local began=$SECONDS tiles
    "$program" synth suburb --length 60m --seed 906 --scanner spinning-64-wide --las -o "$scratch/in" >/dev/null
    run "$scratch/whole" "$scratch/in" -- --tile-length 1000000 --threads 1 --no-report
    for tiles in "8 2" "20 2"; do
        set -- $tiles
        run "$scratch/tiled" "$scratch/in" -- --tile-length "$1" --threads "$2" --no-report
        same "$scratch/whole" "$scratch/tiled" "spinning scanner, tiles of $1 m, $2 threads"
        rm -rf "$scratch/tiled"
    done
    echo "spinning scanner: compared in $((SECONDS - began)) s"
}

# Coordinates of one file are rounded to the steps of the other, so that some are on the other side of a border of the octree.
compare_cloud() {
    local began=$SECONDS tiles
    mkdir -p "$scratch/in"
    "$program" synth suburb --length 60m --pulse-rate 100kHz --seed 907 --las -o "$scratch/drive" >/dev/null
    python3 - "$scratch"/drive/*.las "$scratch/in" <<'PYTHON'
import struct, sys

points = bytearray(open(sys.argv[1], "rb").read())
offset = struct.unpack_from("<3d", points, 155)
for name, beside in ("a", 0.0004), ("b", 0.0006):
    struct.pack_into("<3d", points, 155, *(value + beside for value in offset))
    open(f"{sys.argv[2]}/{name}.las", "wb").write(points)
PYTHON
    run "$scratch/whole" "$scratch/in" -- --copc --method euclidean --tile-length 1000000 --threads 1 --no-report
    for tiles in "5 2" "20 1"; do
        set -- $tiles
        run "$scratch/tiled" "$scratch/in" -- --copc --method euclidean --tile-length "$1" --threads "$2" --no-report
        same "$scratch/whole" "$scratch/tiled" "cloud-optimised file, tiles of $1 m, $2 threads"
        rm -rf "$scratch/tiled"
    done
    echo "cloud-optimised file: compared in $((SECONDS - began)) s"
}

# Two scenes are compared beside each other, because many of the runs have one thread. Each has a folder of its own, in which the
# number of its runs is left.
begin() { # FUNCTION ARGUMENTS...
    scratch=$(mktemp -d "$everything/scene.XXXXXX")
    (
        failed=0
        runs=0
        trap 'code=$?; rm -rf "${scratch:?}"/*; echo "$runs" >"$scratch/runs"; exit $((code + failed))' EXIT
        "$@"
    ) >"$scratch.log" 2>&1 &
    folders+=("$scratch")
    processes+=($!)
    [ ${#processes[@]} -lt 2 ] || finish
}

finish() { # waits for the first of those that were begun
    wait "${processes[0]}" || failed=1
    cat "${folders[0]}.log"
    runs=$((runs + $(cat "${folders[0]}/runs")))
    rm -rf "${folders[0]:?}"
    processes=("${processes[@]:1}")
    folders=("${folders[@]:1}")
}

folders=()
processes=()
for scene in "${scenes[@]}"; do
    begin compare_scene "$scene"
done
[ -z "$synthetic" ] || begin compare_spinning
[ -z "$synthetic" ] || begin compare_cloud
while [ ${#processes[@]} -gt 0 ]; do finish; done
if [ $failed -ne 0 ]; then
    echo "exactness: FAILED"
    exit 1
fi
echo "exactness: passed ($runs runs)"
