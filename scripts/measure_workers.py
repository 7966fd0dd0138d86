#!/usr/bin/env python3
"""Measures worker processes against one process, and what the start of a worker costs.

    scripts/measure_workers.py [--points 6M] [--repeat 3] [--method euclidean] [--start 200M]

A synthetic highway is processed by `run` with 1 and 2 threads, and by 1, 2 and 4 processes `work --threads 1`, each with a quarter of
its share of a pass per call, with `reduce` behind each pass. Prints medians of wall and processor time, and whether the labelled
copies are the same bytes. With --start, the start of `work` is measured on a drive with so many points: a call for a unit that is
done already. Needs a release build (or CHAINAGE), and 40 bytes of disk per point.
"""
import argparse
import concurrent.futures
import hashlib
import json
import os
import pathlib
import resource
import shutil
import statistics
import subprocess
import tempfile
import time

PROGRAM = os.environ.get("CHAINAGE", str(pathlib.Path(__file__).parent.parent / "target/release/chainage"))


def call(*words):
    return subprocess.run([PROGRAM, *map(str, words)], check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout


def measured(action):
    """Wall and processor seconds of an action and its processes, and what it returns."""
    spent = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    began, before = time.perf_counter(), spent()
    result = action()
    return time.perf_counter() - began, spent() - before, result


def by_workers(files, out, options, workers):
    """Processes a drive with so many worker processes. Returns the calls of `work` and the wall time of the reductions."""
    due = json.loads(call("plan", *files, "-o", out, "--units", "--json", *options))
    calls, reductions = 0, 0.0
    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        while due["pass"]:
            units = due["units"]
            size = max(1, -(-len(units) // (4 * workers)))
            batches = [units[at : at + size] for at in range(0, len(units), size)]
            work = lambda batch: call("work", out, "--pass", due["pass"], "--units", ",".join(map(str, batch)), "--threads", 1)
            list(pool.map(work, batches))
            calls += len(batches)
            began = time.perf_counter()
            due = json.loads(call("reduce", out, "--after", due["pass"], "--json"))
            reductions += time.perf_counter() - began
    return calls, reductions


def digest(out):
    files = sorted(path for path in out.iterdir() if path.suffix in (".las", ".csv"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


def compare(folder, arguments):
    call("synth", "highway", "--points", arguments.points, "--las", "-o", folder / "drive")
    files, out = [folder / "drive"], folder / "out"
    options = ["--method", arguments.method, "--tile-length", "20"]
    cases = {f"`run --threads {n}`": lambda n=n: call("run", *files, "-o", out, "--threads", n, *options) for n in (1, 2)}
    cases |= {f"{n} workers": lambda n=n: by_workers(files, out, options, n) for n in (1, 2, 4)}
    rows, digests = {name: [] for name in cases}, set()
    for _ in range(arguments.repeat):
        for name, action in cases.items():  # in turn, so that a busy minute falls on all
            shutil.rmtree(out, ignore_errors=True)
            rows[name].append(measured(action))
            digests.add(digest(out))
    print("| | wall, s | processor, s | calls of `work` | all reductions, wall, s |\n|---|---|---|---|---|")
    for name, row in rows.items():
        wall, processor = (statistics.median(one[at] for one in row) for at in (0, 1))
        shared = [one[2] for one in row if isinstance(one[2], tuple)]
        calls = f"{shared[0][0]} | {statistics.median(one[1] for one in shared):.1f}" if shared else "|"
        print(f"| {name} | {wall:.1f} | {processor:.2f} | {calls} |")
    print("same bytes" if len(digests) == 1 else "THE BYTES DIFFER")


def start(folder, arguments):
    call("synth", "highway", "--points", arguments.start, "--las", "-o", folder / "long")
    out = folder / "long-out"
    options = ["--method", arguments.method]
    due = json.loads(call("plan", folder / "long", "-o", out, "--units", "--json", *options))
    work = lambda: call("work", out, "--pass", due["pass"], "--units", due["units"][0], "--threads", 1)
    work()
    times = [measured(work) for _ in range(5)]
    walls = sorted(time[0] for time in times)
    processors = sorted(time[1] for time in times)
    print(f"start of work on {arguments.start} points, {len(due['units'])} units in {due['pass']}, five calls: "
          f"wall {walls[0]:.2f} to {walls[-1]:.2f} s, processor {processors[0]:.2f} to {processors[-1]:.2f} s")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", default="6M")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--method", default="euclidean")
    parser.add_argument("--start")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="workers.") as folder:
        compare(pathlib.Path(folder), arguments)
        if arguments.start:
            start(pathlib.Path(folder), arguments)


if __name__ == "__main__":
    main()
