#!/usr/bin/env bash
# Everything that must hold before a change is merged, the same on a laptop and in CI; about a quarter of an hour on two
# cores from nothing, a few minutes when built.
#
#     scripts/check.sh [--quick]
#
# --quick leaves out the release build and the suites that need it. Those suites use the shared data (CHAINAGE_SHARED_DATA,
# else ../shared/data) and say that they skip what is not there.
set -uo pipefail
cd "$(dirname "$0")/.."
exec </dev/null # a closed standard input would become the read end of the pipe below (see .ci/run)
quick=${1:-}
failed=()
summary=

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

tests() {
    local log
    log=$(mktemp)
    cargo test --locked 2>&1 | tee "$log"
    local code=${PIPESTATUS[0]}
    summary=$(grep -E '^(     Running|   Doc-tests|test result)' "$log")
    rm -f "$log"
    return "$code"
}

step "format" cargo fmt --check
step "lints" cargo clippy --locked --all-targets -- -D warnings
step "tests and doc tests" tests
step "documentation" env RUSTDOCFLAGS="-D warnings" cargo doc --locked --no-deps --quiet
if [ "$quick" != --quick ]; then
    step "release build" cargo build --locked --release --quiet
    step "exactness" scripts/exactness.sh
    step "kill and resume, LAS and LAZ" scripts/kill_and_resume.sh tests/data/tree_road_sweep.laz 20 4
fi

echo
echo "== test results"
echo "$summary"
if [ ${#failed[@]} -gt 0 ]; then
    printf 'FAILED: %s\n' "${failed[@]}"
    exit 1
fi
echo "all checks passed"
