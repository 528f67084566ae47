"""Threads, signals, progress, and other processes."""

import multiprocessing
import os
import pathlib
import signal
import subprocess
import sys
import textwrap
import threading
import time

import antumbra as am
import numpy as np
import pytest
from brute import soup

RNG = np.random.default_rng(11)
VERTICES, FACES = soup(RNG, 20_000, 0.2)
SCENE = am.Scene(VERTICES, FACES)
SCENE_CORNERS = VERTICES.astype(np.float32).astype(float)[FACES]
"""Corners of the triangles, rounded as the scene has them."""
ORIGINS, DIRECTIONS = RNG.uniform(-1.5, 1.5, (60_000, 3)), RNG.normal(size=(60_000, 3))


def answers(_=None):
    return SCENE.occluded(ORIGINS, DIRECTIONS, threads=2)


def test_threads_are_chosen_by_call_and_for_all():
    before = am.get_threads()
    assert before >= 1
    am.set_threads(3)
    assert am.get_threads() == 3
    am.set_threads(None)
    assert am.get_threads() == before
    for wrong in (0, 100_000):
        with pytest.raises(ValueError, match="threads: found"):
            am.set_threads(wrong)


def test_points_and_normals_of_hits_let_other_threads_run():
    hits, done, count = SCENE.intersect(np.repeat(ORIGINS, 10, 0), np.repeat(DIRECTIONS, 10, 0)), threading.Event(), [0]

    def tick():
        while not done.is_set():
            count[0] += 1
            time.sleep(0)

    # Threads change only where one lets go.
    before = sys.getswitchinterval()
    sys.setswitchinterval(1000)
    other = threading.Thread(target=tick)
    other.start()
    try:
        for name in ("point", "normal"):
            then = count[0]
            getattr(hits, name)
            assert count[0] > then, name
    finally:
        done.set()
        sys.setswitchinterval(before)
        other.join()
    # As one thread computes them from the corners.
    a, b, c = (SCENE_CORNERS[hits.triangle[hits.hit], corner] for corner in range(3))
    u, v = hits.uv[hits.hit].astype(float).T[..., None]
    np.testing.assert_allclose(hits.point[hits.hit], (1 - u - v) * a + u * b + v * c, rtol=1e-12, atol=1e-12)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    np.testing.assert_allclose(hits.normal[hits.hit], normals, atol=1e-6)
    assert np.isnan(hits.point[~hits.hit]).all() and np.isnan(hits.normal[~hits.hit]).all()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_scenes_survive_fork():
    expected = answers()
    with multiprocessing.get_context("fork").Pool(2) as pool:
        found = pool.map_async(answers, range(4)).get(timeout=120)
    for each in found:
        np.testing.assert_array_equal(each, expected)
    np.testing.assert_array_equal(answers(), expected)


def occluded_there(scene):
    return scene.occluded(ORIGINS, DIRECTIONS)


def test_scenes_go_to_processes_that_know_nothing():
    joblib = pytest.importorskip("joblib")
    found = joblib.Parallel(n_jobs=2)(joblib.delayed(occluded_there)(SCENE) for _ in range(3))
    for each in found:
        np.testing.assert_array_equal(each, answers())


def test_dask_has_the_answers_of_one_process():
    distributed = pytest.importorskip("dask.distributed")
    pieces = np.array_split(np.arange(len(ORIGINS)), 8)
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            # A scene goes to the workers that are there.
            client.wait_for_workers(2)
            scene = client.scatter(SCENE, broadcast=True)

            def ask(scene, origins, directions):
                return os.getpid(), scene.occluded(origins, directions, threads=1)

            tasks = [client.submit(ask, scene, ORIGINS[piece], DIRECTIONS[piece]) for piece in pieces]
            found = client.gather(tasks)
            # Sent once to each worker: both have the same key.
            assert all(len(workers) == 2 for workers in client.who_has([scene]).values())
    assert {process for process, _ in found}.isdisjoint({os.getpid()})
    np.testing.assert_array_equal(np.concatenate([each for _, each in found]), answers())


def test_two_workers_beat_one_thread():
    """The program of docs/src/python/many-machines.md, with tasks of about a second."""
    distributed = pytest.importorskip("dask.distributed")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    if cores < 2 or (hasattr(os, "getloadavg") and os.getloadavg()[0] > cores - 0.5):
        pytest.skip("no two cores that are free")
    path = pathlib.Path(__file__).parents[3] / "bench" / "python" / "many_machines.py"
    program = {"__name__": "many_machines"}
    exec(compile(path.read_text(), path, "exec"), program)
    scene, best = am.Scene.from_file("builtin:city:20000"), 0
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            client.wait_for_workers(2)
            program["compare"](client, scene, 1000, 2)
            # Whatever else runs takes cores away: the best of some tries counts.
            for _ in range(5):
                alone, together, agree = program["compare"](client, scene, 5_000_000, 4)
                assert agree
                best = max(best, alone / together)
                if best > 1.5:
                    break
    assert best > 1.2


def test_dask_knows_the_size_of_scenes():
    sizeof = pytest.importorskip("dask.sizeof").sizeof
    assert sizeof(SCENE) == sys.getsizeof(SCENE) > 48 * len(FACES)
    assert sizeof(SCENE.intersect(ORIGINS, DIRECTIONS)) > 24 * len(ORIGINS)


def test_learning_goes_on_beside_other_work():
    done, seen, learned = threading.Event(), 0, []

    def work():
        learned.append(SCENE.learn(ORIGINS[:20_000], DIRECTIONS[:20_000], threads=1))
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.wait(0.001):
        assert SCENE.occluded(ORIGINS[0], DIRECTIONS[0]) in (True, False)
        seen += 1
    thread.join()
    assert seen > 10
    np.testing.assert_array_equal(learned[0].occluded(ORIGINS, DIRECTIONS), answers())


def test_other_threads_go_on_while_rays_are_traced():
    origins, directions = np.tile(ORIGINS, (20, 1)), np.tile(DIRECTIONS, (20, 1))
    for call in (SCENE.occluded, SCENE.intersect, SCENE.count):
        done, seen = threading.Event(), 0

        def work():
            call(origins, directions, threads=1)
            done.set()

        thread = threading.Thread(target=work)
        thread.start()
        while not done.wait(0.001):
            seen += 1
        thread.join()
        assert seen > 3


def test_many_threads_may_ask_one_scene():
    expected, found = answers(), [None] * 6

    def work(index):
        found[index] = answers()

    threads = [threading.Thread(target=work, args=(index,)) for index in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for each in found:
        np.testing.assert_array_equal(each, expected)


def test_progress_is_told_and_ends_at_the_total():
    told = []
    SCENE.occluded(np.zeros((700_000, 3)), [0, 0, 1], threads=1, progress=lambda done, total: told.append((done, total)))
    assert [done for done, _ in told] == sorted(done for done, _ in told)
    assert told[-1] == (700_000, 700_000) and len(told) > 1
    # Every point with every direction.
    SCENE.occluded(np.zeros((500, 1, 3)), np.ones((64, 3)), progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (32_000, 32_000)

    class Bar:
        total, n = None, 0

        def update(self, n):
            self.n += n

    bar = Bar()
    SCENE.count(np.zeros((700_000, 3)), [0, 0, 1], progress=bar)
    assert bar.n == bar.total == 700_000
    built = []
    am.Scene(*soup(RNG, 50_000, 0.1), progress=lambda done, total: built.append(done / total))
    assert built[-1] == 1


def test_an_exception_of_a_callback_ends_the_call():
    class Enough(Exception):
        pass

    def stop(done, total):
        raise Enough

    with pytest.raises(Enough):
        SCENE.occluded(np.zeros((700_000, 3)), [0, 0, 1], progress=stop)
    with pytest.raises(Enough):
        am.Scene(*soup(RNG, 400_000, 0.1), progress=stop)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(
    "work",
    [
        "scene.count(np.zeros((20_000_000, 3), np.float32), [0.1, 0.2, 1])",
        "scene.intersect(np.zeros((20_000_000, 3), np.float32), [0.1, 0.2, 1])",
        "am.Scene(*soup(rng, 3_000_000, 0.1))",
    ],
)
def test_ctrl_c_ends_long_work(work):
    program = f"""
        import signal, sys
        # A test run in the background of a shell has it ignored.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.path.insert(0, {os.path.dirname(__file__)!r})
        import antumbra as am, numpy as np
        from brute import soup
        rng = np.random.default_rng(0)
        scene = am.Scene(*soup(rng, 20_000, 0.5), quality="fast")
        print("ready", flush=True)
        try:
            {work}
        except KeyboardInterrupt:
            print("interrupted", flush=True)
        else:
            print("done", flush=True)
    """
    child = subprocess.Popen([sys.executable, "-c", textwrap.dedent(program)], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "ready\n"
    time.sleep(0.7)
    child.send_signal(signal.SIGINT)
    try:
        out, _ = child.communicate(timeout=120)
    finally:
        child.kill()
    assert out == "interrupted\n"
    assert child.returncode == 0


def test_cells_of_a_raster_may_be_cut_into_any_blocks_and_the_terrain_may_not():
    da = pytest.importorskip("dask.array")
    rng = np.random.default_rng(12)
    x, y = np.meshgrid(np.arange(70), np.arange(50))
    heights = 6 * np.sin(x / 6) * np.cos(y / 5) + rng.uniform(0, 2, x.shape)
    transform = (5.0, 0, 4_500_000, 0, -5.0, 5_400_000)
    terrain = am.Scene.from_heights(heights, transform)
    cells, normals = terrain.vertices.reshape(50, 70, 3), terrain.normals.reshape(50, 70, 3)
    suns, eye = rng.normal(size=(40, 3)) * [1, 1, 0.2] + [0, 0, 0.4], terrain.bounds.mean(0) + [0, 0, 20]
    jobs = {
        "sky": lambda at, up: terrain.sky_view(at, up, threads=1),
        "suns": lambda at, up: terrain.sun_hours(at, up, suns, 1, threads=1),
        "ao": lambda at, up: terrain.ambient_occlusion(at, up, 64, threads=1),
        "shade": lambda at, up: terrain.occluded(at + [0, 0, 0.01], suns[0], threads=1),
        "group": lambda at, up: terrain.occluded((at + [0, 0, 0.01])[:, :, None], suns, threads=1).sum(2),
        "seen": lambda at, up: terrain.visible(at + [0, 0, 1], eye, threads=1),
    }
    whole = {name: job(cells, normals) for name, job in jobs.items()}
    for chunks in [(50, 70, 3), (16, 23, 3), (1, 70, 3)]:
        blocks = [da.from_array(each, chunks=chunks) for each in (cells, normals)]
        for name, job in jobs.items():
            found = da.map_blocks(job, *blocks, drop_axis=2, dtype=whole[name].dtype, meta=np.array((), whole[name].dtype))
            np.testing.assert_array_equal(found.compute(scheduler="threads"), whole[name], err_msg=name)
    # A part of the terrain with a rim of ten cells around the cells in question.
    part = am.Scene.from_heights(heights[:30, :30], transform)
    cut = part.sky_view(*(each.reshape(30, 30, 3)[:20, :20] for each in (part.vertices, part.normals)))
    assert (cut != whole["sky"][:20, :20]).any()
