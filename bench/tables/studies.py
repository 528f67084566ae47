"""Tables of studies: orders, builders, collapses and training rays."""

from tables.paper import paper_rows
from tables.probe import RAYS
from tables.records import *

CORNERS = [(c, t) for c in ("area", "learned") for t in ("binned-sah", "reinsertion")]


def default_gains():
    shadow, ao = Rows(record(LAB10)), Rows(record(LAB10), "ao")
    lines = []
    for collapse, tree in CORNERS:
        cells = []
        for rows in (shadow, ao):
            cells += [f"{rows.gain(tree, collapse, order):.2f}" for order in ("simple", "joint")]
            cells.append(f"{rows.gain(tree, collapse, 'joint', measure=cost):.2f}")
        lines.append([f"`{collapse}`", f"`{tree}`", *cells])
    head = ["collapse", "builder", "shadow rays, `simple`", "`joint`", "cost, `joint`"]
    return table(head + ["ambient occlusion, `simple`", "`joint`", "cost, `joint`"], lines)


def default_parts():
    steps = [
        ("builder `reinsertion`, `area` and `simple`", ("binned-sah", "area", "simple"), ("reinsertion", "area", "simple")),
        ("learned collapse, `simple`", ("reinsertion", "area", "simple"), ("reinsertion", "learned", "simple")),
        ("order `joint`", ("reinsertion", "learned", "simple"), ("reinsertion", "learned", "joint")),
        ("all", ("binned-sah", "area", "simple"), ("reinsertion", "learned", "joint")),
    ]
    kinds = [Rows(record(LAB10)), Rows(record(LAB10), "ao")]
    lines = [[name] + [f"{rows.gain(*to, base):.2f}" for rows in kinds] for name, base, to in steps]
    return table(["part", "shadow rays", "ambient occlusion"], lines)


def default_scenes():
    rows = Rows(record(LAB10))
    columns = [("binned-sah", "area", "simple"), ("binned-sah", "area", "joint")]
    columns += [("reinsertion", "learned", "simple"), ("reinsertion", "learned", "joint")]
    lines = []
    for scene in rows.scenes:
        found = [rows.known[(scene, *column)] for column in columns]
        cells = [f"{nodes(row):.2f} + {prims(row):.1f}" for row in found]
        lines.append([scene, f"{100 * number(found[0], 'occluded_share'):.0f} %", *cells])
    head = ["scene", "blocked", "`binned-sah`, `area`, `simple`", "the same tree, `joint`", "default tree, `simple`", "default"]
    return table(head, lines)


def worth():
    rows = Rows(record(LAB10))
    lines = []
    for collapse, tree in CORNERS:
        simple, joint = (rows.gain(tree, collapse, order) for order in ("simple", "joint"))
        lines.append([f"`{tree}`", f"`{collapse}`", f"{simple:.2f}", f"{joint:.2f}", f"{joint / simple:.2f}"])
    return table(["builder", "collapse", "`simple`", "`joint`", "gain of the order"], lines)


ABLATION = "zen4-2026-11-24-ablation.csv"


def ablation():
    """Builder x collapse x order: gains over the trees of the paper, unsorted."""
    lines = []
    kinds = [Rows(record(ABLATION), rays) for rays, _ in RAYS]
    for tree in ("binned-sah", "reinsertion"):
        for collapse in ("area", "learned-unsorted", "learned"):
            for order in ("simple", "joint"):
                cells = []
                for rows in kinds:
                    nodes_and_cost = (rows.gain(tree, collapse, order), rows.gain(tree, collapse, order, measure=cost))
                    faster = rows.gain(tree, collapse, order, measure=lambda row: 1 / number(row, "speed"))
                    cells += [f"{gain:.2f}" for gain in (*nodes_and_cost, faster)]
                lines.append([f"`{tree}`", f"`{collapse}`", f"`{order}`", *cells])
    head = ["builder", "collapse", "order"]
    for _, kind in RAYS:
        head += [f"{kind}: node tests", "cost", "rate"]
    return table(head, lines)


def many_builders(rays):
    rows = Rows(record(LAB4), rays)
    trees = "binned-sah reinsertion ploc ploc-reinsertion sbvh rdh srdh".split()
    return builders(rows, trees, ["area", "learned"], "simple sato sort+ joint".split())


def gaps():
    lines = []
    for rays, name in (("shadow", "shadow"), ("ao", "ambient occlusion")):
        rows = Rows(record(LAB4), rays)
        base = ("binned-sah", "area")
        lines.append([f"{name}, gain"] + [f"{rows.gain(*base, order):.2f}" for order in ORDERS])
        lines.append([f"{name}, gap closed"] + [f"{100 * rows.gap(*base, order):.0f} %" for order in ORDERS])
    return table(["rays"] + ticks(ORDERS), lines)


KINDS = ["shadow rays", "by scene", "ambient occlusion rays", "by scene"]


def log_sizes():
    shadow, ao = (training(Rows(record(LAB10), rays), "log-size", "log_rays") for rays in ("shadow", "ao"))
    lines = [[size] + shadow["learned", "joint", size] + ao["learned", "joint", size] for size in "64 256 1024 4096".split()]
    return table(["training rays"] + KINDS, lines)


def other_rays():
    shadow, ao = (training(Rows(record(LAB10), rays), "transfer", "learned_from") for rays in ("shadow", "ao"))
    names = [
        ("turned-camera", "same eye, looking the other way"),
        ("surfaces", "surface rays only"),
        ("other-kind", "the other kind of rays"),
    ]
    lines = []
    for key, name in names:
        for collapse in ("area", "learned"):
            cells = shadow[collapse, "joint", key] + ao[collapse, "joint", key]
            lines.append([f"`{collapse}`", name, *cells])
    return table(["collapse", "training rays"] + KINDS, lines)


def predictions():
    lines = []
    for name, rays, width, collapse in (
        (LAB4, "shadow", 8, "area"),
        (LAB4, "ao", 8, "area"),
        (LAB10, "shadow", 8, "area"),
        (LAB10, "ao", 8, "area"),
        (STUDY, "shadow", 8, None),
        (STUDY, "shadow", 16, None),
    ):
        rows = Rows(record(name), rays, width)
        label = f"`{name}`, " + (f"`{collapse}`" if collapse else f"{width} wide")
        kind = "shadow" if rays == "shadow" else "ambient occlusion"
        lines.append([label, kind] + [predicted(rows, order, collapse) for order in ("sort", "sort+", "joint")])
    return table(["record", "rays", "`sort`", "`sort+`", "`joint`"], lines)


def gains_by_order(name, widths, collapse):
    """The last rows of `by_scene`: gains of all orders over `simple`, by the number of children."""
    lines = []
    for width in widths:
        *_, gain = by_scene(Rows(record(name), width=width), "binned-sah", collapse)
        lines.append([str(width), *(cell.strip() for cell in gain.strip("|").split("|")[1:])])
    return table(["children"] + ticks(ORDERS), lines)


def builders_short():
    """Gains of `joint` over the unlearned tree, and the cost on the learned collapse, by builder."""
    kinds, lines = [Rows(record(LAB4), rays) for rays, _ in RAYS], []
    for tree in "binned-sah reinsertion ploc ploc-reinsertion sbvh rdh srdh".split():
        cells = []
        for rows in kinds:
            cells += [f"{rows.gain(tree, collapse, 'joint'):.2f}" for collapse in ("area", "learned")]
            cells.append(f"{rows.gain(tree, 'learned', 'joint', measure=cost):.2f}")
        lines.append([f"`{tree}`", *cells])
    head = ["builder", "shadow rays: `area`", "`learned`", "cost, `learned`"]
    return table(head + ["ambient occlusion: `area`", "`learned`", "cost, `learned`"], lines)
