"""What a call may ask for: shapes without memory for them, and numbers of threads."""

import os
import subprocess
import sys
import time

import antumbra as am
import numpy as np
import pytest
from brute import soup

HEAD = """
import warnings
import antumbra as am
import numpy as np

warnings.simplefilter("ignore")
vertices, faces = [[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0.0]], [[0, 1, 2], [0, 2, 3]]
scene = am.Scene(vertices, faces)

def show(name, call):
    try:
        call()
        print(name, "nothing", flush=True)
    except BaseException as error:
        print(name, type(error).__name__, str(error), flush=True)
"""

SHAPES = HEAD + """
a, b, up = np.zeros((10**6, 1, 3)), np.ones((1, 10**6, 3)), [0, 0, 1]
many = np.broadcast_to(np.zeros(3), (10**12, 3))
row, column = np.broadcast_to(np.zeros(3), (2**31, 1, 3)), np.broadcast_to(np.zeros(3), (1, 2**31, 3))
numbers = np.broadcast_to(0.0, (10**12,))
words = np.lib.stride_tricks.as_strided(np.zeros(1, np.uint64), (10**12, 1), (0, 8))
flat = np.broadcast_to(np.float32(0), (10**6, 10**6))
for name, call in {
    "occluded": lambda: scene.occluded(a, b),
    "occluded_by_threads": lambda: scene.occluded(a, b, threads=2),
    "occluded_overflow": lambda: scene.occluded(row, column),
    "occluded_with_mask": lambda: scene.occluded(a, b, mask=1),
    "occluded_with_exclude": lambda: scene.occluded(a, b, exclude=0),
    "occluder": lambda: scene.occluder(a, b),
    "signed_distance": lambda: scene.signed_distance(many),
    "world": lambda: am.World([(vertices, faces)], np.broadcast_to(np.eye(4), (10**12, 4, 4))),
    "distinct": lambda: scene.count(a, b, distinct=True),
    "intersect": lambda: scene.intersect(a, b),
    "intersect_all": lambda: scene.intersect_all(a, b),
    "count": lambda: scene.count(a, b),
    "visible": lambda: scene.visible(a, b),
    "visible_overflow": lambda: scene.visible(row, column),
    "learn": lambda: scene.learn(a, b),
    "first_triangles": lambda: scene._first_triangles(a, b),
    "closest": lambda: scene.closest(many),
    "contains": lambda: scene.contains(many),
    "visibility": lambda: scene.visibility(a[:, 0], b[0]),
    "visibility_of_one_list": lambda: scene.visibility(a[:, 0]),
    "visibility_of_many": lambda: scene.visibility(many, many),
    "sees": lambda: scene.sees(many, None, [up]),
    "sees_many_directions": lambda: scene.sees([0, 0, 0], None, many),
    "ambient_occlusion": lambda: scene.ambient_occlusion(many, up),
    "ambient_occlusion_of_normals": lambda: scene.ambient_occlusion(many, many),
    "bent_normals": lambda: scene.ambient_occlusion(many, many, bent=True),
    "sky_view": lambda: scene.sky_view(many),
    "sun_hours": lambda: scene.sun_hours(many, None, [up]),
    "sun_hours_of_many_suns": lambda: scene.sun_hours([0, 0, 0], None, many),
    "irradiation": lambda: am.irradiation(scene, many, None, 48, 16, [0], 1, 1),
    "sun_positions": lambda: am.sun_positions(48, 16, numbers),
    "scene": lambda: am.Scene(many, faces),
    "scene_of_list": lambda: am.Scene([(many, faces)]),
    "scene_of_faces": lambda: am.Scene(vertices, np.broadcast_to([0, 1, 2], (10**12, 3))),
    "instances": lambda: am.Scene([(many, faces)], instances=[(0, np.eye(4))]),
    "texel_atlas": lambda: am.texel_atlas(many, faces, np.broadcast_to(np.zeros(2), (10**12, 2)), 4),
    "heat_map": lambda: am.heat_map(flat),
    "map": lambda: am.Map(flat, 1.0),
    "picture": lambda: am.Picture(np.broadcast_to(np.zeros(3), (10**6, 10**6, 3))),
    "words": lambda: am.BitMatrix(words, 64),
    "count_of_columns": lambda: am.BitMatrix(np.zeros((0, 10**12 // 64), np.uint64), 10**12).count(0),
    "weights": lambda: am.BitMatrix(np.zeros((0, 10**12 // 64), np.uint64), 10**12).sums(numbers),
}.items():
    show(name, call)
"""

# Lists that are long only together with what there is already: the memory of the process is limited.
LIMITED = HEAD + """
import resource

def limit(megabytes):
    with open("/proc/self/statm") as file:
        used = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + megabytes * 10**6, resource.RLIM_INFINITY))

am.set_threads(1)
rays = np.broadcast_to(np.float32(0.5), (10**7, 3))
hits = scene.intersect(rays, [0, 0, 1])
bits = am.BitMatrix(np.zeros((20_000, 313), np.uint64), 20_000)
steps, transforms = np.broadcast_to(np.zeros(3), (6 * 10**7, 3)), [(0, np.eye(4))] * 10**6
limit(50)
show("point", lambda: hits.point)
show("normal", lambda: hits.normal)
limit(200)
show("unpack", lambda: bits.unpack())
show("to_numpy", lambda: bits.to_numpy())
show("slice", lambda: bits[:15_000])
show("intersect", lambda: scene.intersect(steps, [0, 0, 1]))
show("intersect_all", lambda: scene.intersect_all(steps, [0, 0, 1]))
show("sensor_grid", lambda: scene.sensor_grid(0.0015))
show("texel_atlas", lambda: am.texel_atlas(vertices, faces, [[0, 0], [1, 0], [1, 1], [0, 1]], 16384))
show("instances", lambda: am.Scene([(vertices, faces)], instances=transforms))
show("learn", lambda: scene.learn(rays[:10**6], [0, 0, 1]))
"""


def shown(program):
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=600)
    assert run.returncode == 0, run.stdout + run.stderr
    lines = [line.split(" ", 2) for line in run.stdout.splitlines()]
    assert len(lines) == program.count("lambda")
    return lines


def test_shapes_that_no_memory_holds_are_errors():
    for name, kind, text in shown(SHAPES):
        assert kind == "MemoryError", (name, kind, text)
    text = shown(HEAD + 'show("many", lambda: scene.occluded(np.zeros((10**6, 1, 3)), np.ones((1, 10**6, 3))))')[0][2]
    assert text == "not enough memory for 1000000000000 answers: 1000000000000 bytes, 1000.000 GB"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is limited as Linux does it")
def test_results_that_no_memory_holds_are_errors():
    for name, kind, text in shown(LIMITED):
        assert kind == "MemoryError" and "not enough memory" in text, (name, kind, text)


def test_numbers_of_threads_are_checked():
    scene = am.Scene(*soup(np.random.default_rng(0), 20))
    for wrong in (-1, 0, 5000, 10**30, np.int64(-3)):
        for call in (lambda: scene.occluded([0, 0, 0], [0, 0, 1], threads=wrong), lambda: am.set_threads(wrong)):
            with pytest.raises(ValueError, match=f"threads: found {wrong}, wanted 1 to 4096"):
                call()
    with pytest.raises(TypeError):
        scene.occluded([0, 0, 0], [0, 0, 1], threads=1.5)
    assert scene.occluded([0, 0, 0], [0, 0, 1], threads=np.int64(2)) in (True, False)


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are counted as Linux does it")
def test_threads_of_numbers_that_nobody_asks_for_any_more_end():
    scene, points = am.Scene(*soup(np.random.default_rng(0), 20)), np.zeros((10, 3))
    inside, default = scene.contains(points), am.get_threads()
    before = len(os.listdir("/proc/self/task"))
    for threads in range(1, 40):
        np.testing.assert_array_equal(scene.contains(points, threads=threads), inside)
    # The pools of the default and of the last number stay. Others end as soon as the system lets them.
    most, deadline = before + 39, time.monotonic() + 60
    while (found := len(os.listdir("/proc/self/task"))) > most:
        assert time.monotonic() < deadline, f"{found} threads, wanted {most}"
        time.sleep(0.01)
    assert am.get_threads() == default
