#!/usr/bin/env python3
"""Compares two builds of the program in pairs of runs: wall time, processor time and peak memory, as ratios.

    scripts/pairs.py BEFORE AFTER FILE... [--pairs 7] [-- OPTIONS OF run...]

BEFORE and AFTER are programs. Each pair runs both, in turn first, so that a busy minute falls on both. Prints the medians of the
ratios after / before, the range of the ratios of wall time, and the medians of both programs.
"""
import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time


def measured(program, files, options):
    """Wall seconds, processor seconds and peak MiB of a run."""
    with tempfile.TemporaryDirectory(prefix="pairs.") as folder:
        command = [program, "run", *files, "-o", os.path.join(folder, "out"), *options]
        began = time.perf_counter()
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - began
        if status:
            sys.exit(f"{' '.join(command)} failed")
        return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main():
    words = sys.argv[1:]
    options = words[words.index("--") + 1 :] if "--" in words else []
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("files", nargs="+")
    parser.add_argument("--pairs", type=int, default=7)
    arguments = parser.parse_args(words[: words.index("--")] if "--" in words else words)
    programs = [shutil.which(arguments.before), shutil.which(arguments.after)]
    for program in programs:
        measured(program, arguments.files, options)  # the first run reads the files into memory
    figures = ([], [])
    for pair in range(arguments.pairs):
        for which in (0, 1) if pair % 2 == 0 else (1, 0):
            figures[which].append(measured(programs[which], arguments.files, options))
    for at, name in enumerate(("wall, s", "processor, s", "peak, MiB")):
        before, after = ([row[at] for row in rows] for rows in figures)
        ratios = [b / a for a, b in zip(before, after)]
        print(
            f"{name:12} after / before {statistics.median(ratios):.3f} ({min(ratios):.2f} to {max(ratios):.2f}), "
            f"medians {statistics.median(before):.2f} and {statistics.median(after):.2f}"
        )


if __name__ == "__main__":
    main()
