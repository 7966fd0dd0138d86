"""Independent implementation of the metrics, for comparison with `chainage eval --json`.

    python3 tests/oracle/eval_oracle.py PREDICTION REFERENCE RESULT.json

Straight from the definitions: dense numpy arrays, Python sets, no shared code or shortcuts with the program. For
references without points of objects in the classes of ground and noise. Needs numpy and laspy. Prints every figure that
differs; exit code 1 when one does.
"""

import json
import sys
from collections import Counter, defaultdict

import laspy
import numpy as np

MIN_POINTS = 30


def load(prediction, reference):
    pred, ref = laspy.read(prediction), laspy.read(reference)
    seg = np.asarray(pred.cluster_id).astype(np.int64)
    cls = np.asarray(pred.classification).astype(np.int64)
    return seg, cls, np.asarray(ref.gt_instance).astype(np.int64), np.asarray(ref.gt_class).astype(np.int64)


class Scene:
    def __init__(self, seg, obj, cls):
        self.obj_points = defaultdict(list)
        for i in np.flatnonzero(obj > 0):
            self.obj_points[int(obj[i])].append(i)
        self.obj_points = {o: np.array(p) for o, p in self.obj_points.items() if len(p) >= MIN_POINTS}
        self.size_o = {o: len(p) for o, p in self.obj_points.items()}
        # The most frequent class, the smallest code of several.
        counts = {o: Counter(cls[p].tolist()) for o, p in self.obj_points.items()}
        self.cls = {o: min(count, key=lambda c: (-count[c], c)) for o, count in counts.items()}
        self.size_s = {int(s): int(n) for s, n in zip(*np.unique(seg[seg > 0], return_counts=True))}
        self.n = {}
        for o, p in self.obj_points.items():
            for s, n in zip(*np.unique(seg[p], return_counts=True)):
                if s > 0:
                    self.n[o, int(s)] = int(n)
        self.of_o, self.of_s = defaultdict(dict), defaultdict(dict)
        for (o, s), n in self.n.items():
            self.of_o[o][s] = n
            self.of_s[s][o] = n

    def main(self, o):
        return min(self.of_o[o], key=lambda s: (-self.of_o[o][s], s)) if self.of_o[o] else None

    def segment_class(self, s):
        return self.cls[min(self.of_s[s], key=lambda o: (-self.of_s[s][o], o))] if self.of_s[s] else None


def under_over(sc):
    under, over = set(), set()
    for o in sc.size_o:
        s = sc.main(o)
        if s is None:
            continue
        if any(o2 != o and (sc.main(o2) == s or n / sc.size_o[o2] >= 0.2) for o2, n in sc.of_s[s].items()):
            under.add(o)
        if any(s2 != s and n / sc.size_o[o] >= 0.1 and n >= 30 for s2, n in sc.of_o[o].items()):
            over.add(o)
    return under, over


def hoover(sc, t):
    mutual = {(o, s) for (o, s), n in sc.n.items() if n >= t * sc.size_o[o] and n >= t * sc.size_s[s]}
    out, used = {}, set()
    for o in sc.size_o:
        correct = [s for (o2, s) in mutual if o2 == o]
        inside = [s for s, n in sc.of_o[o].items() if n >= t * sc.size_s[s]]
        covering = [
            s for s, n in sc.of_o[o].items()
            if n >= t * sc.size_o[o] and sum(m >= t * sc.size_o[o2] for o2, m in sc.of_s[s].items()) >= 2
        ]
        if len(correct) == 1 and sum(s == correct[0] for _, s in mutual) == 1:
            out[o] = "correct"
            used.add(correct[0])
        elif len(inside) >= 2 and sum(sc.of_o[o][s] for s in inside) >= t * sc.size_o[o]:
            out[o] = "over"
            used.update(inside)
        elif covering:
            out[o] = "under"
            used.add(covering[0])
        else:
            out[o] = "missed"
    return out, set(sc.size_s) - used


def adjusted_rand_index(one, other):
    """Hubert and Arabie 1985, with pairs counted in integers."""
    pairs = lambda values: sum(n * (n - 1) // 2 for n in Counter(values).values())
    both, rows, columns = pairs(zip(one.tolist(), other.tolist())), pairs(one.tolist()), pairs(other.tolist())
    if both == rows == columns:
        return 1.0
    every = len(one) * (len(one) - 1) // 2
    return (both * every - rows * columns) / ((rows + columns) / 2 * every - rows * columns)


def figures(sc, seg, obj, keep, under, over, hoovers):
    objects = [o for o in sorted(sc.size_o) if keep is None or sc.cls[o] == keep]
    iou = lambda o, s: sc.n[o, s] / (sc.size_o[o] + sc.size_s[s] - sc.n[o, s])
    counts = lambda s: sc.size_s[s] >= MIN_POINTS and sum(sc.of_s[s].values()) >= sc.size_s[s] / 2
    matches = {(o, s): iou(o, s) for o in objects for s in sc.of_o[o] if sc.size_s[s] >= MIN_POINTS and iou(o, s) > 0.5}
    all_matched = {s for (o, s) in sc.n if iou(o, s) > 0.5}
    mine = [s for s in sc.size_s if keep is None or sc.segment_class(s) == keep]
    tp, fp = len(matches), sum(counts(s) and s not in all_matched for s in mine)
    fn, k = len(objects) - tp, len(objects)
    denominator = tp + fp / 2 + fn / 2
    points = np.concatenate([sc.obj_points[o] for o in objects])
    p, r = tp / (tp + fp) if tp + fp else None, tp / k
    return {
        "objects": k,
        "usr": sum(o in under for o in objects) / k,
        "osr": sum(o in over for o in objects) / k,
        "oa": 1 - (sum(o in under for o in objects) / k + sum(o in over for o in objects) / k) / 2,
        "f1": 2 * p * r / (p + r) if p else 0.0,
        "precision": p,
        "recall": r,
        "pq": sum(matches.values()) / denominator,
        "sq": sum(matches.values()) / tp if tp else 0.0,
        "rq": tp / denominator,
        "mean_best_iou": np.mean([max([iou(o, s) for s in sc.of_o[o]], default=0.0) for o in objects]),
        "ari": adjusted_rand_index(obj[points], seg[points]),
        "hoover": [
            [sum(out[o] == w for o in objects) for w in ("correct", "over", "under", "missed")]
            + [sum(keep is None or sc.segment_class(s) == keep for s in noise)]
            for out, noise in hoovers
        ],
    }


def binary(reference, predicted):
    both = int((reference & predicted).sum())
    return {
        "precision": both / predicted.sum() if predicted.any() else None,
        "recall": both / reference.sum() if reference.any() else None,
        "iou": both / (reference | predicted).sum() if (reference | predicted).any() else None,
    }


def differences(path, mine, theirs):
    for key, value in mine.items():
        if key == "hoover":
            theirs_counts = [[h[w] for w in ("correct", "over", "under", "missed", "noise")] for h in theirs[key]]
            if value != theirs_counts:
                yield f"{path}.{key}: {value} here, {theirs_counts} there"
        elif (value is None) != (theirs[key] is None) or (value is not None and abs(value - theirs[key]) > 1.1e-6):
            yield f"{path}.{key}: {value} here, {theirs[key]} there"


def main():
    seg, pred_class, obj, cls = load(sys.argv[1], sys.argv[2])
    with open(sys.argv[3], encoding="utf-8") as file:
        result = json.load(file)
    sc = Scene(seg, obj, cls)
    under, over = under_over(sc)
    hoovers = [hoover(sc, t) for t in (0.8, 0.5)]
    found = list(differences("overall", figures(sc, seg, obj, None, under, over, hoovers), result["overall"]))
    for row in result["classes"]:
        found += differences(row["name"], figures(sc, seg, obj, row["class"], under, over, hoovers), row)
    if sorted(row["class"] for row in result["classes"]) != sorted(set(sc.cls.values())):
        found.append("the classes differ")
    found += differences("ground", binary(cls == 1, pred_class == 2), result["ground"])
    found += differences("noise", binary(cls == 0, np.isin(pred_class, (7, 18))), result["noise"])
    print("\n".join(found) or f"all figures agree ({len(result['classes'])} classes, {len(sc.size_o)} objects)")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
