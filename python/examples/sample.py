"""From a file to objects and scores, on the sample that ships with chainage.

    python python/examples/sample.py [FILE]

The comments have what one would write between the cells of a notebook.
"""

import sys
import tempfile
from pathlib import Path

import chainage

file = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[2] / "tests/data/tree_road_sweep.laz")

# How large is the drive, and into how many tiles would it be divided? Nothing is written yet.
plan = chainage.plan(file, memory="1G")
print(f"{plan['points']:,} points, {len(plan['tiles'])} tile(s), {plan['axis']['length_m']:.0f} m of axis")

with tempfile.TemporaryDirectory() as folder:
    # The run. Progress comes as events; interrupted with Ctrl-C, the same call resumes.
    passes = []
    summary = chainage.run(
        file, folder, progress=lambda event: event["event"] == "pass-finished" and passes.append(event["pass"])
    )
    print(f"{summary['objects']} objects after the passes {', '.join(passes)}")

    # The table of objects: a (geo)pandas frame where that is installed.
    objects = chainage.objects(folder)
    rows = objects if isinstance(objects, list) else objects.to_dict("records")
    tallest = max(rows, key=lambda row: row["height_m"] or 0)
    print(f"tallest: object {tallest['id']} of class {tallest['class']}, {tallest['height_m']:.1f} m")

# The same on an array, without files. Here: how many points do two radii put into objects?
try:
    import laspy
except ImportError:
    print("laspy is not installed: the part on arrays is left out")
    sys.exit()

points = laspy.read(file)
ground = chainage.ground(points)
print(f"{ground.mean():.0%} of the points are ground")
above = points.xyz[~ground]
near, far = (chainage.cluster(above, max_gap_m=gap) for gap in (0.2, 0.6))
print(f"objects: {near.max()} with gaps up to 0.2 m, {far.max()} with gaps up to 0.6 m")

# How well does one agree with the other?
scores = chainage.evaluate(near, far)["overall"]
print(f"OA {scores['oa']:.3f}, PQ {scores['pq']:.3f}, ARI {scores['ari']:.3f}")
