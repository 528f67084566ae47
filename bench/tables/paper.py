"""Tables of the replication: the figures of the paper beside ours."""

import csv
import json
import os
import random
import statistics

from tables.records import *

def paper_rows():
    with open(os.path.join(ROOT, PAPER), newline="") as file:
        lines = (line for line in file if not line.startswith("#"))
        return {(r["scene"], int(r["width"]), r["technique"].lower()): r for r in csv.DictReader(lines)}


def beside_the_paper():
    theirs, lines = paper_rows(), []
    for scene in ("sponza", "sibenik", "sanmiguel"):
        key = "top_node_tests_after" if scene == "sanmiguel" else "node_tests_after"
        for width in (4, 8):
            ours = Rows(record(PAPER_RUN), width=width)
            values = []
            for order in PAPER_ORDERS:
                row = theirs[scene, width, order]
                values.append(float(row["box_tests_after"] or row["box_tests_before"]))
            name = "sanmiguel, top level" if scene == "sanmiguel" else scene
            for who, found in (
                ("paper", values),
                ("ours", [number(ours.known[scene, "binned-sah", "area", order], key) for order in PAPER_ORDERS]),
            ):
                gain = f"{found[0] / found[-1]:.2f}"
                lines.append([name, str(width), who] + [f"{value:.2f}" for value in found] + [gain])
    head = ["scene", "children", "from"] + ticks(PAPER_ORDERS) + ["gain of `sort+`"]
    return table(head, lines)


PRESET = "zen4-2026-11-24-paper.csv"
BEYOND = "zen4-2026-11-24-probe.csv"
PRESET_TREE = "binned-sah"
LEAF_RULES = "zen3-2026-11-26-leaf-rules.csv"
STAND_INS = {"bathroom": "room", "pavilion": "villa", "microcity": "city"}
PAPER_SCENES = ("sponza", "sibenik")


def paper_tests(theirs, scene, width, order):
    """N_b and N_t of the paper in an order."""
    row = theirs[STAND_INS.get(scene, scene), width, order]
    return [float(row[f"{kind}_tests_after"] or row[f"{kind}_tests_before"]) for kind in ("box", "prim")]


def as_today(row):
    """A row of a record of 2026-11-24, with the names of today."""
    if "order_seconds" not in row:
        return row
    row = {**row, "prim_cost": PRIM, "sort_seconds": row["order_seconds"]}
    for tests in ("node_tests", "prim_tests", "top_node_tests"):
        row[tests + "_before"] = row[tests + "_logging"]
    return row


def preset_rows(width, tree=PRESET_TREE, name=PRESET):
    """Ours by scene, order and C_p; an order that learns nothing has no C_p."""
    found = {}
    for row in map(as_today, record(name)):
        if (row["by"], row["width"]) == ("render", width) and row["tree"] == tree:
            cost = float(row["prim_cost"]) if row["order"].startswith("sort") else None
            found[row["scene"], row["order"], cost] = row
    return found


def our_tests(row):
    """N_b and N_t of a row; of San Miguel N_b counts the top level, as in the paper."""
    top = "top_" if row["scene"] == "sanmiguel" else ""
    return [number(row, top + "node_tests_after"), number(row, "prim_tests_after")]


def preset(width):
    """The paper's Table 2 or 3: ours, and the paper's N_b and N_t after sorting."""
    theirs, lines = paper_rows(), []
    ours = preset_rows(width)
    for (scene, order, cost), row in ours.items():
        if scene in STAND_INS:
            continue
        learned = cost is not None
        top = "top_" if scene == "sanmiguel" else ""
        before = lambda key: f"{number(row, key):.2f}" if learned else ""
        after, simple = our_tests(row), our_tests(ours[scene, "simple", None])
        low, high = json.loads(row["render_seconds_range"])
        lines.append(
            [
                scene,
                f"`{order}`",
                f"{cost:g}" if learned else "",
                before(top + "node_tests_before"),
                f"{after[0]:.2f}",
                before("prim_tests_before"),
                f"{after[1]:.2f}",
                *(f"{a / b:.2f}" for a, b in zip(simple, after)),
                f"{number(row, 'log_seconds'):.2f}" if learned else "",
                f"{1e3 * number(row, 'sort_seconds'):.1f}" if learned else "",
                f"{number(row, 'render_seconds'):.2f}",
                f"{high / low:.2f}",
                *(f"{value:g}" for value in paper_tests(theirs, scene, width, order)),
            ]
        )
    head = ["scene", "order", "C_p", "N_b before", "N_b after", "N_t before", "N_t after", "N_b gain", "N_t gain"]
    return table(head + ["log, s", "sort, ms", "composed, s", "spread", "paper: N_b", "paper: N_t"], lines)


def stand_ins():
    """Gains of `sort+` in scenes that stand in for those of the paper."""
    theirs, lines = paper_rows(), []
    for width in (4, 8):
        ours = preset_rows(width)
        for scene, other in STAND_INS.items():
            simple, sorted_ = (paper_tests(theirs, scene, width, order) for order in ("simple", "sort+"))
            cells = [f"{a / b:.2f}" for a, b in zip(simple, sorted_)]
            for cost in sorted({cost for s, _, cost in ours if s == scene and cost is not None}):
                pair = zip(our_tests(ours[scene, "simple", None]), our_tests(ours[scene, "sort+", cost]))
                cells += [f"{a / b:.2f}" for a, b in pair]
            lines.append([f"{scene} for {other}", str(width), *cells])
    head = ["scene", "children", "paper: N_b", "N_t", "C_p 0.15: N_b", "N_t", "C_p 1: N_b", "N_t"]
    return table(head[: max(map(len, lines))], lines)


def whole_pictures():
    """Share of shadow rays in the composed time of pictures, and the gain of `sort+` in that time, by width."""
    found, lines = {(width, key): row for width in (4, 8) for key, row in preset_rows(width).items()}, []
    for scene in unique(scene for _, (scene, _, _) in found):
        cells = []
        for width in (4, 8):
            simple, sorted_ = found[width, (scene, "simple", None)], found[width, (scene, "sort+", PRIM)]
            busy = {kind: float(seconds) for kind, seconds in (part.split() for part in simple["busy_seconds"].split("; "))}
            cells.append(f"{100 * busy['shadow'] / number(simple, 'render_seconds'):.0f} %")
            cells.append(f"{number(simple, 'render_seconds') / number(sorted_, 'render_seconds'):.2f}")
        lines.append([scene, *cells])
    return table(["scene", "4 children: shadow rays, `simple`", "gain of `sort+`", "8 children: shadow rays, `simple`", "gain of `sort+`"], lines)


def gains_of_the_paper():
    """Gains of each learned order over `simple` in N_b and N_t, theirs and ours."""
    theirs, lines = paper_rows(), []
    for width in (4, 8):
        ours = preset_rows(width)
        for name, scenes in (("mean of sponza and sibenik", PAPER_SCENES), ("sanmiguel", ("sanmiguel",))):
            sources = [("paper", lambda scene, order: paper_tests(theirs, scene, width, order))]
            for cost in sorted({cost for _, _, cost in ours if cost is not None}):
                of = lambda scene, order, cost=cost: our_tests(ours[scene, order, cost if order.startswith("sort") else None])
                sources.append((f"here, C_p {cost:g}", of))
            for who, tests in sources:
                cells = []
                for order in ("sato", "sort-", "sort", "sort+"):
                    for kind in (0, 1):
                        cells.append(f"{mean(tests(s, 'simple')[kind] / tests(s, order)[kind] for s in scenes):.2f}")
                lines.append([name, str(width), who, *cells])
    head = ["scenes", "children", "from"]
    return table(head + [f"`{order}`: {kind}" for order in ("sato", "sort-", "sort", "sort+") for kind in ("N_b", "N_t")], lines)


def leaf_rules():
    """One variable at a time: leaf rule and C_p, with the paper's figures above."""
    theirs, lines = paper_rows(), []
    for width in (4, 8):
        for scene in PAPER_SCENES:
            simple, sorted_ = (paper_tests(theirs, scene, width, order) for order in ("simple", "sort+"))
            gains = [f"{a / b:.2f}" for a, b in zip(simple, sorted_)]
            lines.append([scene, str(width), "paper", "", *(f"{x:.2f}" for x in simple), *gains])
            for tree in ("pbrt-2015", "pbrt", "binned-sah"):
                ours = preset_rows(width, tree, LEAF_RULES)
                for cost in sorted({cost for s, _, cost in ours if s == scene and cost is not None}):
                    simple, sorted_ = our_tests(ours[scene, "simple", None]), our_tests(ours[scene, "sort+", cost])
                    gains = [f"{a / b:.2f}" for a, b in zip(simple, sorted_)]
                    lines.append([scene, str(width), f"`{tree}`", f"{cost:g}", *(f"{x:.2f}" for x in simple), *gains])
    return table(["scene", "children", "tree", "C_p", "N_b `simple`", "N_t `simple`", "N_b gain of `sort+`", "N_t gain of `sort+`"], lines)


def interval(values, repeats=2000):
    """Bootstrap interval over scenes of the geometric mean, 95 %, always the same for the same values."""
    source = random.Random(1)
    means = sorted(mean(source.choices(values, k=len(values))) for _ in range(repeats))
    return f"[{means[repeats // 40]:.2f}, {means[-repeats // 40 - 1]:.2f}]"


def with_interval(values):
    return f"{mean(values):.2f} {interval(values)}", f"{statistics.median(values):.2f}"


def free_orders():
    """Gains of learned orders over the orders that need no rays, on the trees of the paper."""
    lines = []
    for width in (4, 8):
        rows = Rows(record(PAPER_RUN), width=width)
        tests = lambda scene, order: cost(rows.known[scene, "binned-sah", "area", order])
        for order in ("sato", "rtsah", "embree", "sort+", "joint"):
            over = {base: [tests(s, base) / tests(s, order) for s in rows.scenes] for base in ("simple", "embree")}
            lines.append([str(width), "no rays" if order in ("sato", "rtsah", "embree") else "learned", f"`{order}`"])
            for base in ("simple", "embree"):
                lines[-1] += with_interval(over[base])
    return table(["children", "group", "order", "over `simple`", "median", "over `embree`", "median"], lines)


def sorted_as_the_paper():
    """The rows of `sort+` of both Tables: N_b and N_t after sorting, and gains, theirs and ours."""
    theirs, lines = paper_rows(), []
    for width in (4, 8):
        ours = preset_rows(width)
        for scene in (*PAPER_SCENES, "sanmiguel"):
            row, simple = ours[scene, "sort+", PRIM], our_tests(ours[scene, "simple", None])
            after = our_tests(row)
            cells = [f"{value:.2f}" for value in after] + [f"{a / b:.2f}" for a, b in zip(simple, after)]
            cells += [f"{1e3 * number(row, 'sort_seconds'):.1f}", f"{number(row, 'render_seconds'):.2f}"]
            paper = [paper_tests(theirs, scene, width, order) for order in ("simple", "sort+")]
            cells += [f"{value:.2f}" for value in paper[1]] + [f"{a / b:.2f}" for a, b in zip(*paper)]
            lines.append([scene, str(width), *cells])
    head = ["scene", "children", "N_b", "N_t", "N_b gain", "N_t gain", "sort, ms", "composed, s"]
    return table(head + ["paper: N_b", "N_t", "N_b gain", "N_t gain"], lines)


def leaf_rules_short():
    """Gains of `sort+` by leaf rule and C_p."""
    theirs, lines = paper_rows(), []
    trees = [("pbrt", 0.15), ("pbrt", 1), ("binned-sah", 0.15), ("binned-sah", 1)]
    near = lambda ours, scene, cost: next(row for (s, o, c), row in ours.items() if (s, o) == (scene, "sort+") and abs(c - cost) < 1e-6)
    for width in (4, 8):
        for scene in PAPER_SCENES:
            pairs = [[paper_tests(theirs, scene, width, order) for order in ("simple", "sort+")]]
            for tree, cost in trees:
                ours = preset_rows(width, tree, LEAF_RULES)
                pairs.append([our_tests(ours[scene, "simple", None]), our_tests(near(ours, scene, cost))])
            lines.append([scene, str(width)] + [", ".join(f"{a / b:.2f}" for a, b in zip(*pair)) for pair in pairs])
    return table(["scene", "children", "paper"] + [f"`{tree}`, C_p {cost:g}" for tree, cost in trees], lines)


SKY_LIGHT = "zen3-2026-11-26-sky-light.csv"


def sky_light():
    """Sponza under its area light and under a sky, on the trees of pbrt-v3, with the paper's figures above."""
    theirs, lines = paper_rows(), []
    for width in (4, 8):
        simple, sorted_ = (paper_tests(theirs, "sponza", width, order) for order in ("simple", "sort+"))
        lines.append([str(width), "paper", "", "52 %", *(f"{x:.2f}" for x in simple), *(f"{a / b:.2f}" for a, b in zip(simple, sorted_))])
        for tree in ("pbrt-2015", "pbrt"):
            ours = preset_rows(width, tree, SKY_LIGHT)
            cost = max(cost for _, _, cost in ours if cost is not None)
            for scene, light in (("sponza", "area light"), ("sponza-sky", "sky")):
                row, sorted_ = ours[scene, "simple", None], our_tests(ours[scene, "sort+", cost])
                simple = our_tests(row)
                share = f"{100 * number(row, 'shadow_share'):.0f} %"
                lines.append([str(width), f"`{tree}`", light, share, *(f"{x:.2f}" for x in simple), *(f"{a / b:.2f}" for a, b in zip(simple, sorted_))])
    return table(["children", "tree", "light", "shadow rays", "N_b `simple`", "N_t `simple`", "N_b gain of `sort+`", "N_t gain of `sort+`"], lines)
