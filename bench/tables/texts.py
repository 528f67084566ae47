"""Tables from the records that are plain text: each function returns a head and rows of cells."""

import csv
import os
import re
import statistics

RECORDS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "record")


def lines(name):
    with open(os.path.join(RECORDS, name)) as file:
        return file.read().splitlines()


CALLS, CURVES = "zen3-2026-11-26-calls.txt", "zen3-2026-11-26-curves.txt"
BUILDS, SAVED = "zen3-2026-11-25-builds.txt", "zen3-2026-11-25-saved.txt"
POINTS, GROUPS, JOBS = "zen3-2026-11-25-points.txt", "zen3-2026-11-25-groups.txt", "zen3-2026-11-26-jobs.txt"
FRAMES, LEARNING_FRAMES = "zen4-2026-11-24-frame-loop.txt", "zen3-2026-11-25-frame-loop.txt"


def spaced(number):
    return f"{number:,}".replace(",", " ") if number > 9999 else str(number)


def timed(name):
    """Nanoseconds and the ratio of rows `scene rays call  N ns  R`, by scene and rays, in the order of the record."""
    found = {}
    for line in lines(name):
        row = re.match(r"(\S+) +(\S+) +(\S.*?) +([\d.]+) ns +([\d.]+)", line)
        if row:
            found.setdefault((row[1], row[2]), []).append((row[3], float(row[4]), float(row[5])))
    return found


def ratio(name, scene, rays, call, after=None):
    """The ratio of a call; a call that appears twice is the one behind `after`."""
    rows = timed(name)[scene, rays]
    names = [row[0] for row in rows]
    return rows[names.index(call, names.index(after) if after else 0)][2]


PLACES = [("sponza", "ao"), ("sponza", "shadow"), ("sibenik", "ao"), ("sibenik", "shadow")]


def conditions():
    """Time of batches with conditions over plain batches: the ratios of the record are of times here."""
    calls = [
        ("`occluded` with a mask", "occluded, mask"),
        ("`occluded` with `except`", "occluded, except"),
        ("`occluded` with a filter", "occluded, filter"),
        ("`occluders`", "occluders"),
        ("`intersect` with a mask", "intersect, mask"),
        ("`intersect` with a filter", "intersect, filter"),
        ("`surfaces`, over `intersect`", "surfaces"),
    ]
    rows = [[name] + [f"{ratio(CALLS, *place, call):.2f}" for place in PLACES] for name, call in calls]
    return ["", "sponza: ambient occlusion", "shadow", "sibenik: ambient occlusion", "shadow"], rows


def curves():
    calls = [("`occluded`, one by one", "occluded"), ("`occluded`, batch", "batch.occluded"), ("`intersect`, batch", "batch.intersect")]
    places = [(scene, rays) for scene in ("fur", "hair") for rays in ("camera", "ao", "shadow")]
    rows = [[name] + [f"{ratio(CURVES, *place, call):.2f}" for place in places] for name, call in calls]
    return ["", "fur: camera", "ambient occlusion", "shadow", "long hair: camera", "ambient occlusion", "shadow"], rows


MOTION = "zen3-2026-11-26-motion.txt"


def motion():
    calls = ["occluded_batch", "occluded", "intersect_batch", "intersect"]
    head = ["scene, two keys", "`occluded`, batch", "`occluded`", "`intersect`, batch", "`intersect`"]
    rows = []
    for line in lines(MOTION):
        city = re.match(r"city, moved by ([\d.]+) of its size", line)
        instances = re.match(r"(\d+) instances", line)
        row = re.match(r"  (\w+) +[\d.]+ ns +([\d.]+)", line)
        if city:
            rows.append([f"city, bent by {100 * float(city[1]):g} % of its size", *[""] * len(calls)])
        elif instances:
            rows.append([f"{instances[1]} instances that turn and move", *[""] * len(calls)])
        elif row and row[1] in calls:
            rows[-1][1 + calls.index(row[1])] = row[2]
    return head, rows


def few(call):
    """Geometric mean over scenes and rays of the rate relative to `rtcOccluded1`."""
    return statistics.geometric_mean(ratio(CALLS, *place, call) for place in PLACES)


SIZES = [1, 2, 4, 8, 12, 16, 24, 32, 64, 256, 1000, 16384]


def few_rays():
    ours = [f"{few(f'batch of {size}'):.2f}" for size in SIZES]
    theirs = [f"{few(f'rtcOccluded{size}'):.2f}" if size in (4, 8, 16) else "" for size in SIZES]
    head = ["rays in a call"] + [spaced(size) for size in SIZES]
    return head, [["`occluded`, batch", *ours], ["Embree's packets", *theirs]]


def built(scene, recipe):
    """Milliseconds, and the time over Embree's, of builds, by the number of triangles."""
    found = (re.match(rf"{scene} +(\d+) triangles, {recipe} +([\d.]+) ms +([\d.]+)", line) for line in lines(BUILDS))
    return {int(row[1]): (float(row[2]), float(row[3])) for row in found if row}


def recipes():
    rows = []
    for name, recipe in (("`Recipe::fast()`", "fast"), ("`Recipe::default()`", "default")):
        sponza, city = ({size: over for size, (_, over) in built(scene, recipe).items()} for scene in ("sponza", "builtin:city"))
        cells = [f"{sponza[size]:.2f}, {city[size]:.2f}" for size in (8, 360, 10000)]
        rows.append([name, *cells, f"{sponza[66455]:.2f}, {city[100000]:.2f}", f"{city[511908]:.2f}"])
    return ["triangles", "8", "360", "10 000", "66 455, 100 000", "511 908"], rows


def visits():
    places = PLACES + [("builtin:city", "ao"), ("builtin:city", "shadow")]
    head = ["sponza: ambient occlusion", "shadow", "sibenik: ambient occlusion", "shadow", "city: ambient occlusion", "shadow"]
    return head, [[f"{ratio(CALLS, *place, 'batch.visit_hits'):.2f}" for place in places]]


def saved(children=8):
    """Milliseconds, the time over a copy, and the time of the copy, of each call."""
    found, inside = {}, False
    for line in lines(SAVED):
        inside = line.startswith(f"{children} children") or inside and "children" not in line
        row = re.match(r"(\S+) +([\d.]+) ms +([\d.]+) of a copy, +([\d.]+) ms", line)
        if inside and row:
            found[row[1]] = tuple(map(float, row.groups()[1:]))
    return found


def saving():
    more = {"Bvh::write": " into a vector", "Bvh::read": " from a slice"}
    rows = [[f"`{call}`{more.get(call, '')}", f"{ms:.0f}", f"{over:.2f}"] for call, (ms, over, _) in saved().items()]
    return ["call", "ms", "over a copy"], rows


def points():
    scenes = ["sponza", "sibenik", "bathroom", "builtin:city"]
    names = [("uniform in the bounds", "uniform"), ("near surfaces", "surface"), ("a grid of 64³", "grid")]
    rows = [
        [name] + [f"{ratio(POINTS, scene, kind, call):.2f}" for scene in scenes for call in ("closest", "closest_batch")]
        for name, kind in names
    ]
    head = ["points"]
    for scene in scenes:
        head += [f"{scene.replace('builtin:', '')}: `closest`", "batch"]
    return head, rows


def frames(name=FRAMES):
    """The numbers of each frame, by the names of their columns."""
    titles, found = [], []
    for line in lines(name):
        if line.startswith("frame "):
            titles = line.split()
        elif re.match(r" +\d+ ", line):
            found.append(dict(zip(titles, map(float, line.split()[: len(titles)]))))
    return found


def frame():
    """A usual frame: medians; frames that learned are apart, and shadow rays come before and after learning."""
    found = frames()
    learned = [row for row in found if row["learn"]]
    usual = [row for row in found if not row["learn"]]
    middle = lambda rows, key: f"{statistics.median(row[key] for row in rows):.0f}"
    rows = [
        ["new vertices, by the program", middle(found, "vertices")],
        ["`World::refit`: boxes, leaf blocks and the top level", middle(found, "refit")],
        ["`World::relearn` from one of fifty shadow rays", middle(learned, "learn")],
        ["307 200 camera rays", middle(found, "camera")],
        ["shadow rays of what they hit", f"{middle(usual, 'shadows')}, after learning {middle(learned, 'shadows')}"],
    ]
    return ["step", "ms of CPU"], rows


def jobs():
    """The cells of each job: million rays, ours, build, Embree's, build, ratio, answers that differ."""
    pattern = r"(\S+) +([\d.]+) +([\d.]+) \(([\d.]+)\) +([\d.]+) \(([\d.]+)\) +([\d.]+) +(\d+) of"
    found = (re.match(pattern, line) for line in lines(JOBS))
    return {row[1]: row.groups()[1:] for row in found if row}


JOB_NAMES = {
    "sun-street": "a year of sun by hours, 9578 points of streets",
    "sun-roofs": "the same, 6968 points of roofs",
    "sun-hall": "the same, 8168 points of a floor, sponza",
    "sky-145": "sky view, 60 200 points of streets, 145 patches",
    "sky-577": "sky view, 43 111 points of walls, 577 patches",
    "ao-scan": "ambient occlusion, 134 345 vertices of a scan, 256 rays each",
    "ao-atlas": "ambient occlusion, 116 704 texels of a light map, 128 rays each",
    "visibility": "visibility matrix of 5000 points",
    "viewshed": "viewshed of 2 million points on 4 million triangles",
    "lidar": "depths of 50 lidar sweeps",
    "closest": "distances of 125 000 points from a scan",
    "foliage": "coloured shadows through 200 000 leaves",
}


def whole_jobs():
    rows = []
    for key, name in JOB_NAMES.items():
        rays, ours, build, theirs, their_build, speedup, differ = jobs()[key]
        times = [f"{float(a):.2f} ({float(b):.2f})" for a, b in ((ours, build), (theirs, their_build))]
        rows.append([name, f"{float(rays):.1f}", *times, speedup, differ])
    return ["job", "million rays or points", "ours, CPU s (build)", "Embree, CPU s (build)", "speedup", "answers that differ"], rows


def group_speedups():
    """Speedup of whole commands by groups, by the text of the row."""
    found = (re.match(r"((?:sun|ao|visible),.*?) +[\d.]+ +[\d.]+ +([\d.]+)$", line) for line in lines(GROUPS))
    return {row[1]: float(row[2]) for row in found if row}


def groups():
    found, rows = group_speedups(), []
    kinds = {
        "`sun`, a year, three cities of boxes": r"sun, city .* a year",
        "`sun`, a year or two months, other scenes": r"sun, (?!city).* in hours",
        "`sun`, few suns": r"sun, .*few suns",
        "`ao`, `visible`": r"(ao|visible), ",
    }
    for name, kind in kinds.items():
        speedups = [value for key, value in found.items() if re.match(kind, key)]
        rows.append([name, f"{min(speedups):.2f} to {max(speedups):.2f}"])
    return ["command", "speedup"], rows


def growth():
    """Millions of rays a second, by sensors and suns."""
    found = {}
    for line in lines(GROUPS):
        row = re.match(r"(\d+) +(\d+) +[\d.]+ +[\d.]+ +([\d.]+)$", line)
        if row:
            found.setdefault(int(row[1]), {})[int(row[2])] = float(row[3])
    suns = (128, 4446, 33373)
    rows = [[spaced(sensors)] + [f"{own[n]:.0f}" if n in own else "" for n in suns] for sensors, own in found.items()]
    return ["sensors"] + [f"{spaced(n)} suns" for n in suns], rows


def sun_growth():
    """How the cost of `sun` grows with sensors and suns."""
    spaced = lambda number: f"{int(number):,}".replace(",", " ")
    rows = []
    for row in csv.DictReader(line for line in lines("zen3-2026-11-26-sun.csv") if not line.startswith("#")):
        rays = int(row["rays"]) / 1e6
        cells = [spaced(row["sensors"]), spaced(row["suns"]), f"{rays:.0f}" if rays >= 10 else f"{rays:.2f}"]
        rows.append([row["scene"], *cells, row["cpu_seconds"], row["mrays_per_s"]])
    return ["scene", "sensors", "suns", "million rays", "CPU s", "Mray/s"], rows


def cells(name):
    """The rows of a record that is a table of Markdown, without its head."""
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines(name) if line.startswith("|")]
    return rows[2:]


def python_groups():
    found = {row[0]: row[3] for row in cells("zen3-2026-11-26-python-groups.txt")}
    names = {"32 suns": "32 suns", "64 suns": "64 suns", "sky of 145 patches": "sky of 145", "2000 suns": "2000 suns"}
    return ["directions", "city", "hills"], [[name, found[f"city, {key}"], found[f"hills, {key}"]] for name, key in names.items()]


def python_machines():
    rows = cells("zen3-2026-11-26-python-machines.txt")
    head = ["rays of a task", "CPU seconds of a task", "dask", "joblib", "a process for each task, as Slurm's arrays start"]
    return head, [[rays, f"{float(seconds):.2g}", *(f"{float(cell):.1f}" for cell in rest)] for rays, seconds, *rest in rows]


TABLES = {
    "conditions": conditions,
    "curves": curves,
    "motion": motion,
    "few-rays": few_rays,
    "recipes": recipes,
    "visits": visits,
    "saved": saving,
    "nearest-points": points,
    "frame": frame,
    "jobs": whole_jobs,
    "groups": groups,
    "growth": growth,
    "sun-growth": sun_growth,
    "python-groups": python_groups,
    "python-machines": python_machines,
}
