#!/usr/bin/env python3
"""Peak memory per point of each pass over one tile that contains a whole scene. BYTES_PER_POINT of the passes must cover it.

    scripts/tile_memory.py PROGRAM FILE.las [METHOD...]

Anonymous resident memory (without mapped files) is sampled every millisecond while one thread works on one tile. The
pass is read from the log of the run. Figures are per point of the tile, including ground, and per point of objects. The
planning of tiles uses the former.
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import time


def anonymous_bytes(process):
    for line in pathlib.Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("RssAnon:"):
            return int(line.split()[1]) << 10
    return 0


def watch(program, scene, method, out):
    """Peak by pass, and the report of the run."""
    command = [program, "run", scene, "-o", out, "--method", method, "--threads", "1", "--progress", "none",
               "--set", "tiling.tile_length=1000000"]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    log, peaks, current, read = pathlib.Path(out) / ".chainage/events.jsonl", {}, "start", 0
    while running.poll() is None:
        try:
            size = log.stat().st_size
            if size > read:
                with log.open() as lines:
                    lines.seek(read)
                    for line in lines.readlines():
                        event = json.loads(line) if line.endswith("\n") else {}
                        if event.get("event") == "pass-started":
                            current = event["pass"]
                        elif event.get("event") == "pass-finished":
                            current = "between"
                    read = lines.tell()
        except (OSError, json.JSONDecodeError):
            pass
        try:
            peaks[current] = max(peaks.get(current, 0), anonymous_bytes(running.pid))
        except OSError:
            break
        time.sleep(0.001)
    if running.wait() != 0:
        sys.exit(f"{' '.join(map(str, command))} failed")
    return peaks, json.loads((pathlib.Path(out) / "report.json").read_text())["result"]


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    for method in sys.argv[3:] or ["euclidean", "dbscan", "density-peaks"]:
        with tempfile.TemporaryDirectory() as folder:
            peaks, result = watch(sys.argv[1], sys.argv[2], method, folder + "/out")
        points, objects = result["points"], result["counts"]["object"]
        print(f"{method}: {points} points, {objects} of objects, {result['tiles']} tile(s)")
        for name, peak in peaks.items():
            print(f"  {name:<8} {peak >> 20:>6} MiB {peak / points:>7.1f} bytes per point {peak / objects:>7.1f} per point of objects")


if __name__ == "__main__":
    main()
