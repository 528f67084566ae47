"""Figures outside of the tables: what the records say in sentences, and where the other figures come from.

`computed` has sentences with the figures of today's records. `SOURCES` names the source of each other figure:
a file and what must be in it, or one of KINDS.
"""

import math
import os
import re
import statistics

from tables import atlas, texts
from tables.texts import spaced

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
KINDS = {
    "setting": "what was chosen for a run or a rule, not measured",
    "cited": "a figure of others",
    "defined": "follows from a definition or from arithmetic",
    "unrecorded": "one run whose log is not kept, and the page says so",
}
REPLICATION, PERFORMANCE, COSTS = (f"docs/src/{n}.md" for n in ("replication", "performance", "costs"))
# Figures of a group of pages may be on any of them.
RESULTS = ("docs/src/results.md", "docs/src/beyond-static-order.md")
ORDER, EMBREE = (f"docs/src/{n}.md" for n in ("occlusion-order", "order-in-embree"))
BAKING = tuple(f"docs/src/{n}.md" for n in ("occlusion-baking", "bakes", "sun-and-sky", "visibility", "rasters", "horizons"))
PYTHON = ("docs/src/python/index.md", "docs/src/python/scenes.md")
RELIABILITY, BENCH = "docs/src/reliability.md", "bench/performance.md"
MOVING, ATLAS = "docs/src/moving-scenes.md", "docs/src/atlas.md"
LONG = "bench/results.md"


def two(values, digits):
    """The least and the largest of some values, as a page says them."""
    values = list(values)
    return f"{min(values):.{digits}f} to {max(values):.{digits}f}"


def computed(of):
    """(page, text) of sentences that records determine; `of` has the functions of bench/results."""
    yield from counted(of)
    yield from of_the_paper(of)
    yield from of_embree(of)
    yield from timed(of)
    yield from baked(of)
    yield from packages(of)
    yield from moving(of)
    yield from of_the_atlas()


def counted(of):
    rows = of.Rows(of.record(of.ABLATION))
    unsorted, learned = (rows.gain("binned-sah", collapse, "simple") for collapse in ("learned-unsorted", "learned"))
    yield RESULTS, f"save a factor of {unsorted:.2f} in node tests, and its child order a factor of {learned / unsorted:.2f}"
    paper = {width: of.Rows(of.record(of.PAPER_RUN), width=width) for width in (4, 8)}
    over = {
        f"{of.mean(of.cost(r.known[s, 'binned-sah', 'area', 'embree']) / of.cost(r.known[s, 'binned-sah', 'area', 'joint']) for s in r.scenes):.1f}"
        for r in paper.values()
    }
    yield RESULTS, f"a learned order costs shadow rays {' to '.join(sorted(over))} times less than `embree`"
    free = ("sato", "rtsah", "embree")
    tests = lambda rows, scene, order: of.cost(rows.known[scene, "binned-sah", "area", order])
    means = {o: [of.mean(tests(r, s, o) / tests(r, s, "joint") for s in r.scenes) for r in paper.values()] for o in free}
    assert min(means, key=lambda order: sum(means[order])) == "rtsah"
    over = sorted({f"{value:.2f}" for value in means["rtsah"]})
    each = [of.mean(min(tests(r, s, o) for o in free) / tests(r, s, "joint") for s in r.scenes) for r in paper.values()]
    yield RESULTS, (
        f"Over `rtsah`, the best of them in the mean, `joint` gains {' to '.join(over)}. "
        f"Over the best of the three in each scene, {two(each, 2)} are left."
    )
    yield "README.md", f"Shadow rays cost {' to '.join(over)} times less than in [the best order without rays]"
    more = {
        f"{100 * (of.nodes(r.known['scans', 'binned-sah', 'area', 'sort+']) / of.nodes(r.known['scans', 'binned-sah', 'area', 'simple']) - 1):.0f}"
        for r in paper.values()
    }
    yield RESULTS, f"on scans, where it takes about {' to '.join(sorted(more))} % more"
    shares = [100 * 4096 / of.number(r, "shadow_rays") for rows in paper.values() for r in rows.all if r["order"] == "joint"]
    yield RESULTS, f"`joint` learns from 4096 rays, {two(shares, 1)} %"
    shares = [100 * of.number(r, "shadow_share") for r in paper[8].all]
    yield ORDER, f"In path tracing they are {two(shares, 0)} % of the rays of our scenes"
    yield RESULTS, of.seeds_sentence()
    yield RESULTS, of.ray_driven_sentence()
    yield RESULTS, of.outlier_sentence()
    gaps = [of.Rows(of.record(of.LAB10), rays).gap("binned-sah", "area", "joint") for rays in ("shadow", "ao")]
    yield RESULTS, "On ten scenes `joint` closes {:.0f} % for shadow rays and {:.0f} % for ambient occlusion".format(*(100 * g for g in gaps))
    errors, worst = [], 0
    for tree, _ in of.PROBED:
        for rays, _ in of.RAYS:
            ratios = [of.number(r, "independent") / of.number(r, "cost") for r in of.probe_rows("model", rays, tree)]
            errors.append(100 * statistics.mean(abs(ratio - 1) for ratio in ratios))
            worst = max(worst, *(100 * abs(ratio - 1) for ratio in ratios))
    yield RESULTS, f"a mean error of {two(errors, 0)} %, and single scenes are off by up to {worst:.0f} %"
    yield ORDER, f"equation 1 has a mean error of {two(errors, 0)} %"
    too_high = [float(cell) for row in of.predictions()[2:] for cell in row.split("|")[3:] if cell.strip()]
    yield REPLICATION, f"the same equation is {two(too_high, 1)} times too high"
    yield ORDER, f"by a factor of {two(too_high, 1)} in the mean"
    rows = {(r["scene"], r["technique"]): r for r in of.probe_rows("ways", "ao", "binned-sah")}
    far = of.mean(of.number(rows[s, "simple"], "node_tests") / of.number(rows[s, "far"], "node_tests") for s in of.unique(s for s, _ in rows))
    yield RESULTS, f"it takes {far:.2f} times fewer tests than `simple` for ambient occlusion"
    saved = {}
    for scene in ("sanmiguel", "city"):
        rows = [r for r in of.probe_rows("moving") if r["scene"] == scene and float(r["test_rays"]) > 0 and float(r["node_tests"]) > 0]
        costs = [statistics.mean(of.number(r, "cost") for r in rows if r["technique"] == t) for t in ("learned from frame 0", "relearned every frame")]
        saved[scene] = 100 * (1 - costs[1] / costs[0])
    assert abs(saved["city"]) < 0.5, saved
    yield RESULTS, f"saves {saved['sanmiguel']:.0f} % of the cost in sanmiguel and nothing in the city"
    runs = {}
    for row in of.record(of.SPLITS):
        for rate in of.RATES:
            runs.setdefault((row["scene"], row["rays"], row["tree"], rate), []).append(of.number(row, rate))
    spreads = sorted(100 * (max(values) / min(values) - 1) for values in runs.values())
    yield RESULTS, f"differ between runs by {spreads[-2]:.0f} % at most, and once by {spreads[-1]:.0f} % (scans, `sbvh`)"


def of_the_paper(of):
    theirs = of.paper_rows()
    paper = of.Rows(of.record(of.PAPER_RUN))
    tests = lambda order: of.nodes(paper.known["sibenik", "binned-sah", "area", order])
    first, last = (of.paper_tests(theirs, "sibenik", 8, order)[0] for order in ("simple", "sort+"))
    yield LONG, f"sibenik gains {first / last:.2f} with 8 children | no, {tests('simple') / tests('sort+'):.2f}"
    preset = {(scene, order, width): row for width in (4, 8) for (scene, order, _), row in of.preset_rows(width).items()}
    scenes = of.unique(key[0] for key in preset)
    share = {scene: 100 * of.number(preset[scene, "simple", 4], "shadow_share") for scene in ("sponza", "sibenik")}
    yield REPLICATION, f"Shadow rays are {share['sponza']:.0f} and {share['sibenik']:.0f} % of all rays"
    seconds = lambda *key: of.number(preset[key], "render_seconds")
    speedups = [seconds(s, "simple", w) / seconds(s, "sort+", w) for s in scenes for w in (4, 8)]
    yield REPLICATION, f"no: {two(speedups, 2)} with `sort+` at one sample per pixel"
    busy = lambda row, part: float(next(p.split()[1] for p in row["busy_seconds"].split("; ") if p.startswith(part + " ")))
    part = [100 * busy(preset[s, "simple", w], "shadow") / seconds(s, "simple", w) for s in scenes for w in (4, 8)]
    yield REPLICATION, f"Shadow rays take {two(part, 0)} % of the time here with `simple`"
    tests = lambda order: of.mean(of.our_tests(preset[s, order, 8])[0] for s in ("sibenik",))
    yield REPLICATION, f"and {100 * (tests('sort+') / tests('sort') - 1):.1f} % more with 8, on leaves of eight"
    ours = [of.our_tests(preset["sanmiguel", "simple", w])[0] / of.paper_tests(theirs, "sanmiguel", w, "simple")[0] for w in (4, 8)]
    yield REPLICATION, f"needs {two(ours, 1)} times the paper's node tests"
    gains, papers = [], []
    for width in (4, 8):
        for scene in of.STAND_INS:
            gains.append(of.our_tests(preset[scene, "simple", width])[0] / of.our_tests(preset[scene, "sort+", width])[0])
            first, last = (of.paper_tests(theirs, scene, width, order)[0] for order in ("simple", "sort+"))
            papers.append(first / last)
    yield REPLICATION, f"`sort+` gains {two(gains, 2)} in N_b, and the paper reports {two(papers, 2)} in its own"
    unsorted = lambda tree: of.our_tests(of.preset_rows(4, tree, of.LEAF_RULES)["sponza", "simple", None])[0]
    base = of.paper_tests(theirs, "sponza", 4, "simple")[0]
    yield REPLICATION, f"its unsorted N_b with 4 children is {100 * (unsorted('pbrt') / base - 1):.0f} % larger"
    sky = lambda width: of.our_tests(of.preset_rows(width, "pbrt", of.SKY_LIGHT)["sponza-sky", "simple", None])[0]
    off = [100 * abs(sky(w) / of.paper_tests(theirs, "sponza", w, "simple")[0] - 1) for w in (4, 8)]
    yield REPLICATION, f"within {math.ceil(off[0])} % of the paper's with 4 children and the tree `pbrt`, and within {math.ceil(off[1])} % with 8"
    share = 100 * of.number(of.preset_rows(4, "pbrt", of.SKY_LIGHT)["sponza", "simple", None], "shadow_share")
    yield REPLICATION, f"which only upward surfaces face, they are {share:.0f} %"
    closed = []
    for rays, _ in of.RAYS:
        rows = {(r["scene"], r["technique"]): r for r in of.probe_rows("ways", rays, "binned-sah")}
        tests = lambda s, key, order="simple": of.number(rows[s, order], key)
        scenes = [s for s in of.unique(s for s, _ in rows) if tests(s, "node_tests") > tests(s, "oracle")]
        gain = lambda s: tests(s, "node_tests") - tests(s, "node_tests", "octants")
        closed.append(100 * statistics.mean(gain(s) / (tests(s, "node_tests") - tests(s, "oracle")) for s in scenes))
    yield REPLICATION, "closes {:.0f} % and {:.0f} % of the gap to an oracle".format(*closed)


def of_embree(of):
    rows = of.record_of_embree()
    scenes = of.unique(row["scene"] for row in rows)

    def speeds(call, rays, order, scene=None):
        return [float(r["speed"]) for r in rows if (r["call"], r["rays"], r["order"]) == (call, rays, order) and scene in (None, r["scene"])]

    def means(call, order):
        found = []
        for rays in ("shadow", "ao", "sun"):
            own = [of.mean(values) for scene in scenes if (values := speeds(call, rays, order, scene))]
            found.append(of.mean(own))
        return found

    yield EMBREE, f"the best learned order is {two(means('rtcOccluded1', 'joint'), 2)} times as fast as Embree's own"
    sponza = [s for rays in ("shadow", "ao", "sun") for s in speeds("rtcOccluded1", rays, "joint", "sponza")]
    sibenik = statistics.median(speeds("rtcOccluded1", "shadow", "joint", "sibenik"))
    assert min(sponza) > 1
    yield EMBREE, f"In sponza every seed of every kind gains, up to {max(sponza):.2f}, and sibenik's shadow rays gain {sibenik:.2f}"
    yield EMBREE, f"**Packets** of eight gain a little more than single rays: {two(means('rtcOccluded8', 'joint'), 2)}"
    slow = [1 / mean for call in ("rtcOccluded1", "rtcOccluded8") for mean in means(call, "random")]
    yield EMBREE, f"faster than `random` by {two(slow, 1)}"


def timed(of):
    ratios = of.bench_ratios(of.AVX512)
    batches = [ratios[rays, "occluded", "antumbra", "batch"] for rays in ("shadow", "diffuse")]
    packets = [ratios[rays, "occluded", "antumbra", "batch"] / ratios[rays, "occluded", "embree-packets", "batch"] for rays in ("shadow", "diffuse")]
    yield PERFORMANCE, f"![Speedups of batches: {two(batches, 1)} over Embree one ray per call, {two(packets, 1)} over packets"
    rows = of.document("zen4-2026-11-24-two-levels.json")["rows"]
    level = lambda api: [
        r["ratio_to_embree"] for r in rows
        if (r["engine"], r["query"], r["api"]) == ("antumbra", "occluded", api) and r["rays"] in ("shadow", "diffuse")
    ]
    yield PERFORMANCE, f"occlusion gains more: {two(level('batch'), 1)} in batches, {two(level('single'), 1)} one ray at a time"
    wrong = lambda *names: max(
        (100 * r["disagreements"] / r["ray_count"], r["scene"])
        for name in names for r in of.document(name)["rows"] if r["engine"].startswith("embree")
    )
    (six, _), (more, scene) = wrong(of.AVX512, of.AVX2), wrong("zen4-2026-11-24-two-levels.json")
    for page in (PERFORMANCE, BENCH):
        yield page, (
            f"for at most {math.ceil(10 * six) / 10:.1f} % of the rays of a scene, "
            f"and with instances and cut-outs for {more:.1f} % of the closest hits in {scene}"
        )
    jobs = {name: float(cells[5]) for name, cells in texts.jobs().items()}
    suns = two([v for k, v in jobs.items() if k.startswith("sun")], 1)
    yield PERFORMANCE, (
        f"viewshed {jobs['viewshed']:.0f}, closest points {jobs['closest']:.1f}, sun {suns}, lidar {jobs['lidar']:.1f}, "
        f"most others about 1, foliage {jobs['foliage']:.2f}"
    )
    whole, flat = of.mean(jobs.values()), of.mean(v for k, v in jobs.items() if k != "viewshed")
    yield PERFORMANCE, f"The geometric mean is {whole:.2f}"
    yield BENCH, f"The geometric mean of the speedups is {whole:.2f}, and {flat:.2f} without the viewshed"
    steps = [("binned-sah", "area", "simple"), ("reinsertion", "area", "simple"), ("reinsertion", "learned", "simple"), ("reinsertion", "learned", "joint")]
    kinds = [of.Rows(of.record(of.LAB10), rays) for rays in ("shadow", "ao")]
    (a, b, c), (d, e, f) = ([f"{rows.gain(*to, base):.2f}" for base, to in zip(steps, steps[1:])] for rows in kinds)
    yield PERFORMANCE, f"builder {a}, learned collapse {b} and order {c} for shadow rays; {d}, {e} and {f} for ambient occlusion"
    yield RESULTS, f"builder {a}, learned collapse {b} and order {c} for shadow rays, and {d}, {e} and {f} for ambient occlusion"
    rows = kinds[0]
    saves = lambda *to: [of.cost(rows.known[(s, *steps[0])]) / of.cost(rows.known[(s, *to)]) for s in rows.scenes]
    default, order = saves(*steps[3]), saves("binned-sah", "area", "joint")
    yield RESULTS, f"a factor of {two(default, 2)} in the cost of shadow rays, the order on an unlearned tree {two(order, 2)}"
    differ = [float(line.split("(")[1].split()[0]) for line in texts.lines(texts.CURVES) if "differ" in line]
    yield COSTS, f"Answers differ for {two(differ, 2)} % of the rays"
    yield COSTS, f"one ray per call, has {texts.few('occluded'):.2f}, and 16 rays in columns {texts.few('16 in columns'):.2f}"
    ms = lambda size: [texts.built(scene, "default")[size][0] for scene in ("sponza", "builtin:city")]
    yield COSTS, f"eight take {two(ms(8), 3)} ms, 360 take {two(ms(360), 2)} ms"
    copies = [copy for _, _, copy in texts.saved().values()]
    yield COSTS, f"relative to `clone` of the same value, which takes {two(copies, 0)} ms"
    frames = texts.frames(texts.LEARNING_FRAMES)
    learning = [row["learn"] for row in frames[1:] if row["learn"] > 0.1]
    yield COSTS, f"take {two(learning, 1)} ms together"
    quality = [row["quality"] for row in texts.frames()]
    yield COSTS, f"`quality` rises from {quality[0]:.2f} to {quality[-1]:.2f} in twelve frames"
    found = texts.group_speedups()
    of_group = lambda *words: ", ".join(f"{found[key]:.1f}" for word in words for key in found if key.startswith(word))
    yield BENCH, f"three cities of boxes | {of_group('sun, city 7000', 'sun, city 1500, --grid 12', 'sun, city 300')} |"
    yield BENCH, f"(half of it is the build), microcity | {of_group('sun, builtin:city', 'sun, microcity')} |"
    yield BENCH, f"all vertices of sponza | {of_group('sun, sponza, --vertices, June')} |"
    yield BENCH, f"a year in quarter hours, a city of boxes | {of_group('sun, city 1500, --grid 24')} |"
    yield BENCH, f"few suns: a city of boxes, sponza | {of_group('sun, city 1500, --grid 4', 'sun, sponza, --vertices, --sky')} |"
    yield BENCH, f"145 patches, few suns, a scan | {of_group('sun, a scan')} |"
    yield BENCH, f"a scan with shuffled vertices, sponza, a city | {of_group('ao, the scan', 'ao, sponza', 'ao, city')} |"
    yield BENCH, f"by 160 000 points | {of_group('visible, city 1500, 3000')}; {of_group('visible, city 1500, 20')} |"
    scenes = [
        {(r["kind"], r["query"], r["api"]): r["ratio_to_embree"] for r in of.document(f"zen4-2026-11-24-kinds-{s}.json")["kinds"] if r["engine"] == "antumbra"}
        for s in ("sponza", "city")
    ]
    for name, key in (("refit", ("refit", "update", "single")), ("`closest`", ("points", "closest", "single")), ("`closest`, batch, one thread", ("points", "closest", "batch"))):
        yield BENCH, f"| {name} | " + " | ".join(f"{scene[key]:.2f}" for scene in scenes) + " |"


def baked(of):
    bakes = of.document("zen4-2026-11-24-bakes.json")
    sun, ao = bakes["sun"], bakes["ao"]
    matrix = sun["sensors"] * math.ceil(sun["suns"] / 8) / 1e6
    yield BAKING, f"A city of {spaced(sun['triangles'])} triangles, {spaced(sun['sensors'])} sensors in the middles of triangles chosen at random, the {sun['suns']} suns"
    yield BAKING, f"| {spaced(sun['rays'])} | {bakes['sun_cpu_seconds']:.0f} s | {int(matrix)} MB |"
    yield BAKING, f"Their mean sky view is {sun['mean_sky_view']:.2f}"
    short = lambda value: "0" if value == 0 else f"{value:.0e}".replace("e-0", "e-")
    for key, suns in (("compare_same_suns", "the program"), ("compare_own_suns", "pvlib")):
        compared = bakes[key]
        cells = [short(value) for value in compared["largest_relative_differences"].values()]
        yield BAKING, f"| {compared['sensors']} | of {suns} | " + " | ".join(cells) + " |"
    own, same = bakes["compare_own_suns"], bakes["compare_same_suns"]
    yield BAKING, f"differ from ours by up to {own['largest_difference_of_sun_degrees']:.5f} degrees"
    yield BAKING, f"{own['different_rays']} rays of {spaced(own['rays'])} differ in all"
    yield BAKING, f"{same['different_rays']} rays of {spaced(same['rays'])} have other answers"
    yield BAKING, f"Four scans of {spaced(ao['triangles'])} triangles, {ao['samples']} samples at each of {spaced(ao['vertices'])} vertices"
    with open(os.path.join(ROOT, "fields/bake/tests/all/reference/sun.csv")) as file:
        sensors = [line.split(",") for line in file.read().split("surface")[0].splitlines()[2:]]
    hours = sum(int(row[1]) for row in sensors)
    yield BAKING, f"hours of sun, {len(sensors)} sensors together | | {spaced(hours)} | 1 hour"
    seconds = bakes["ao_cpu_seconds"]["one_thread"]
    yield BAKING, f"| {spaced(ao['rays'])} | {seconds:.0f} s | {ao['learned']['speedup']:.2f} times as fast on held-out rays |"


def packages(of):
    closed, outside = of.document(of.PYTHON[0])["rows"], of.document(of.PYTHON[1])["rows"]
    share = lambda rows, scene, kind: next(100 * r["hit_share"] for r in rows if (r["scene"], r["kind"]) == (scene, kind))
    hits = [
        f"{scene} sun {share(rows, scene, 'sun'):.0f}%, ao {share(rows, scene, 'ao'):.0f}%"
        for rows, scene in ((closed, "city"), (closed, "terrain"), (outside, "hills"))
    ]
    yield PYTHON, "Rays that hit something: " + "; ".join(hits)
    found = of.python_speedups()
    theirs, over = found["antumbra occluded", "trimesh intersects_any"], found["antumbra occluded", "embreex OCCLUDED"]
    adds = [a / b for a, b in zip(theirs, over)]
    yield PYTHON, f"what trimesh adds to embreex: {adds[0]:.1f} on closed scenes, {adds[1]:.1f} on the open one"
    two_threads = [row["sun_and_ao"] for row in of.document("zen4-2026-11-24-python-two-threads.json")["speedups"]]
    yield PYTHON, "where `occluded` is {:.1f} times and `intersect` {:.1f} times Open3D".format(*two_threads)


def moving(of):
    times = re.findall(r"occluded_batch +([\d.]+) ns.*\n.*nothing moves +([\d.]+) ns", "\n".join(texts.lines(texts.MOTION)))
    more = [float(at_times) / float(still) for at_times, still in times]
    meshes, instances = more[:3], more[3:]
    yield MOVING, f"Moving meshes take {min(meshes):.1f} to {max(meshes):.1f} times as long"
    yield MOVING, f"Instances take {min(instances):.1f} to {max(instances):.1f} times as long"


def of_the_atlas():
    seen = atlas.rows("viewshed")["antumbra"]["old-town"]["seen"]
    yield ATLAS, f"In the old town the eyes see {100 * seen:.1f} % of the cells"
    cells = atlas.mountains(500)["cells computed for a cell"]
    yield "docs/src/python/many-machines.md", f"In the mountains, workers compute {cells:.1f} cells for each cell of the result"


# The source of each figure that is not computed above: (text of the page, file or one of KINDS, what the file has).
SOURCES = {
    MOVING: [
        ("squeezed by 10 000 or more", "setting"),
        ("Of 16 384 rays", "science/bench/src/calls/motion.rs", "RAYS: usize = 1 << 14"),
        ("at least 200 000 triangles", "science/bench/src/calls/motion.rs", "builtin:city:200000"),
        ("each instance 5120", "science/bench/src/calls/motion.rs", "icosphere(4)"),
    ],
    ATLAS: [
        ("GeoTIFFs in EPSG:32633", "bench/atlas/terrains.py", "EPSG:32633"),
        ("400 horizons and 1000 lines of sight for each terrain", "setting"),
        ("2000 m from the lowest to the highest cell", "bench/atlas/terrains.py", "fractal(n, 4.0, 1) * 2000"),
        ("more than 0.1 and by more than 1 degree", "setting"),
        ("Four eyes, 1.7 above the cells", "bench/atlas/tools.py", "EYE = 1.7"),
        ("azimuth 112.5 and 25 degrees high, and at azimuth 247.5", "bench/atlas/atlas.py", "((112.5, 25.0), (247.5, 12.0))"),
    ],
    "docs/src/gallery/standard.md": [
        ("CC BY 3.0", "cited"),
        ("CC BY-SA 4.0", "cited"),
        ("differ by less than 1 %", "bench/record/xeon-2026-11-26-pbrt3-times.txt", "| -1.0 | -0.91"),
    ],
    "docs/src/beside-pbrt3.md": [
        ("and Antumbra 1.25", "pictures/render/src/surface/curve.rs", "CLEARANCE: f32 = 1.25"),
        ("with an aperture of one millimetre are 5 % darker", "unrecorded"),
        ("With six radii the difference is -0.08 %", "bench/record/zen3-2026-11-26-pbrt3.txt", "difference -0.075 %"),
    ],
    "README.md": [("1.89", "Cargo.toml", 'rust-version = "1.89"'), ("JCGT 5(2), 2016", "cited"), ("Version 0.1", "Cargo.toml", 'version = "0.1.0"')],
    RESULTS: [
        ("node tests + 0.15 primitive tests", "bench/tables/records.py", "PRIM = 0.15"),
        ("50 000 rays of each kind", "setting"),
        ("a bootstrap interval over scenes (95 %)", "defined"),
        ("learn from about 1 % of the shadow rays", "setting"),
        ("8192 training rays, 16 000 held-out rays of each kind", "setting"),
        ("100 frames of 4096 shadow rays", "setting"),
        ("saves 2 % of the cost of shadow rays, and 5 % of the cost of ambient", "unrecorded"),
        ("save 5 % and 2 %, if they cost nothing", "unrecorded"),
        ("save 22 % of the cost of shadow rays there", "unrecorded"),
        ("8 wide, 10 000 held-out rays of each kind", "setting"),
        ("The sample of 4096 rays", "setting"),
    ],
    LONG: [
        ("SCENES, 8 wide, 20 000 rays of each kind", "setting"),
        ("whole pictures gain up to 1.2 |", "cited"),
    ],
    PERFORMANCE: [("32 768 of each kind", "setting")],
    BENCH: [
        ("32 KiB of L1 and 1 MiB of L2", "cited"),
        ("32 768 of each kind", "setting"),
        ("a city of 3000 boxes", "setting"),
        ("a tree of 4 million triangles", "setting"),
        ("a city of 267 200 triangles", "setting"),
        ("all pairs of 2000 points", "setting"),
        ("10 000 copies of a torus of 2304 triangles, seen in a picture of 1000 x 1000", "setting"),
        ("with 16 384 rays, 4096 training rays", "setting"),
        ("3000 points by 3000; 20 observers", "setting"),
    ],
    REPLICATION: [
        ("JCGT 5(2), 2016", "cited"),
        ("renderings up to 10 % faster", "cited"),
        ("from about 1 % of the shadow rays", "cited"),
        ("1 % of the shadow rays | the same", "setting"),
        ("1 and 0.15; the preset today", "setting"),
        ("Of 36 163 node entries", "unrecorded"),
        ("52 % in the paper", "cited"),
        ("shadow rays of sponza are 52 % of all rays", "cited"),
        ("N_b is 2 % lower from the ground and from an arcade, and 26 % lower across", "unrecorded"),
        ("a C_p of 0.15 saves", "setting"),
        ("learned with 0.15", "setting"),
        ("whole pictures gain up to 1.2 |", "cited"),
    ],
    COSTS: [
        ("batches of 1000 rays", "setting"),
        ("240,000 segments", "setting"),
        ("Fewer than 1000 triangles are not learned", "setting"),
        ("4000 panes of glass", "science/bench/src/calls/transmission.rs", "const PANES: usize = 4000;"),
        ("1 555 200 triangles", "bench/record/" + texts.SAVED, "8 children: 1555200 triangles"),
        ("pages of 4 KiB", "cited"),
        ("164 MB of memory and 84 MB in a file", "bench/record/" + texts.SAVED, "164 MB of memory, 84 MB of file"),
        ("within 1 % of the diagonal", "setting"),
        ("968 000 triangles in 1000 objects", "bench/record/" + texts.FRAMES, "968000 triangles in 1000 objects"),
        ("a sample of 4096 rays", "setting"),
        ("4 bytes per geometry and instance", "defined"),
    ],
    EMBREE: [
        ("rays of 1024 points; the rays of 3072 others", "bench/embree-order/rays.py", "TRAINING = 1024"),
        ("a bootstrap interval over scenes (95 %)", "defined"),
        ("The bar that was set before the measurement was 1.05", "setting"),
    ],
    PYTHON: [
        ("glibc of 2014", "defined"),
        ("12 bytes for each vertex and 12 for each triangle", "defined"),
        ("From 32 directions and 16 385 rays on", "setting"),
        ("4 million rays, one thread", "bench/record/zen3-2026-11-26-python-groups.txt", "--rays 4000000"),
        ("1.25 is a quarter along", "defined"),
        ("takes about 350 bytes, as `sys.getsizeof(tree)` counts", "defined"),
    ],
    "docs/src/python/many-machines.md": [
        ("a rim around chunks of 256 x 256 cells", "bench/atlas/tools.py", "chunks of 256 x 256 cells"),
        ("wrong by more than 0.1 and 1 degree", "bench/tables/atlas.py", "over 0.1"),
    ],
    BAKING: [
        ("a texture of 2048 x 2048 texels", "setting"),
        ("From 50 million rays on", "fields/bake/src/jobs/learn.rs", "const LEAST: u64 = 50_000_000;"),
        ("the published example of NREL to 0.0001 degrees", "fields/bake/src/sun/position.rs", "found.elevation - 50.11162).abs() < 1e-4"),
        ("from 1.5 hours", "cited"),
        ("in steps of 10 minutes or less", "cited"),
        ("1.2 m above the floor and 0.3 m above the sill", "cited"),
        ("k, by default 0.13 (Gauss)", "fields/bake/src/sight/curvature.rs", "REFRACTION: f64 = 0.13;"),
        ("by default 6 371 008.8 m", "fields/bake/src/sight/curvature.rs", "EARTH_RADIUS: f64 = 6_371_008.8;"),
        ("less than 1e-12 count as equal", "fields/terrain/src/viewshed/sector.rs", "GRAZING: f64 = 1e-12;"),
        ("differ by 1.9 degrees at Munich", "pictures/raster/src/crs.rs", "(near.north + 1.91).abs() < 0.01"),
        ("Web Mercator (EPSG:3857)", "defined"),
        ("differ by more than 2 %", "pictures/raster/src/crs.rs", "MOST_STRETCH: f64 = 0.02;"),
        ("at 48 degrees are 1.5 times", "pictures/raster/tests/rasters/expected.txt", "are 1.500 times as long as on the ground at 48.14"),
        ("29 997 lines | wrong cells, of 4548 visible", "unrecorded"),
        ("| `antumbra visible` | 0 | 0.03 |", "unrecorded"),
        ("| `gdal_viewshed` | 695 | 0.43 |", "unrecorded"),
        ("| 693 | 27.6, with its compilation |", "unrecorded"),
        ("| 2000 x 2000 cells, one observer | 0.35 | 0.22 |", "unrecorded"),
        ("| 2000 x 2000 cells, 1000 observers | 46.7 | 220 |", "unrecorded"),
        ("| 5000 x 5000 cells, one observer | 2.1 | 0.59 |", "unrecorded"),
        ("| 5000 x 5000 cells, 1000 observers | 109 | 590 |", "unrecorded"),
        ("its time for 1000 observers is computed", "defined"),
        ("has 4 446 suns", "bench/record/zen3-2026-11-26-sun.csv", ",4446,"),
        ("to steps of 8 minutes", "setting"),
        ("take 6 minutes of CPU time", "bench/record/zen3-2026-11-26-sun.csv", "1106533,4446,2534133667,1.18,359.13"),
        ("each within 22.5 degrees", "defined"),
        ("the angle to less than 0.001 degrees", "fields/bake/src/sight/horizon_angles.rs", "in which the horizon is, to less than 0.001 degrees"),
        ("| diffuse, level ground, kWh/m² | 219.04 | 219.04 | 0.00 % |", "fields/bake/tests/all/reference/sun.csv", "up,219.0351"),
        ("| diffuse, south wall | 199.49 | 200.43 | -0.47 % |", "fields/bake/tests/all/reference/sun.csv", "south,200.4296"),
        ("| 121.18, 125.03, 85.04 | 121.27, 125.17, 85.05 | -0.12 % at most |", "fields/bake/tests/all/reference/sun.csv", "west,125.1740"),
        ("| 0.05 % at most |", "fields/bake/tests/all/reference.rs", "(direct / expected[1] - 1.0).abs() < 5e-4"),
        ("Howell, Menguc and Siegel, equation 4.14", "cited"),
        ("catalogue to 1e-3 with 262 144 samples", "fields/bake/src/sight/view_factors.rs", "error < 1e-3"),
    ],
    RELIABILITY: [
        ("75 175 637 executions", "defined"),
        ("| 1000 copies: 130 rendered, 870 refused |", "unrecorded"),
        ("fuzzing with 1 GiB", "fuzz/run", "-rss_limit_mb=1024"),
        ("largest process: 101 MiB", "unrecorded"),
        ("362 818 executions", "defined"),
        ("4.9 million rays", "unrecorded"),
        ("8000 forged files", "pictures/render/src/resume/archive.rs", "of 8000 were refused"),
        ("16 GiB", "pictures/pbrt/src/ply/mod.rs", "const LIMIT: u64 = 1 << 34;"),
        ("at most 1040 times the file", "pictures/image/src/png.rs", "MAX_INFLATION: u64 = 1040;"),
        ("at most 2048 times the file", "pictures/image/src/exr.rs", "MAX_INFLATION: u64 = 2048;"),
        ("2 GiB of text per file", "pictures/pbrt/src/source.rs", "MAX_TEXT: u64 = (u32::MAX / 2) as u64;"),
        ("64 deep, 100 000 in all", "pictures/pbrt/src/parser.rs", "MAX_INCLUDES: usize = 100_000;"),
        ("| nested blocks | 10 000 |", "pictures/pbrt/src/builder/blocks.rs", "MAX_BLOCKS: usize = 10_000;"),
        ("256 bytes per stored triangle, 128 per pixel", "pictures/load/src/estimate.rs", "const PER_TRIANGLE: u64 = 256;"),
        ("takes 39 bytes per pixel", "unrecorded"),
        ("5 seconds or 1 GiB for one input", "fuzz/run", "-timeout=5 -rss_limit_mb=1024"),
        ("| 170 | 242 338 |", "unrecorded"),
        ("| 170 | 27 349 728 |", "unrecorded"),
        ("| 170 | 5 299 324 |", "unrecorded"),
        ("| 170 | 25 172 448 |", "unrecorded"),
        ("| 170 | 9 513 406 |", "unrecorded"),
        ("| 170 | 6 904 708 |", "unrecorded"),
        ("| 170 | 305 097 |", "unrecorded"),
        ("| 170 | 388 588 |", "unrecorded"),
        ("57 721 executions", "unrecorded"),
        ("54 046 605 executions", "unrecorded"),
        ("more than 101 MiB", "unrecorded"),
        ("| three seeds | 15 | 1 972 192 |", "unrecorded"),
        ("| one seed, with curves | 150 | 6 940 416 |", "unrecorded"),
        ("| under valgrind, without curves | 20 | 79 360 |", "unrecorded"),
        ("| 240 | 25 083 | nothing |", "unrecorded"),
        ("| 270 | 7 055 | no invalid access", "unrecorded"),
        ("| 3600 | 1 591 139 | nothing |", "unrecorded"),
        ("within 10 seconds of CPU time", "interfaces/cli/tests/cli/damaged.rs", "const SECONDS: u32 = 10;"),
        ("rods and bars to 1 : 100 000 and needles to 1 : 1000", "setting"),
        ("CI compares 20 million answers", "unrecorded"),
        ("of 1 008 549 888 answers on 2026-11-24", "unrecorded"),
        ("Jakob and Humphreys 2016, 3.9", "cited"),
        ("bars of 1 : 10 to 1 : 10 000 under", "setting"),
        ("the truncated series within 1.2 %", "pictures/render/tests/all/scales.rs", "series, 0.012,"),
        ("checkpoints every 50 ms", "tests/interruptions", "--checkpoint-every 50ms"),
        ("within 5 seconds, a rendering with 75", "setting"),
        ("takes 26 bytes per pixel, or 50 with", "pictures/render/src/film/sums.rs", "26 bytes per pixel, 50 with the sums"),
        ("A picture of 1920 x 1080 pixels needs 66 MB", "unrecorded"),
        ("at most 26 or 50 bytes per pixel", "pictures/render/src/film/sums.rs", "26 bytes per pixel, 50 with the sums"),
        ("the batch of 4096 samples", "pictures/render/src/film/tile.rs", "BATCH: usize = 4096;"),
        ("limits of 64 MiB to 8 GiB, a control group of 256 MiB", "setting"),
        ("at most 46 MiB over `--max-memory`", "unrecorded"),
        ("with 60 cases, 875 s; 127 991 808 answers in closed bodies, 36 s", "unrecorded"),
        ("`kernel` 600 s, `world`, `saved`, `pbrt`, `gltf` 120 s each", "setting"),
        ("did not end in 8 minutes", "unrecorded"),
        ("on needles 100 long and 0.01 wide", "setting"),
        ("Bodies of 1 : 100 000 are tested", "setting"),
        ("thinner than 1 : 10 000", "setting"),
    ],
}
