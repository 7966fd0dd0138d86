#!/usr/bin/env python3
"""Digests of all outputs, to prove that a change of the code does not change them.

    scripts/digest.py              prints "DIGEST  CASE/FILE" lines
    scripts/digest.py --check      compares them with tests/digests.txt; exit code 1 if one differs, with its name
    scripts/digest.py --write      writes tests/digests.txt

Every method runs on the shipped samples and, where present, on the shared data (CHAINAGE_SHARED_DATA, else
../shared/data); `--check` compares the cases that could run and names the skipped ones. Labelled files, tables, charts and
printed JSON are compared byte by byte. Times, memory and the list of passes in `report.json` are ignored.
Needs a release build (target/release/chainage, or CHAINAGE) and Python 3 without further packages.
"""

import hashlib
import json
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.path.abspath(os.environ.get("CHAINAGE", ROOT / "target/release/chainage"))
DATA = pathlib.Path(os.environ.get("CHAINAGE_SHARED_DATA", ROOT.parent / "shared/data"))
EXPECTED = ROOT / "tests/digests.txt"

SWEEP = ROOT / "tests/data/tree_road_sweep.laz"
PROFILES = ROOT / "tests/data/mls_profiles.las"
AUTO = ["--method", "dbscan", "--set", "dbscan.epsilon=auto"]

# Values that differ from call to call, or that say how a result was computed.
VOLATILE = {"seconds", "passes", "peak_resident_bytes", "program", "prediction", "reference"}

# The plan, and with it the number of tiles, follows from threads and memory.
EVERY_RUN = ["--progress", "none", "--threads", "2", "--memory", "2G"]

# Name, input, arguments of `run`. Cases of the default method name no method. For the others, `euclidean` and
# `voxel-column` are used unless the arguments name others.
RUNS = [
    ("sweep-default", SWEEP, []),
    ("sweep-default-tiles", SWEEP, ["--tile-length", "15"]),
    ("lille-default", DATA / "real/lille_street.laz", ["--tile-length", "8"]),
    ("downtown-default", DATA / "sim/downtown_ts2.laz", []),
    ("sweep-euclidean", SWEEP, []),
    ("sweep-euclidean-tiles", SWEEP, ["--tile-length", "15"]),
    ("sweep-euclidean-las", SWEEP, ["--output-format", "las", "--set", "output.original_classification=true"]),
    ("sweep-no-ground", SWEEP, ["--ground", "none", "--keep-classification"]),
    ("sweep-density-peaks", SWEEP, ["--method", "density-peaks", "--tile-length", "20"]),
    ("sweep-dbscan-size", SWEEP, ["--method", "dbscan"]),
    ("sweep-dbscan-core", SWEEP, ["--method", "dbscan", "--set", "dbscan.variant=core", "--tile-length", "15"]),
    ("sweep-dbscan-auto", SWEEP, [*AUTO, "--tile-length", "30"]),
    ("sweep-dbscan-fields", SWEEP, [*AUTO, "--set", 'dbscan.fields=["x","y","z","intensity"]']),
    ("sweep-normalized-cut", SWEEP, ["--method", "normalized-cut", "--set", "euclidean.max_gap_m=0.8", "--tile-length", "20"]),
    ("sweep-p-linkage", SWEEP, ["--method", "p-linkage", "--tile-length", "20"]),
    ("profiles-euclidean", PROFILES, []),
    ("profiles-euclidean-laz", PROFILES, ["--output-format", "laz", "--tile-length", "5"]),
    ("profiles-density-peaks", PROFILES, ["--method", "density-peaks"]),
    ("profiles-dbscan-auto", PROFILES, [*AUTO]),
    ("lille-euclidean", DATA / "real/lille_street.laz", ["--tile-length", "8"]),
    ("lille-density-peaks", DATA / "real/lille_street.laz", ["--method", "density-peaks"]),
    ("lille-p-linkage", DATA / "real/lille_street.laz", ["--method", "p-linkage", "--ground", "none"]),
    ("downtown-euclidean", DATA / "sim/downtown_ts2.laz", []),
    ("downtown-density-peaks", DATA / "sim/downtown_ts2.laz", ["--method", "density-peaks"]),
    ("downtown-dbscan-auto", DATA / "sim/downtown_ts2.laz", [*AUTO, "--set", "dbscan.variant=core"]),
    ("avenue-normalized-cut", DATA / "sim/avenue_road60.laz", ["--method", "normalized-cut", "--ground", "upward-growing"]),
    ("avenue-euclidean", DATA / "sim/avenue_road60.laz", ["--output-format", "las"]),
    ("avenue-density-peaks", DATA / "sim/avenue_road60.laz", ["--method", "density-peaks"]),
    ("suburb-euclidean", DATA / "sim/suburb_ts1.laz", []),
]

# Name, table, arguments of `cluster`.
TABLES = [
    ("r15-dbscan", DATA / "tables/R15.txt", ["--method", "dbscan"]),
    ("r15-p-linkage", DATA / "tables/R15.txt", ["--method", "p-linkage"]),
    ("aggregation-p-linkage", DATA / "tables/Aggregation.txt", ["--method", "p-linkage", "--scale", "2", "--merge"]),
]

# Versions may rename the settings of methods. The outputs prove the values that a run used.
REPORT_KEYS = ("input", "crs", "lattice_step_m", "axis", "result")


def methods(case, arguments):
    """Method and ground filter of a case that names none."""
    if "default" in case:
        return []
    fixed = [("--method", "euclidean"), ("--ground", "voxel-column")]
    return [word for option, value in fixed if option not in arguments for word in (option, value)]


def call(*arguments):
    """Standard output of the program. If it fails, this prints its message and exits."""
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, arguments))}: exit code {done.returncode}\n{done.stderr.decode()}")
    return done.stdout


def steady(value):
    """A JSON value without the values that differ from call to call."""
    if isinstance(value, dict):
        return {key: steady(inner) for key, inner in value.items() if key not in VOLATILE}
    return [steady(inner) for inner in value] if isinstance(value, list) else value


def digest(data):
    return hashlib.sha256(data).hexdigest()[:32]


def json_digest(data, keys=None):
    value = json.loads(data)
    if keys:
        value = {key: value[key] for key in keys}
    return digest(json.dumps(steady(value), sort_keys=True).encode())


def page_digest(data):
    """The digest of a page without what the run did: times, memory, tiles."""
    return digest(b"\n".join(line for line in data.split(b"\n") if b'id="data-run"' not in line))


def folder_digests(case, folder):
    # The bytes of a GeoPackage follow from the version of SQLite as well. Its values are those of objects.csv.
    for path in sorted(path for path in folder.iterdir() if path.is_file() and path.suffix != ".gpkg"):
        data = path.read_bytes()
        if path.name == "report.json":
            yield f"{case}/{path.name}", json_digest(data, REPORT_KEYS)
        else:
            yield f"{case}/{path.name}", page_digest(data) if path.name == "report.html" else digest(data)


def all_digests(scratch, skipped):
    """Yields (case/file, digest); adds the names of cases without their input to `skipped`."""
    for case, source, arguments in RUNS:
        if not source.exists():
            skipped.append(case)
            continue
        out = scratch / case
        call("run", source, "-o", out, *EVERY_RUN, *arguments, *methods(case, arguments))
        yield from folder_digests(case, out)
        yield f"{case}/status", json_digest(json.dumps(json.loads(call("status", out, "--json"))["finished"]))
        if case.startswith(("downtown", "avenue", "suburb")):
            yield f"{case}/eval", json_digest(call("eval", out, "--json", "-"))
    for case, source, arguments in TABLES:
        if not source.exists():
            skipped.append(case)
            continue
        out = scratch / f"{case}.csv"
        call("cluster", source, "--no-header", "-o", out, *arguments)
        yield case, digest(out.read_bytes())
    curve = scratch / "curve.svg"
    estimate = call("estimate-epsilon", SWEEP, "--progress", "none", "--out", scratch / "estimate", "--svg", curve, "--json", "-")
    yield "estimate/json", json_digest(estimate)
    yield "estimate/svg", digest(curve.read_bytes())
    synth = scratch / "synth"
    call("synth", "mixed", "-o", synth, "--length", "400m", "--pulse-rate", "60kHz", "--las")
    yield from folder_digests("synth-mixed", synth)
    out = scratch / "synth-run"
    call("run", *sorted(synth.glob("*.las")), "-o", out, *EVERY_RUN, "--trajectory", synth / "trajectory.csv")
    yield from folder_digests("synth-mixed-run", out)
    yield "synth-mixed-run/eval", json_digest(call("eval", out, "--json", "-"))


def main():
    skipped = []
    with tempfile.TemporaryDirectory(prefix="digest.") as scratch:
        found = dict(all_digests(pathlib.Path(scratch), skipped))
    lines = "".join(f"{value}  {name}\n" for name, value in found.items())
    if "--write" in sys.argv:
        EXPECTED.write_text(lines)
    elif "--check" not in sys.argv:
        print(lines, end="")
        return
    expected = dict(reversed(line.split("  ", 1)) for line in EXPECTED.read_text().splitlines())
    expected = {name: value for name, value in expected.items() if name.split("/")[0] not in skipped}
    if skipped:
        print(f"skipped, their input is not there: {', '.join(skipped)}")
    differing = sorted(name for name in expected.keys() | found.keys() if expected.get(name) != found.get(name))
    for name in differing:
        print(f"DIFFERS: {name}: {expected.get(name)} before, {found.get(name)} now")
    print(f"{len(found)} digests, {len(differing)} differ")
    sys.exit(1 if differing else 0)


if __name__ == "__main__":
    main()
