"""What dask, joblib and processes of their own cost beside one thread, by the length of tasks.

    python bench/python/many_machines.py [--rays 200000,2000000,20000000] [--tasks 8] [--wall]

Runs the program of docs/src/python/many-machines.md on one thread, by two workers of dask, by two of joblib, and by one process for
each task, as an array of Slurm starts them. Prints the CPU seconds of all processes together relative to one thread, each with the
start of its workers where they start for the call, and without for dask, whose workers stay. CPU seconds do not depend on what
else a machine does. Two workers on two free cores are at most 2 / ratio times as fast as one thread.

--wall prints speedups by the clock as well: of two workers of dask over one thread, for a machine whose cores are free.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time

import antumbra as am
import numpy as np


def in_shade(scene, seed, rays, threads=1):
    """Number of random points between the buildings that the sun does not reach."""
    rng, count = np.random.default_rng(seed), 0
    low, high = scene.bounds.astype(np.float32)
    for first in range(0, rays, 1_000_000):
        points = rng.random((min(1_000_000, rays - first), 3), np.float32) * (high - low) + low
        count += int(scene.occluded(points, np.float32([0.3, 0.2, 0.9]), threads=threads).sum())
    return count


def cpu_of_children():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def compare(client, scene, rays, tasks):
    """Seconds of one thread and of the workers, the scene being sent again, and whether they agree."""
    start = time.perf_counter()
    alone = [in_shade(scene, seed, rays) for seed in range(tasks)]
    middle = time.perf_counter()
    sent = client.scatter(scene, broadcast=True, hash=False)
    found = client.gather([client.submit(in_shade, sent, seed, rays, pure=False) for seed in range(tasks)])
    return middle - start, time.perf_counter() - middle, found == alone


def cpu_of_dask(client, scene, rays, tasks):
    """CPU seconds of workers, scheduler and client, and the answers."""
    clock = lambda: time.process_time() + sum(client.run(time.process_time).values())
    start = clock()
    sent = client.scatter(scene, broadcast=True, hash=False)
    found = client.gather([client.submit(in_shade, sent, seed, rays, pure=False) for seed in range(tasks)])
    return clock() - start, found


def cpu_of_joblib(scene, rays, tasks):
    from joblib import Parallel, delayed
    from joblib.externals.loky import get_reusable_executor

    start = time.process_time() + cpu_of_children()
    found = Parallel(n_jobs=2)(delayed(in_shade)(scene, seed, rays) for seed in range(tasks))
    get_reusable_executor().shutdown(wait=True)
    return time.process_time() + cpu_of_children() - start, found


TASK = """
import sys
sys.path.insert(0, sys.argv[1])
import antumbra, many_machines
print(many_machines.in_shade(antumbra.Scene.load(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])))
"""


def cpu_of_processes(scene, rays, tasks):
    start = time.process_time() + cpu_of_children()
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "scene")
        scene.save(path)
        here = os.path.dirname(os.path.abspath(__file__))
        run = lambda seed: subprocess.run(
            [sys.executable, "-c", TASK, here, path, str(seed), str(rays)], check=True, capture_output=True, text=True
        )
        found = [int(run(seed).stdout) for seed in range(tasks)]
    return time.process_time() + cpu_of_children() - start, found


def main():
    from dask.distributed import Client, LocalCluster

    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--rays", default="200000,2000000,20000000", help="rays of a task, a list")
    options.add_argument("--tasks", type=int, default=8, help="tasks")
    options.add_argument("--wall", action="store_true", help="speedup by the clock as well")
    options = options.parse_args()
    scene = am.Scene.from_file("builtin:city:20000")
    print("| rays of a task | CPU seconds of a task | dask | joblib | a process for each task |" + " by the clock |" * options.wall)
    print("|---|---|---|---|---|" + "---|" * options.wall)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        client.wait_for_workers(2)
        compare(client, scene, 1000, 2)
        for rays in map(int, options.rays.split(",")):
            start = time.process_time()
            alone = [in_shade(scene, seed, rays) for seed in range(options.tasks)]
            one = time.process_time() - start
            runs = [cpu_of_dask(client, scene, rays, options.tasks), cpu_of_joblib(scene, rays, options.tasks), cpu_of_processes(scene, rays, options.tasks)]
            assert all(found == alone for _, found in runs)
            ratios = " | ".join(f"{seconds / one:.2f}" for seconds, _ in runs)
            line = f"| {rays / 1e6:g} million | {one / options.tasks:.3f} | {ratios} |"
            if options.wall:
                seconds, together, agree = compare(client, scene, rays, options.tasks)
                assert agree
                line += f" {seconds / together:.2f} |"
            print(line, flush=True)


if __name__ == "__main__":
    main()
