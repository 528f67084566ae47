"""Reads records of studies, and the rows, means and tables that all tables share."""

import csv
import json
import math
import os
import re


ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
PAPER = "science/lab/src/report/paper.csv"
ORDERS = "simple random ftob sato embree rtsah sort- sort sort+ visits joint".split()
PAPER_ORDERS = "simple ftob sato sort- sort sort+".split()
PRIM = 0.15  # cost of a primitive test in node tests
LAB10, LAB4, STUDY, PAPER_RUN = (
    "zen3-2026-11-22-laboratory.csv",
    "zen5-2026-11-22-laboratory.csv",
    "zen3-2026-11-22-study.csv",
    "xeon-2026-11-23-paper.csv",
)


def read(path):
    with open(path, newline="") as file:
        rows = json.load(file)["rows"] if path.endswith(".json") else list(csv.DictReader(file))
    for row in rows:
        row["width"] = int(row["width"])
        row.setdefault("part", "techniques")
        row.setdefault("rays", "shadow")
        row.setdefault("tree", "binned-sah")
    return rows


def record(name, cache={}):
    if name not in cache:
        cache[name] = read(os.path.join(ROOT, "bench/record", name))
    return cache[name]


def number(row, key):
    return None if row.get(key) in (None, "") else float(row[key])


def nodes(row):
    return number(row, "node_tests_after")


def prims(row):
    return number(row, "prim_tests_after")


def cost(row):
    return nodes(row) + PRIM * prims(row)


def mean(values):
    """Geometric mean."""
    values = list(values)
    return math.exp(sum(map(math.log, values)) / len(values))


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + [re.sub(r"(?<=\|)  (?=\|)", " ", "| " + " | ".join(row) + " |") for row in rows]


def unique(values):
    return list(dict.fromkeys(values))


def ticks(names):
    return [f"`{name}`" for name in names]


class Rows:
    """The rows of one kind of rays and one width."""

    def __init__(self, rows, rays="shadow", width=8):
        self.all = [row for row in rows if (row["rays"], row["width"]) == (rays, width)]
        self.known = {
            (r["scene"], r["tree"], r["collapse"], r["order"]): r for r in self.all if r["part"] == "techniques"
        }
        self.scenes = unique(key[0] for key in self.known)

    def complete(self, tree, collapse, order):
        return all((scene, tree, collapse, order) in self.known for scene in self.scenes)

    def gain(self, tree, collapse, order, base=("binned-sah", "area", "simple"), measure=nodes):
        """Times fewer tests than `base`, a (tree, collapse, order)."""
        return mean(
            measure(self.known[(scene, *base)]) / measure(self.known[scene, tree, collapse, order])
            for scene in self.scenes
        )

    def gap(self, tree, collapse, order):
        """Share of what an oracle saves occluded rays over `simple` that an order saves, mean of the scenes."""
        shares = []
        for scene in self.scenes:
            simple = self.known[scene, tree, collapse, "simple"]
            best, found = number(simple, "oracle_occluded"), self.known[scene, tree, collapse, order]
            if best is None:
                return None
            before = number(simple, "node_tests_occluded")
            if before - best > 1e-6:
                shares.append((before - number(found, "node_tests_occluded")) / (before - best))
        return sum(shares) / len(shares)


def by_scene(rows, tree, collapse, orders=ORDERS):
    orders = [order for order in orders if rows.complete(tree, collapse, order)]
    lines = [
        [scene] + [f"{nodes(rows.known[scene, tree, collapse, order]):.2f}" for order in orders]
        for scene in rows.scenes
    ]
    base = (tree, collapse, "simple")
    if "simple" in orders:
        lines.append(["gain"] + [f"{rows.gain(tree, collapse, order, base):.2f}" for order in orders])
    return table(["scene"] + ticks(orders), lines)


def builders(rows, trees, collapses, orders):
    lines = []
    for collapse in collapses:
        for tree in trees:
            if not rows.complete(tree, collapse, "simple"):
                continue
            cells = [
                f"{rows.gain(tree, collapse, o):.2f}" if rows.complete(tree, collapse, o) else "" for o in orders
            ]
            last = orders[-1] if "joint" not in orders else "joint"
            costs = f"{rows.gain(tree, collapse, last, measure=cost):.2f}" if rows.complete(tree, collapse, last) else ""
            lines.append([f"`{collapse}`", f"`{tree}`", *cells, costs])
    return table(["collapse", "builder"] + ticks(orders) + ["cost, `joint`"], lines)


def training(rows, part, label):
    groups = {}
    for row in rows.all:
        if row["part"] == part and row["order"] in ("joint", "sort+"):
            key = row["tree"], row["collapse"], row["order"], row[label]
            groups.setdefault(key, []).append(row)
    found = {}
    for (tree, collapse, order, value), group in groups.items():
        more = [nodes(row) / nodes(rows.known[row["scene"], tree, collapse, order]) for row in group]
        found[collapse, order, value] = [f"{mean(more):.3f}", f"{min(more):.2f} to {max(more):.2f}"]
    return found


def predicted(rows, order, collapse=None):
    found = [r for key, r in rows.known.items() if key[3] == order and key[2] == (collapse or key[2])]
    ratios = [number(r, "predicted_cost_after") / cost(r) for r in found if number(r, "predicted_cost_after")]
    return f"{mean(ratios):.2f}" if ratios else ""
