"""How two workers of dask compare with one thread, by the length of tasks: the program of docs/src/python/many-machines.md.

    python bench/python/many_machines.py [--rays 2000000,20000000,200000000] [--tasks 8]

Prints the table of that page. Needs dask.distributed and two cores that nothing else uses.
"""

import argparse
import time

import antumbra as am
import numpy as np
from dask.distributed import Client, LocalCluster


def in_shade(scene, seed, rays, threads=1):
    """Number of random points between the buildings that the sun does not reach."""
    rng, count = np.random.default_rng(seed), 0
    low, high = scene.bounds.astype(np.float32)
    for first in range(0, rays, 1_000_000):
        points = rng.random((min(1_000_000, rays - first), 3), np.float32) * (high - low) + low
        count += int(scene.occluded(points, np.float32([0.3, 0.2, 0.9]), threads=threads).sum())
    return count


def compare(client, scene, rays, tasks):
    """Seconds of one thread and of the workers, the scene being sent again, and whether they agree."""
    start = time.perf_counter()
    alone = [in_shade(scene, seed, rays) for seed in range(tasks)]
    middle = time.perf_counter()
    sent = client.scatter(scene, broadcast=True, hash=False)
    found = client.gather([client.submit(in_shade, sent, seed, rays, pure=False) for seed in range(tasks)])
    return middle - start, time.perf_counter() - middle, found == alone


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--rays", default="200000,2000000,20000000,200000000", help="rays of a task, a list")
    options.add_argument("--tasks", type=int, default=8, help="tasks")
    options = options.parse_args()
    scene = am.Scene.from_file("builtin:city:20000")
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        client.wait_for_workers(2)
        compare(client, scene, 1000, 2)
        for rays in map(int, options.rays.split(",")):
            alone, together, agree = compare(client, scene, rays, options.tasks)
            assert agree
            print(f"| {alone / options.tasks:.2f} s | {rays / 1e6:g} million | {alone / together:.2f} |", flush=True)


if __name__ == "__main__":
    main()
