# Compares two output folders. Sourced by exactness.sh, kill_and_resume.sh and kill_workers.sh.

# The page of a report without what the run did: times, memory, tiles.
without_times() { # REPORT
    grep -v 'id="data-run"' "$1"
}

# All rows of the layers that are not of the tiles.
layers() { # GEOPACKAGE
    python3 - "$1" <<'PYTHON'
import sqlite3, sys

file = sqlite3.connect(f"file:{sys.argv[1]}?mode=ro", uri=True)
layers = [name for (name,) in file.execute("SELECT table_name FROM gpkg_contents ORDER BY table_name") if name != "tiles"]
assert len(layers) >= 3, layers
for layer in layers:
    print(layer)
    for row in file.execute(f'SELECT * FROM "{layer}" ORDER BY 1'):
        print(row)
PYTHON
}

# Prints a line for each output that only one folder has, or that differs, and returns 1 if there is one. report.json is not
# compared, and its times are left out of the page. With OTHER-TILES, neither is the layer of the tiles of objects.gpkg.
same_outputs() { # ONE OTHER [OTHER-TILES]
    local name result=0
    while read -r name; do
        if [ ! -e "$1/$name" ] || [ ! -e "$2/$name" ]; then
            echo "only one of the two has $name"
            result=1
            continue
        fi
        case $name in
        report.json) continue ;;
        report.html) cmp -s <(without_times "$1/$name") <(without_times "$2/$name") && continue ;;
        objects.gpkg)
            if [ "${3:-}" = OTHER-TILES ]; then
                layers "$1/$name" >"$scratch/layers" && layers "$2/$name" | cmp -s - "$scratch/layers" && continue
            else
                cmp -s "$1/$name" "$2/$name" && continue
            fi
            ;;
        *) cmp -s "$1/$name" "$2/$name" && continue ;;
        esac
        echo "$name differs"
        result=1
    done < <({ ls "$1" && ls "$2"; } | sort -u)
    return $result
}
