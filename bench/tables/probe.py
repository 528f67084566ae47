"""Tables of what goes beyond a static order, and of orders inside Embree."""

import csv
import math
import os
import statistics

from tables.paper import *
from tables.records import *

EMBREE_ORDER = "zen3-2026-11-26-embree-order.csv"


def embree_order():
    """Speed of the orders inside Embree over its own: scenes are means of their seeds."""
    rows, lines = record_of_embree(), []
    for call in ("rtcOccluded1", "rtcOccluded8"):
        for rays, kind in (("shadow", "shadow"), ("ao", "ambient occlusion"), ("sun", "sun")):
            for order in ("random", "sato", "sort+", "joint"):
                speeds, counts, low = [], [], []
                for scene in unique(row["scene"] for row in rows):
                    own = [r for r in rows if (r["scene"], r["rays"], r["call"]) == (scene, rays, call)]
                    found = [r for r in own if r["order"] == order]
                    if not found:
                        continue
                    speeds.append(mean(float(r["speed"]) for r in found))
                    low += [float(r["speed"]) for r in found]
                    base = {r["seed"]: float(r["node_tests"]) for r in own if r["order"] == "own"}
                    counts.append(mean(base[r["seed"]] / float(r["node_tests"]) for r in found))
                value, middle = with_interval(speeds)
                lines.append([f"`{call}`", kind, f"`{order}`", f"{mean(counts):.2f}", value, middle, f"{min(low):.2f} to {max(low):.2f}"])
    return table(["call", "rays", "order", "fewer node tests", "speedup over Embree's own order", "median", "scenes and seeds"], lines)


def embree_order_scenes():
    """Node tests and speed of `joint` over Embree's own order, scene by scene, means of the seeds."""
    rows, lines = record_of_embree(), []
    for scene in unique(row["scene"] for row in rows):
        cells = []
        for rays in ("shadow", "ao", "sun"):
            own, joint = (
                [r for r in rows if (r["scene"], r["rays"], r["call"], r["order"]) == (scene, rays, "rtcOccluded1", order)]
                for order in ("own", "joint")
            )
            if not joint:
                cells += [""] * 3
                continue
            cells.append(f"{100 * float(own[0]['occluded']):.0f} %")
            cells.append(f"{mean(float(r['node_tests']) for r in own):.2f} to {mean(float(r['node_tests']) for r in joint):.2f}")
            speeds = [float(r["speed"]) for r in joint]
            cells.append(f"{statistics.median(speeds):.2f} ({min(speeds):.2f} to {max(speeds):.2f})")
        lines.append([scene, *cells])
    head = ["scene"]
    for kind in ("shadow", "ambient occlusion", "sun"):
        head += [f"{kind}: occluded", "node tests", "speedup"]
    return table(head, lines)


def record_of_embree():
    with open(os.path.join(ROOT, "bench/record", EMBREE_ORDER), newline="") as file:
        return list(csv.DictReader(file))


def probe_rows(part, rays=None, tree=None):
    rows = [row for row in record(BEYOND) if row["part"] == part]
    return [r for r in rows if (rays or r["rays"]) == r["rays"] and (tree or r["tree"]) == r["tree"]]


PROBED = [("binned-sah", "area"), ("reinsertion", "learned")]
RAYS = [("shadow", "shadow"), ("ao", "ambient occlusion")]


def probe_gains(part, base, techniques, names=None, times=True, gap=False):
    """Gains over a technique on the same tree, geometric means of the scenes, and the worst rate of a scene."""
    lines = []
    for tree, collapse in PROBED:
        for rays, kind in RAYS:
            rows = {(r["scene"], r["technique"]): r for r in probe_rows(part, rays, tree)}
            scenes = unique(scene for scene, _ in rows)
            for technique in techniques:
                if not all((scene, technique) in rows for scene in scenes):
                    continue
                ratio = lambda key, up: [
                    (number(rows[s, base], key) / number(rows[s, technique], key)) ** (1 if up else -1) for s in scenes
                ]
                cells = [f"{mean(ratio('node_tests', True)):.2f}", f"{mean(ratio('cost', True)):.2f}"]
                if gap:
                    closed = [
                        (number(rows[s, base], "node_tests") - number(rows[s, technique], "node_tests"))
                        / (number(rows[s, base], "node_tests") - number(rows[s, base], "oracle"))
                        for s in scenes
                        # Where there is a gap: rays of scans need one node test each on a tree that learned.
                        if number(rows[s, base], "node_tests") > number(rows[s, base], "oracle")
                    ]
                    cells.append(f"{100 * sum(closed) / len(closed):.0f} %")
                if times:
                    for key in ("batch_speed", "single_speed"):
                        found = ratio(key, False)
                        cells.append(f"{mean(found):.2f} ({min(found):.2f} to {max(found):.2f})")
                lines.append([f"`{tree}`, `{collapse}`", kind, (names or {}).get(technique, f"`{technique}`"), *cells])
    head = ["tree", "rays", "technique", "node tests", "cost"] + (["gap closed"] if gap else [])
    return table(head + (["rate in batches", "rate ray by ray"] if times else []), lines)


def probe_ways():
    orders = ["ftob", "far", "sort+", "pairs", "joint", "two-way", "octants", "sort+, ways", "joint, ways"]
    return probe_gains("ways", "simple", orders, gap=True)


def probe_cost(order, rays):
    """Times less cost than `simple` on the trees of the paper, held-out rays."""
    rows = {(r["scene"], r["technique"]): r for r in probe_rows("ways", rays, "binned-sah")}
    scenes = unique(scene for scene, _ in rows)
    return mean(number(rows[s, "simple"], "cost") / number(rows[s, order], "cost") for s in scenes)


def beats():
    """The orders that cost less than the paper's best, and what a rule gains that learns nothing."""
    names = {
        "sort+": "`sort+`, the paper's best",
        "joint": "`joint`: least measured cost, static",
        "far": "`far`: farthest exit first, nothing learned",
        "octants": "`octants`: eight learned orders",
        "joint, ways": "`joint` with a learned rule for each node",
    }
    lines = [[name] + [f"{probe_cost(order, rays):.2f}" for rays, _ in RAYS] for order, name in names.items()]
    return table(["order", "shadow rays", "ambient occlusion"], lines)


MODELS = ["independent", "exclusive", "overlapping", "paired"]


def correlation(points):
    n = len(points)
    x, y = sum(p[0] for p in points) / n, sum(p[1] for p in points) / n
    across = sum((a - x) * (b - y) for a, b in points)
    return across / math.sqrt(sum((a - x) ** 2 for a, _ in points) * sum((b - y) ** 2 for _, b in points))


def probe_models():
    """Predicted over measured cost, and how well each model ranks the orders of a tree."""
    lines = []
    for tree, collapse in PROBED:
        for rays, kind in RAYS:
            rows = probe_rows("model", rays, tree)
            for model in MODELS:
                ratios = [number(r, model) / number(r, "cost") for r in rows]
                ranks = []
                for scene in unique(r["scene"] for r in rows):
                    own = [(number(r, model), number(r, "cost")) for r in rows if r["scene"] == scene]
                    ranks.append(correlation(own))
                error = sum(abs(ratio - 1) for ratio in ratios) / len(ratios)
                lines.append(
                    [
                        f"`{tree}`, `{collapse}`",
                        kind,
                        model,
                        f"{mean(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})",
                        f"{100 * error:.0f} %",
                        f"{sum(ranks) / len(ranks):.2f}",
                    ]
                )
    return table(["tree", "rays", "model", "predicted / measured", "mean error", "correlation in a scene"], lines)


def probe_moving():
    lines = []
    rows = probe_rows("moving")
    for scene in unique(r["scene"] for r in rows):
        own = [r for r in rows if r["scene"] == scene and float(r["test_rays"]) > 0 and float(r["node_tests"]) > 0]
        frames = len({r["frame"] for r in own})
        for technique in unique(r["technique"] for r in own):
            found = [r for r in own if r["technique"] == technique]
            average = lambda key: sum(number(r, key) for r in found) / len(found)
            learning = [number(r, "learn_ms") for r in found if number(r, "learn_ms")]
            speed = [number(r, "batch_speed") for r in found if number(r, "batch_speed")]
            lines.append(
                [
                    f"{scene}, {frames} frames",
                    technique,
                    f"{average('node_tests'):.2f}",
                    f"{average('prim_tests'):.2f}",
                    f"{average('cost'):.2f}",
                    f"{mean(speed):.2f}" if speed else "",
                    f"{sum(learning) / len(learning):.0f}" if learning else "",
                ]
            )
    return table(["scene", "tree", "node tests", "primitive tests", "cost", "rate", "learning, ms a frame"], lines)


SPLITS = "zen4-2026-11-24-splits.csv"
RATES = ("batch_speed", "single_speed")


def spread(values):
    """Geometric mean, and the worst and the best scene."""
    return f"{mean(values):.2f} ({min(values):.2f} to {max(values):.2f})"


def splits_rows(rays):
    """Rows by scene and tree. Counts are equal in all runs, rates are medians of the runs."""
    groups = {}
    for row in record(SPLITS):
        if row["rays"] == rays:
            groups.setdefault((row["scene"], row["tree"]), []).append(row)
    found = {}
    for key, runs in groups.items():
        assert len({row["cost"] for row in runs}) == 1, key
        rates = {rate: statistics.median(number(row, rate) for row in runs) for rate in RATES}
        found[key] = {**runs[0], **rates}
    return found


def probe_splits():
    """Spatial splits beside the other builders: gains over `reinsertion` in occlusion queries."""
    lines = []
    for rays, kind in RAYS:
        rows = splits_rows(rays)
        for tree in ("binned-sah", "sbvh"):
            found = [row for row in rows.values() if row["tree"] == tree]
            base = lambda row, key: number(rows[row["scene"], "reinsertion"], key)
            cells = [spread([base(row, key) / number(row, key) for row in found]) for key in ("node_tests", "cost")]
            cells += [spread([number(row, rate) for row in found]) for rate in RATES]
            cells.append(spread([number(row, "bytes") / base(row, "bytes") for row in found]))
            lines.append([f"`{tree}`", kind, *cells])
    head = ["builder", "rays", "times fewer node tests", "times less cost", "rate in batches", "rate ray by ray", "bytes"]
    return table(head, lines)


def ways_short():
    """Orders that look at the ray, on the trees of the paper."""
    lines = []
    for order in ("far", "sort+", "pairs", "joint", "two-way", "octants", "joint, ways"):
        cells = []
        for rays, _ in RAYS:
            rows = {(r["scene"], r["technique"]): r for r in probe_rows("ways", rays, "binned-sah")}
            scenes = unique(scene for scene, _ in rows)
            ratio = lambda key: mean(number(rows[s, "simple"], key) / number(rows[s, order], key) for s in scenes)
            cells += [f"{ratio('node_tests'):.2f}", f"{ratio('cost'):.2f}", f"{1 / ratio('batch_speed'):.2f}"]
        lines.append([f"`{order}`", *cells])
    head = ["order", "shadow rays: node tests", "cost", "rate in batches"]
    return table(head + ["ambient occlusion: node tests", "cost", "rate in batches"], lines)
