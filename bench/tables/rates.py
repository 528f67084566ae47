"""Tables of rates: beside Embree, other crates and packages, and whole pictures."""

import csv
import json
import os

from tables.records import *

def document(name):
    with open(os.path.join(ROOT, "bench/record", name)) as file:
        return json.load(file)


def bench_ratios(name):
    """Speed relative to Embree by rays, query and engine: geometric mean of the scenes."""
    found = {}
    for row in document(name)["rows"]:
        if row.get("ratio_to_embree"):
            key = row["rays"], row["query"], row["engine"], row["api"]
            found.setdefault(key, []).append(row["ratio_to_embree"])
    return {key: mean(values) for key, values in found.items()}


CALLS = [("occluded", "batch"), ("occluded", "single"), ("intersect", "batch"), ("intersect", "single")]
RAY_KINDS = ("primary", "shadow", "diffuse")
AVX512, AVX2 = "zen4-2026-11-24.json", "zen4-2026-11-24-avx2.json"


def call(query, api):
    return f"`{query}`, batch" if api == "batch" else f"`{query}`"


def beside_embree():
    """Speed relative to single calls of Embree, on two instruction sets."""
    records = [bench_ratios(AVX512), bench_ratios(AVX2)]
    names = [(call(query, api), "antumbra", query, api) for query, api in CALLS]
    names += [
        ("Embree, `rtcOccluded16`", "embree-packets", "occluded", "batch"),
        ("Embree, robust flag, `rtcOccluded1`", "embree-robust", "occluded", "single"),
        ("Embree, robust flag, `rtcIntersect1`", "embree-robust", "intersect", "single"),
    ]
    lines = []
    for name, engine, query, api in names:
        lines.append([name] + [f"{found[rays, query, engine, api]:.2f}" for found in records for rays in RAY_KINDS])
    return table(["call", "AVX-512: camera", "shadow", "diffuse", "AVX2: camera", "shadow", "diffuse"], lines)


def embree_by_scene(name, kinds=("shadow", "diffuse")):
    """Speed relative to single calls of Embree, and the work of an occlusion query, scene by scene."""
    found = (row for row in document(name)["rows"] if row["engine"] == "antumbra")
    rows = {(r["scene"], r["rays"], r["query"], r["api"]): r for r in found}
    scenes = unique(scene for scene, *_ in rows)
    lines = []
    for rays in kinds:
        for query, api in CALLS:
            lines.append([f"{call(query, api)}, {rays}"] + [f"{rows[s, rays, query, api]['ratio_to_embree']:.2f}" for s in scenes])
    batch = [rows[s, "shadow", "occluded", "batch"] for s in scenes]
    lines.append(["`occluded`, batch, shadow, million rays per second"] + [f"{row['mrays_per_s']:.1f}" for row in batch])
    lines.append(["node tests per shadow ray"] + [f"{row['node_tests']:.1f}" for row in batch])
    lines.append(["primitive tests per shadow ray"] + [f"{row['prim_tests']:.1f}" for row in batch])
    return table(["call, rays"] + [scene.replace("builtin:", "") for scene in scenes], lines)


def builds():
    """Seconds of Embree over ours, with and without the learning of the order."""
    lines, columns = [], [[], [], []]
    for name in (AVX512, "zen4-2026-11-24-two-levels.json"):
        rows = [row for row in document(name)["builds"] if row["builder"] in ("binned-sah", "medium")]
        theirs = {row["scene"]: row for row in rows if row["engine"] == "embree"}
        for row in (row for row in rows if row["engine"] == "antumbra"):
            other = theirs[row["scene"]]
            unordered = row["seconds"] - row["step_seconds"]["order"]
            ratios = [other["seconds"] / unordered, other["seconds"] / row["seconds"], row["bytes"] / other["bytes"]]
            if name == AVX512:
                for column, ratio in zip(columns, ratios):
                    column.append(ratio)
            scene = row["scene"].replace("builtin:", "")
            lines.append([scene, f"{row['unique_triangles']:,}".replace(",", " "), f"{1e3 * row['seconds']:.0f}"] + [f"{ratio:.2f}" for ratio in ratios])
    lines.insert(6, ["geometric mean of these", "", ""] + [f"**{mean(column):.2f}**" for column in columns])
    head = ["scene", "stored triangles", "ours, ms", "Embree / ours without the order", "Embree / ours", "bytes, ours / Embree's"]
    return table(head, lines)


TURNS = "zen4-2026-11-24-picture-turns.csv"


def turns(kind):
    with open(os.path.join(ROOT, "bench/record", TURNS), newline="") as file:
        return [row for row in csv.DictReader(file) if row["integrator"] == kind]


def median(values):
    values = sorted(values)
    return (values[(len(values) - 1) // 2] + values[len(values) // 2]) / 2


def picture_turns():
    """Seconds of pictures by `path`: user time, and the shares of the stages by their clocks."""
    rows, lines = turns("path"), []
    stages = {"shading": ["shading"], "closest hits": ["closest"], "shadow rays": ["shadow"]}
    stages["learning and building"] = ["build", "log", "sort"]
    parts = "shadow closest shading film build log sort".split()
    for scene in unique(row["scene"] for row in rows):
        own = [row for row in rows if row["scene"] == scene]
        cells = [f"{median(number(row, 'user_seconds') for row in own):.1f}"]
        for keys in stages.values():
            shares = (sum(number(row, k) for k in keys) / sum(number(row, k) for k in parts) for row in own)
            cells.append(f"{100 * median(shares):.0f} %")
        lines.append([scene, *cells])
    return table(["scene", "seconds", *stages], lines)


def direct_turns():
    """Seconds of pictures by direct light, on the paper's trees and by default."""
    rows, lines = turns("directlighting"), []
    for scene in unique(row["scene"] for row in rows):
        seconds = lambda way: [number(row, "user_seconds") for row in rows if (row["scene"], row["way"]) == (scene, way)]
        paper, default = seconds("paper"), seconds("default")
        ratios = ", ".join(f"{a / b:.2f}" for a, b in zip(paper, default))
        lines.append([scene, f"{median(paper):.2f}", f"{median(default):.2f}", ratios])
    return table(["scene", "paper's trees, s", "default, s", "speedup, by round"], lines)


def kinds(names, ratio):
    """Other geometry and conditions, two scenes: ratios to Embree or to plain triangles.

    Left out are batches with conditions: the records are of a version that traced their rays twice.
    """
    lines = []
    rows = [{(r["kind"], r["query"], r["api"]): r[ratio] for r in document(f"zen4-2026-11-24-kinds-{scene}.json")["kinds"]
             if r["engine"] == "antumbra"} for scene in ("sponza", "city")]
    for kind, name in names.items():
        outdated = [(kind, "batch") for kind in ("mask", "except", "filter")]
        found = [None if (kind, api) in outdated else scene.get((kind, query, api)) for scene in rows for query, api in KIND_CALLS]
        lines.append([name] + [f"{value:.2f}" if value else "" for value in found])
    calls = [call(query, api) for query, api in KIND_CALLS]
    return table(["", f"sponza: {calls[0]}", *calls[1:], f"city: {calls[0]}", *calls[1:]], lines)


KIND_CALLS = [("occluded", "single"), ("occluded", "batch"), ("intersect", "single"), ("intersect", "batch")]
KINDS_OF_EMBREE = {
    "triangles": "triangles, the same rays",
    "quads": "quads",
    "user": "user geometry: triangles by one function",
    "filter": "a filter that rejects a quarter",
    "refitted": "triangles after a refit",
}
KINDS_OF_OURS = {
    "quads": "`Geometry::quads`",
    "user": "`Geometry::user`",
    "closed": "`closed`",
    "mask": "`mask` that shows everything",
    "except": "`except`: the primitive that a ray starts on",
    "filter": "filters that reject a quarter",
    "visit": "`visit_hits`, first hit accepted",
}


def rust_crates():
    rows = document("zen4-2026-11-24-rust-crates.json")
    crates = {"antumbra": "`antumbra`", "obvhs": "`obvhs` 0.4", "bvh": "`bvh` 0.13"}
    lines = []
    for row in rows:
        first, *rest = row["antumbra_faster"]
        low, high = min(row["antumbra_faster"]), max(row["antumbra_faster"])
        digits = 0 if first >= 20 else 1
        faster = differences = ""
        if row["name"] != "antumbra":
            faster = f"{first:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"
            differences = str(row["differences"]) + (" camera rays" if row["program"] == "instances" else "")
        cells = [f"{row['build_seconds']:.2g}", f"{row['mrays_per_second']:.3g}", faster, differences]
        lines.append([row["program"], crates[row["name"]], str(row["lines"]), *cells])
    return table(["program", "crate", "lines", "build, s", "Mray/s", "speedup of `antumbra`", "answers that differ"], lines)


def rust_crates_summary():
    """Speedups over the two crates, by program."""
    rows = document("zen4-2026-11-24-rust-crates.json")
    names = {
        "baker": "ambient occlusion of 267 200 triangles",
        "visibility": "visibility between 2000 points",
        "instances": "10 000 instances, with shadows",
    }
    lines = []
    for program, name in names.items():
        found = {row["name"]: row["antumbra_faster"][0] for row in rows if row["program"] == program}
        lines.append([name] + [f"{found[crate]:.{0 if found[crate] >= 20 else 1}f}" for crate in ("obvhs", "bvh")])
    return table(["program", "over `obvhs` 0.4", "over `bvh` 0.13"], lines)


PYTHON = ["zen4-2026-11-24-python.json", "zen4-2026-11-24-python-open.json"]


def python_speedups():
    """Speedups over other packages, by (ours, theirs): closed scenes, the open one, a camera."""
    closed, outside = ({(r["ours"], r["rival"]): r for r in document(name)["speedups"]} for name in PYTHON)
    return {key: (row["sun_and_ao"], outside[key]["sun_and_ao"], row["camera"]) for key, row in closed.items()}


def python():
    lines = []
    for (ours, rival), values in python_speedups().items():
        engine, method = ours.split()
        ours = f"drop-in `{method}`" if "." in engine else f"`{method}`"
        engine, method = rival.split()
        lines.append([ours, f"{engine} `{method}`", *(f"{value:.1f}" for value in values)])
    return table(["call", "over", "two closed scenes", "an open scene", "camera"], lines)


def readme():
    ratios = bench_ratios(AVX512)

    def over_embree(query, api, kinds=("shadow", "diffuse"), rival=None):
        ours = [ratios[rays, query, "antumbra", api] for rays in kinds]
        return span(a / (ratios[rays, query, rival, "batch"] if rival else 1) for a, rays in zip(ours, kinds))

    def span(values):
        low, *_, high = sorted(f"{value:.1f}" for value in values)
        return low if low == high else f"{low} to {high}"

    obvhs = [row["antumbra_faster"][0] for row in document("zen4-2026-11-24-rust-crates.json") if row["name"] == "obvhs"]
    packages = python_speedups()
    lines = [
        ["occlusion in batches", "Embree 4.4, one ray per call", f"**{over_embree('occluded', 'batch')}**"],
        ["occlusion in batches", "Embree 4.4, packets of 16", over_embree("occluded", "batch", rival="embree-packets")],
        ["occlusion in batches", "`obvhs` 0.4, a Rust crate", span(obvhs)],
        ["occlusion from Python", "Open3D", span(packages["antumbra occluded", "open3d test_occlusions"][:2])],
        ["occlusion from Python", "trimesh with embreex", span(packages["antumbra occluded", "trimesh intersects_any"][:2])],
        ["closest hits in batches", "Embree 4.4, one ray per call", f"**{over_embree('intersect', 'batch')}**"],
        ["occlusion, one ray per call", "the same of Embree 4.4", over_embree("occluded", "single")],
    ]
    return table(["measured", "compared with", "factor"], lines)
