#!/usr/bin/env bash
# All checks that a change must pass before it is merged. They are the same on a laptop and in CI.
#
#     scripts/check.sh [--fast | --quick]
#
# --fast   for every save: format, unit tests, contracts of the methods, command line, layers
# --quick  before a commit: everything that needs no release build
# Without an option: everything. It takes 25 to 45 minutes on two cores from nothing.
#
# Some checks use the shared data (CHAINAGE_SHARED_DATA, else ../shared/data), python3 with laspy and scipy, typos, cargo-deny
# or Chromium. They report what they skip because it is missing. .ci/run installs the tools.
set -uo pipefail
cd "$(dirname "$0")/.."
exec </dev/null # otherwise the pipe below could become standard input (see .ci/run)
lane=${1:-all}
case $lane in all | --fast | --quick) ;; *)
    sed -n '2,12s/^# \{0,1\}//p' "$0"
    exit 2
    ;;
esac
failed=()
skipped=()
summary=

# A disk that is full fails one check after another, in the middle of the night.
space() {
    local wanted=$1 folder free
    for folder in . "${TMPDIR:-/tmp}"; do
        free=$(df -Pk "$folder" | awk 'NR == 2 {print int($4 / 1048576)}')
        if [ "$free" -lt "$wanted" ]; then
            echo "$folder has $free GiB free, and the checks need $wanted GiB: free some space and start again"
            exit 1
        fi
    done
}

step() { # NAME COMMAND...
    local name=$1 began=$SECONDS
    shift
    echo "== $name"
    if "$@"; then
        echo "== $name: passed in $((SECONDS - began)) s"
    else
        echo "== $name: FAILED after $((SECONDS - began)) s"
        failed+=("$name")
    fi
}

skip() { # TEXT
    echo "skipped: $1"
    skipped+=("$1")
}

tests() { # ARGUMENTS OF cargo test...
    local log left_out text
    log=$(mktemp)
    left_out=$(mktemp)
    # A test that passes shows no text, so it writes to this file what it leaves out.
    CHAINAGE_SKIPPED=$left_out cargo test --locked "$@" 2>&1 | tee "$log"
    local code=${PIPESTATUS[0]}
    summary+=$(grep -E '^(     Running|   Doc-tests|test result)' "$log")$'\n'
    while read -r text; do
        skip "$text"
    done < <(sort -u "$left_out")
    rm -f "$log" "$left_out"
    return "$code"
}

release_log=
release_process=
begin_release_build() {
    release_log=$(mktemp)
    cargo build --locked --release --quiet >"$release_log" 2>&1 &
    release_process=$!
}

release_build() {
    wait "$release_process"
    local code=$?
    cat "$release_log"
    rm -f "$release_log"
    return "$code"
}

spelling() {
    if command -v typos >/dev/null; then
        typos
    else
        skip "spelling (typos is not installed)"
    fi
}

dependencies() {
    if ! cargo deny --version >/dev/null 2>&1; then
        skip "licences, sources, duplicates and advisories of dependencies (cargo-deny is not installed)"
        return
    fi
    cargo deny --locked check --hide-inclusion-graph bans licenses sources || return
    # The database of advisories is a git repository, which some networks block.
    if timeout 60 cargo deny --locked fetch db >/dev/null 2>&1; then
        cargo deny --locked --offline check --hide-inclusion-graph advisories
    else
        skip "advisories (their database cannot be fetched)"
    fi
}

# No other toolchain is downloaded. If this one is the minimum, all other steps build with the minimum. If it is newer,
# only clippy helps: its lint incompatible_msrv, among the lints above, finds functions of the standard library that are
# newer than the minimum, but not newer syntax.
minimal_rust() {
    local minimum actual file
    minimum=$(sed -n 's/^rust-version = "\(.*\)"$/\1/p' Cargo.toml)
    actual=$(rustc --version | cut -d ' ' -f 2)
    for file in README.md CONTRIBUTING.md; do
        grep -q "Rust $minimum" "$file" || { echo "$file does not name Rust $minimum" && return 1; }
    done
    if [ "$(printf '%s\n' "$minimum" "$actual" | sort -V | head -n 1)" != "$minimum" ]; then
        echo "this is Rust $actual, the minimum is $minimum"
        return 1
    fi
    case $actual in
    "$minimum" | "$minimum".*) echo "this is the minimum, Rust $minimum" ;;
    *) skip "build with the minimum, Rust $minimum (this is $actual)" ;;
    esac
}

browser() {
    local log
    log=$(mktemp)
    scripts/check_report.py 2>&1 | tee "$log"
    local code=${PIPESTATUS[0]}
    skipped+=("$(sed -n 's/^skipped: //p' "$log")")
    [ -n "${skipped[-1]}" ] || unset 'skipped[-1]'
    rm -f "$log"
    return "$code"
}

# The wheel with the release build as its program and the module in the profile of the tests, whose compiled dependencies it takes
# where their features agree, installed in a folder of its own.
python_package() {
    local missing
    missing=$(python3 - <<'PYTHON'
import importlib.util
print(*(name for name in ("maturin", "numpy", "pytest", "laspy", "distributed") if importlib.util.find_spec(name) is None))
PYTHON
    )
    if [ -n "$missing" ]; then
        skip "the Python package ($missing is not installed)"
        return
    fi
    cargo fmt --check --manifest-path python/Cargo.toml || return
    rm -rf target/python
    CHAINAGE_WHEEL_PROFILE=dev CHAINAGE_WHEEL_PROGRAM=$PWD/target/release/chainage python3 -m pip install --quiet --disable-pip-version-check \
        --no-build-isolation --no-deps --target target/python . || return
    CHAINAGE_PROGRAM=$PWD/target/release/chainage PYTHONPATH=$PWD/target/python \
        python3 -m pytest -q -m "not slow" -p no:cacheprovider || return
    PYTHONPATH=$PWD/target/python python3 python/examples/sample.py
}

references() {
    local code=0
    scripts/references.sh || code=$?
    [ "$code" -ne 77 ] || { skip "implementations in Python (numpy, scipy or laspy is not installed)" && return; }
    return "$code"
}

# Debian's QGIS knows its own Python only.
styles() {
    local folder code=0
    folder=$(mktemp -d)
    target/release/chainage run tests/data/tree_road_sweep.laz -o "$folder" --outputs gpkg --quiet >/dev/null &&
        /usr/bin/python3 scripts/check_qgis.py "$folder/objects.gpkg" 2>/dev/null || code=$?
    rm -rf "$folder"
    [ "$code" -ne 77 ] || { skip "styles of objects.gpkg in QGIS (python3-qgis is not installed)" && return; }
    return "$code"
}

step "format" cargo fmt --check
[ "$lane" != all ] || space 8
if [ "$lane" = --fast ]; then
    step "unit tests" tests --lib
    step "contracts, command line, layers" tests --test main -- contracts cli:: architecture kernels
else
    # The release build compiles the crate with one thread: if it began with the tests, it would end after them.
    [ "$lane" != all ] || begin_release_build
    step "spelling" spelling
    step "dependencies" dependencies
    step "lints" cargo clippy --locked --all-targets -- -D warnings
    step "minimal Rust version" minimal_rust
    step "test build" tests --no-run
    step "tests and doc tests" tests
    # rounds_of_the_child is a part of another test.
    step "long tests" tests --test main -- --ignored --skip rounds_of_the_child
    step "documentation" env RUSTDOCFLAGS="-D warnings" cargo doc --locked --no-deps --quiet
fi
if [ "$lane" = all ]; then
    step "release build" release_build
    step "digests of all outputs" scripts/digest.py --check
    step "exactness" scripts/exactness.sh
    step "independent implementations" references
    step "Python package" python_package
    step "report in a browser" browser
    step "styles in QGIS" styles
    step "kill and resume, LAS and LAZ" scripts/kill_and_resume.sh tests/data/tree_road_sweep.laz 20 4
    step "kill and resume, method with several steps" \
        scripts/kill_and_resume.sh --method density-peaks tests/data/tree_road_sweep.laz 10 20
    step "kill and resume, estimated epsilon" \
        scripts/kill_and_resume.sh --method dbscan --set dbscan.epsilon=auto tests/data/tree_road_sweep.laz 10 20
fi

echo
echo "== test results"
echo "$summary"
[ ${#skipped[@]} -eq 0 ] || printf 'skipped: %s\n' "${skipped[@]}"
if [ ${#failed[@]} -gt 0 ]; then
    printf 'FAILED: %s\n' "${failed[@]}"
    exit 1
fi
echo "all checks passed"
