"""Tables of the record of `bench/counts`: medians over seeds, for scenes that were used while designing and others."""

from tables.paper import with_interval
from tables.records import *

COUNTS = "xeon-2026-11-26-counts.csv"
# Scenes that were never used while designing: PUBLIC of bench/counts.
NEVER_USED = (
    "staircase2 material-testball caustic-glass living-room staircase veach-ajar killeroo-gold breakfast wallpaper-bathroom bmw-m6"
).split()
FREE = ("sato", "rtsah", "embree")


def counted(run, rays="shadow", width=8):
    """The rows of one part of the record."""
    return Rows([row for row in record(COUNTS) if row["run"] == run], rays, width)


def groups(scenes):
    used = [scene for scene in scenes if scene not in NEVER_USED]
    return (("all", scenes), ("used", used), ("never used", [scene for scene in scenes if scene in NEVER_USED]))


def unseen_scenes():
    """Gains in cost of free and learned orders, on the trees of the paper, by group of scenes."""
    lines = []
    for rays, kind in (("shadow", "shadow"), ("ao", "ambient occlusion")):
        rows = counted("orders-8", rays)
        tests = lambda scene, order: cost(rows.known[scene, "binned-sah", "area", order])
        for group, scenes in groups(rows.scenes):
            for order in (*FREE, "sort+", "joint"):
                cells = []
                for base in ("simple", "embree"):
                    cells += with_interval([tests(s, base) / tests(s, order) for s in scenes])
                best = [min(tests(s, free) for free in FREE) / tests(s, order) for s in scenes]
                cells.append(with_interval(best)[0] if order not in FREE else "")
                lines.append([kind, f"{group}: {len(scenes)}", f"`{order}`", *cells])
    return table(["rays", "scenes", "order", "over `simple`", "median", "over `embree`", "median", "over the best without rays"], lines)


def unseen_scenes_short():
    """The rows of `joint`."""
    lines = unseen_scenes()
    return lines[:2] + [line for line in lines if "`joint`" in line]


def counts_by_scene():
    """Node tests per shadow ray on the trees of the paper, scene by scene."""
    return by_scene(counted("orders-8"), "binned-sah", "area")


def ray_driven():
    """Gains in cost of builders that rays drive, in the order `joint`, over the surface area heuristic collapsed by area."""
    lines = []
    for rays, kind in (("shadow", "shadow"), ("ao", "ambient occlusion")):
        rows = counted("ray-driven", rays)
        tests = lambda scene, tree, collapse: cost(rows.known[scene, tree, collapse, "joint"])
        for tree in ("binned-sah", "rdh", "srdh", "vdbvh"):
            cells = []
            for collapse in ("area", "learned"):
                cells += with_interval([tests(s, "binned-sah", "area") / tests(s, tree, collapse) for s in rows.scenes])
            lines.append([kind, f"`{tree}`", *cells])
    return table(["rays", "builder", "`area`", "median", "`learned`", "median"], lines)


def ray_driven_sentence():
    """How many scenes these builders were counted on, as the page says it."""
    return f"Counts of {len(counted('ray-driven').scenes)} of the twenty scenes, one seed:"


def seeds_sentence():
    """How many scenes and seeds the record has, as the page says it."""
    rows = counted("orders-8")
    by_scene = {row["scene"]: int(row["seeds"]) for row in rows.all}
    fewest, most = min(by_scene.values()), max(by_scene.values())
    count = f"{fewest} to {most} seeds each" if fewest < most else "one seed" if most == 1 else f"the median of {most} seeds"
    new = sum(scene in NEVER_USED for scene in rows.scenes)
    return f"The record has {len(rows.scenes)} scenes, {new} of them never used, with {count}."


def outlier_sentence():
    """The scene of those never used that gains most over `embree`, as the page says it."""
    rows = counted("orders-8")
    tests = lambda scene, order: cost(rows.known[scene, "binned-sah", "area", order])
    gains = {s: tests(s, "embree") / tests(s, "joint") for s in rows.scenes if s in NEVER_USED}
    scene = max(gains, key=gains.get)
    return f"Mean and median differ for shadow rays, since {scene} gains {gains[scene]:.2f} over `embree`."
