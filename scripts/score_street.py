#!/usr/bin/env python3
"""Scores `street` on labelled scenes and on synthetic drives that no built-in model has learned from, for benches/results/street.md.

    scripts/score_street.py PROGRAM FOLDER [TAG] [--only GROUP,NAME,...] [--data FOLDER] [-- OPTIONS OF chainage run...]
    scripts/score_street.py --compare TAG TAG FOLDER [--only ...]
    scripts/score_street.py --beside TAG TAG... FOLDER [--only ...]

The first form makes the drives in FOLDER, once, runs PROGRAM on each, and keeps FOLDER/TAG/DRIVE.json, the evaluation (default TAG: now).
Evaluations that are there are not repeated, and a TAG is for one program and its options. Then it prints F1 by group, the sums of the classes, and a row for each drive.
The second form prints what changed from one TAG to the other: by group, by class, and each drive. The third form sets the first TAG beside
the others, evaluations of other methods (options after --): mean F1, and each drive and class in which another one is better. An object counts as found if a segment
has an IoU above 0.5 with it; false segments are those that match no object. A program takes seven minutes on two idle cores once the
drives are made; they take 14 GB. Labelled scenes that are missing are left out. `--only land` has drives on slopes, over bridges, in a
tunnel and at other speeds (Python with numpy, scipy and laspy).
"""

import argparse
import hashlib
import json
import pathlib
import subprocess
import sys

# One drive per line: name, preset, seed, options of chainage synth. Groups are those of street.md; `sweeps` are single sweeps. Rules were
# chosen by looking at all but `later` and `new`; one distance was chosen with `later`. `new` is only for a last look: do not choose anything with it.
DRIVES = """
profilers
suburb-901      suburb    901 --length 200m --pulse-rate 250kHz
suburb-909      suburb    909 --length 200m --pulse-rate 250kHz
downtown-911    downtown  911 --length 200m --pulse-rate 250kHz
avenue-921      avenue    921 --length 200m --pulse-rate 250kHz
avenue-922      avenue    922 --length 200m --pulse-rate 250kHz
parkway-931     parkway   931 --length 200m --pulse-rate 250kHz
parkway-932     parkway   932 --length 200m --pulse-rate 250kHz
highway-942     highway   942 --length 300m --pulse-rate 250kHz
lane-961        lane      961 --length 200m --pulse-rate 250kHz
lane-963        lane      963 --length 200m --pulse-rate 250kHz --heads 1
spinning
suburb-903      suburb    903 --scanner spinning-64-wide --sweeps 60 --drift 30mm
suburb-906      suburb    906 --scanner spinning-64-wide --sweeps 60 --drift 30mm
suburb-907      suburb    907 --scanner spinning-16 --length 150m
suburb-908      suburb    908 --scanner spinning-64 --length 150m
suburb-971      suburb    971 --scanner spinning-64 --length 150m
suburb-973      suburb    973 --scanner spinning-32 --length 150m
downtown-913    downtown  913 --scanner spinning-32 --sweeps 60 --drift 30mm
downtown-916    downtown  916 --scanner spinning-32 --sweeps 60 --drift 30mm
downtown-918    downtown  918 --scanner spinning-16 --length 150m
downtown-972    downtown  972 --scanner spinning-64 --length 150m
avenue-923      avenue    923 --scanner spinning-32 --length 150m
others
suburb-981      suburb    981 --scanner spinning-64 --length 150m
downtown-982    downtown  982 --scanner spinning-32 --length 150m
suburb-983      suburb    983 --length 200m --pulse-rate 250kHz
downtown-984    downtown  984 --length 200m --pulse-rate 250kHz
avenue-985      avenue    985 --length 200m --pulse-rate 250kHz
parkway-986     parkway   986 --length 200m --pulse-rate 250kHz
highway-987     highway   987 --length 300m --pulse-rate 250kHz
lane-988        lane      988 --length 200m --pulse-rate 250kHz
suburb-991      suburb    991 --scanner spinning-64 --length 150m
downtown-992    downtown  992 --scanner spinning-32 --length 150m
suburb-993      suburb    993 --length 200m --pulse-rate 250kHz
downtown-994    downtown  994 --length 200m --pulse-rate 250kHz
avenue-995      avenue    995 --length 200m --pulse-rate 250kHz
parkway-996     parkway   996 --length 200m --pulse-rate 250kHz
highway-997     highway   997 --length 300m --pulse-rate 250kHz
lane-998        lane      998 --length 200m --pulse-rate 250kHz
boulevards
boulevard-1001  boulevard 1001 --length 200m --pulse-rate 250kHz
boulevard-1002  boulevard 1002 --length 200m --pulse-rate 250kHz
boulevard-1003  boulevard 1003 --length 150m --scanner spinning-64
boulevard-1004  boulevard 1004 --length 200m --pulse-rate 200kHz --heads 1
promenades
promenade-1011  promenade 1011 --length 150m --pulse-rate 250kHz
promenade-1012  promenade 1012 --length 150m --pulse-rate 250kHz
promenade-1013  promenade 1013 --length 120m --scanner spinning-64
sweeps
suburb-1061     suburb    1061 --scanner spinning-64 --sweeps 1
downtown-1062   downtown  1062 --scanner spinning-64-wide --sweeps 1
avenue-1063     avenue    1063 --scanner spinning-64 --sweeps 1
parkway-1064    parkway   1064 --scanner spinning-64 --sweeps 1
lane-1065       lane      1065 --scanner spinning-64 --sweeps 1
boulevard-1066  boulevard 1066 --scanner spinning-64-wide --sweeps 1
suburb-1067     suburb    1067 --scanner spinning-32 --sweeps 1
downtown-1068   downtown  1068 --scanner spinning-32 --sweeps 1
avenue-1069     avenue    1069 --scanner spinning-64-wide --sweeps 1
parkway-1070    parkway   1070 --scanner spinning-32 --sweeps 1
lane-1071       lane      1071 --scanner spinning-64-wide --sweeps 1
suburb-1072     suburb    1072 --scanner spinning-16 --sweeps 1
later
suburb-1021     suburb    1021 --scanner spinning-64 --length 150m
downtown-1022   downtown  1022 --scanner spinning-32 --length 150m
suburb-1023     suburb    1023 --length 200m --pulse-rate 250kHz
downtown-1024   downtown  1024 --length 200m --pulse-rate 250kHz
avenue-1025     avenue    1025 --length 200m --pulse-rate 250kHz
parkway-1026    parkway   1026 --length 200m --pulse-rate 250kHz
highway-1027    highway   1027 --length 300m --pulse-rate 250kHz
lane-1028       lane      1028 --length 200m --pulse-rate 250kHz
new
suburb-1041     suburb    1041 --scanner spinning-64 --length 150m
downtown-1042   downtown  1042 --scanner spinning-32 --length 150m
suburb-1043     suburb    1043 --length 200m --pulse-rate 250kHz
downtown-1044   downtown  1044 --length 200m --pulse-rate 250kHz
avenue-1045     avenue    1045 --length 200m --pulse-rate 250kHz
parkway-1046    parkway   1046 --length 200m --pulse-rate 250kHz
highway-1047    highway   1047 --length 300m --pulse-rate 250kHz
lane-1048       lane      1048 --length 200m --pulse-rate 250kHz
boulevard-1049  boulevard 1049 --length 200m --pulse-rate 250kHz
promenade-1050  promenade 1050 --length 150m --pulse-rate 250kHz
"""
# Other land and other speeds, from drives of above: name, drive, and the change. They are not among the 81: name the group.
LAND = """
bridges-952     highway 952 --length 800m --pulse-rate 150kHz
speed-20        suburb  901 --length 250m --pulse-rate 250kHz --speed 20-20
speed-40        suburb  901 --length 250m --pulse-rate 250kHz --speed 40-40
speed-100       suburb  901 --length 250m --pulse-rate 250kHz --speed 100-100
grade-921       avenue-921   = grade 15 %
hillside-901    suburb-901   = hillside 30 %
embankment-909  suburb-909   = embankment
cutting-942     highway-942  = cutting
tunnel-911      downtown-911 = tunnel
"""
SCENES = {"simulated": "sim/*.laz", "real": "real-labelled/*.laz"}


def drives(data, only):
    """(group, name, input or None, how it is made) of each drive: arguments of chainage synth, or another drive and a change of it."""
    found = []
    for group, pattern in SCENES.items():
        found += [(group, path.stem, path, None) for path in sorted(data.glob(pattern))]
    for line in DRIVES.strip().splitlines():
        words = line.split()
        if len(words) == 1:
            group = words[0]
        else:
            name, preset, seed, *options = words
            found.append((group, name, None, [preset, "--seed", seed, *options]))
    for line in LAND.strip().splitlines():
        name, *words = line.split()
        preset, seed, *options = words
        how = (preset, " ".join(options)) if seed == "=" else [preset, "--seed", seed, *options]
        found.append(("land", name, None, how))
    return [one for one in found if (one[0] in only or one[1] in only if only else one[0] != "land")]


def call(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stderr}")


def make(program, folder, name, how):
    """Makes a drive, first under another name: one that was interrupted is made again."""
    drive, unfinished = (folder / "drives" / (name + end) for end in ("", ".unfinished"))
    call("rm", "-rf", unfinished)
    unfinished.parent.mkdir(exist_ok=True)
    if isinstance(how, tuple):
        from land import changed  # needs numpy, scipy and laspy

        source, change = how
        if not (folder / "drives" / source).exists():
            make(program, folder, source, next(one[3] for one in drives(folder, {source})))
        changed(folder / "drives" / source, unfinished, change)
    else:
        call(program, "synth", *how, "-o", unfinished, "--las")
    unfinished.rename(drive)


def score(program, folder, tag, chosen, options):
    (folder / tag).mkdir(parents=True, exist_ok=True)
    # Evaluations that are kept are those of one program with one set of options.
    is_of = f"{hashlib.sha256(program.read_bytes()).hexdigest()} {' '.join(options)}".strip() + "\n"
    of = folder / tag / "program"
    if of.exists() and of.read_text() != is_of:
        sys.exit(f"{folder / tag} has evaluations of another program or of other options: choose another TAG, or remove it")
    of.write_text(is_of)
    for _, name, scan, how in chosen:
        kept = folder / tag / f"{name}.json"
        if kept.exists():
            continue
        if scan is None:
            scan = folder / "drives" / name
            if not scan.exists():
                make(program, folder, name, how)
        out = folder / tag / f"{name}.out"
        call("rm", "-rf", out)
        call(program, "run", scan, "-o", out, "-q", "--no-report", "--outputs", "points", *options)
        call(program, "eval", out, f"--json={folder / tag / 'unfinished'}")
        (folder / tag / "unfinished").rename(kept)
        call("rm", "-rf", out)


class Counts:
    """Found, false and lost objects by class, and how many of those found have the right class."""

    def __init__(self):
        self.drives, self.f1, self.classes, self.right, self.matched = 0, 0.0, {}, 0, 0

    def add(self, evaluation):
        self.drives += 1
        self.f1 += evaluation["overall"]["f1"]
        for one in [{**evaluation["overall"], "name": "all"}, *evaluation["classes"]]:
            sums = self.classes.setdefault(one["name"], [0, 0, 0])
            for at, key in enumerate(("true_positives", "false_positives", "false_negatives")):
                sums[at] += one[key]
        # Only `street` names objects.
        named = evaluation.get("object_classes", {}).get("overall", {"class_right": 0, "matched": 0})
        self.right += named["class_right"]
        self.matched += named["matched"]


def f1(sums):
    found, wrong, lost = sums
    return 2 * found / max(2 * found + wrong + lost, 1)


def load(folder, tag, name):
    path = folder / tag / f"{name}.json"
    if not path.is_file():
        sys.exit(f"{path} is not there: score {name} with the tag {tag} first, or choose other drives with --only")
    return json.loads(path.read_text())


def show(folder, tag, chosen):
    groups, whole = {}, Counts()
    print("| drive | F1 all | found | false | lost | class right |\n|---|---:|---:|---:|---:|---:|")
    for group, name, *_ in chosen:
        of_drive, evaluation = Counts(), load(folder, tag, name)
        for counts in (of_drive, groups.setdefault(group, Counts()), whole):
            counts.add(evaluation)
        found, wrong, lost = of_drive.classes["all"]
        right = of_drive.right / max(of_drive.matched, 1)
        print(f"| {name} | {of_drive.f1:.3f} | {found} | {wrong} | {lost} | {right:.3f} |")
    print("\n| group | drives | mean F1 |\n|---|---:|---:|")
    for group, counts in groups.items():
        print(f"| {group} | {counts.drives} | {counts.f1 / counts.drives:.4f} |")
    print(f"\nClass right: {whole.right / max(whole.matched, 1):.3f} of {whole.matched:,}.")
    print("\n| | found | false | lost | F1 |\n|---|---:|---:|---:|---:|")
    for name, sums in whole.classes.items():
        print(f"| {name} | {sums[0]:,} | {sums[1]:,} | {sums[2]:,} | {f1(sums):.4f} |")


def compare(folder, tags, chosen):
    groups, whole = {}, [Counts(), Counts()]
    for group, name, *_ in chosen:
        pair = groups.setdefault(group, [Counts(), Counts()])
        of_drive = []
        for side, tag in enumerate(tags):
            evaluation = load(folder, tag, name)
            of_drive.append(evaluation["overall"]["f1"])
            pair[side].add(evaluation)
            whole[side].add(evaluation)
        if of_drive[0] != of_drive[1]:
            print(f"{name:16} {of_drive[0]:.4f} {of_drive[1]:.4f} {of_drive[1] - of_drive[0]:+.4f}")
    print(f"\n{'group':16} {tags[0]:>8} {tags[1]:>8}")
    for group, pair in groups.items():
        print(f"{group:16} " + " ".join(f"{counts.f1 / counts.drives:8.4f}" for counts in pair))
    print(f"{'class right':16} " + " ".join(f"{counts.right / max(counts.matched, 1):8.4f}" for counts in whole))
    for name in dict.fromkeys([*whole[0].classes, *whole[1].classes]):
        sums = [counts.classes.get(name, [0, 0, 0]) for counts in whole]
        print(f"{name:16} " + "   ".join(f"{f1(one):.4f} {one[0]}/{one[1]}/{one[2]}" for one in sums))


def beside(folder, tags, chosen):
    first, *others = tags
    sums, better, drives_of = {}, {}, {}
    for _, name, *_ in chosen:
        rows = {}
        for tag in tags:
            evaluation = load(folder, tag, name)
            for one in [{**evaluation["overall"], "name": "all"}, *evaluation["classes"]]:
                counts = [one[key] for key in ("true_positives", "false_positives", "false_negatives")]
                if counts[0] + counts[2]:
                    rows.setdefault(one["name"], {})[tag] = (f1(counts), counts)
        for kind, of in rows.items():
            drives_of[kind] = drives_of.get(kind, 0) + 1
            for tag in tags:
                sums[kind, tag] = sums.get((kind, tag), 0.0) + of[tag][0]
            best = max(others, key=lambda tag: of[tag][0])
            if of[best][0] > of[first][0] + 1e-9:
                better.setdefault(kind, []).append((name, best, of[best], of[first]))
    print(f"| mean F1 | drives | {' | '.join(tags)} | drives with a better one |")
    print("|---|---:" + "|---:" * (len(tags) + 1) + "|")
    for kind, count in drives_of.items():
        means = " | ".join(f"{sums[kind, tag] / count:.3f}" for tag in tags)
        print(f"| {kind} | {count} | {means} | {len(better.get(kind, []))} |")
    print(f"\n| class | drive | best other | F1 (found/false/lost) | {first} |\n|---|---|---|---:|---:|")
    written = lambda one: f"{one[0]:.3f} ({'/'.join(map(str, one[1]))})"
    for kind, found in better.items():
        for name, best, theirs, ours in found:
            print(f"| {kind} | {name} | {best} | {written(theirs)} | {written(ours)} |")


def main():
    own, options = sys.argv[1:], []
    if "--" in own:
        options = own[own.index("--") + 1:]
        own = own[:own.index("--")]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="+")
    parser.add_argument("--compare", action="store_true")
    parser.add_argument("--beside", action="store_true")
    parser.add_argument("--only", default="")
    parser.add_argument("--data", type=pathlib.Path, default=pathlib.Path(__file__).parents[2] / "shared/data")
    given = parser.parse_args(own)
    chosen = drives(given.data, set(filter(None, given.only.split(","))))
    if given.compare:
        *tags, folder = given.words
        compare(pathlib.Path(folder), tags, chosen)
    elif given.beside:
        *tags, folder = given.words
        beside(pathlib.Path(folder), tags, chosen)
    else:
        program, folder, tag = (*given.words, "now")[:3]
        folder = pathlib.Path(folder)
        score(pathlib.Path(program).resolve(), folder, tag, chosen, options)
        show(folder, tag, chosen)


if __name__ == "__main__":
    main()
