"""Occlusion from every point in every direction: one call that broadcasts, beside calls that are given every ray.

    python bench/python/groups.py [--rays 2000000] [--rounds 5] [--threads 1]

Three calls with the same answers, interleaved, by CPU time of the process; medians of the ratios of each round:

    every ray     arrays of all origins and directions, made before the clock starts
    one by one    points[:, None] and directions[None], with an end for each point, which no group takes
    broadcast     points[:, None] and directions[None]
"""

import argparse
import time

import antumbra as am
import numpy as np
import scenes


def suns(count):
    """Directions above the horizon along a year of days, as the sun goes at 48 degrees north."""
    rng = np.random.default_rng(2)
    tilt, height = np.radians(23.44), np.radians(48)
    found = np.empty((0, 3))
    while len(found) < count:
        day, hour = rng.uniform(0, 2 * np.pi, (2, 4 * count))
        decline = np.arcsin(np.sin(tilt) * np.sin(day))
        east, up = -np.cos(decline) * np.sin(hour), np.sin(height) * np.sin(decline) + np.cos(height) * np.cos(decline) * np.cos(hour)
        north = np.cos(height) * np.sin(decline) - np.sin(height) * np.cos(decline) * np.cos(hour)
        found = np.concatenate([found, np.stack([east, north, up], -1)[up > 0.05]])
    return found[:count].astype(np.float32)


def measure(name, kind, directions, arguments):
    vertices, faces = getattr(scenes, name)()
    scene = am.Scene(vertices, faces)
    points, normals = scenes.surface(vertices, faces, arguments.rays // len(directions), np.random.default_rng(1))
    points = (points + 1e-2 * normals).astype(np.float32)
    shape = (len(points), len(directions), 3)
    each = [np.broadcast_to(rows, shape).copy() for rows in (points[:, None], directions)]
    ends = np.zeros((len(points), 1), np.float32)
    calls = {
        "every ray": lambda: scene.occluded(*each, threads=arguments.threads),
        "one by one": lambda: scene.occluded(points[:, None], directions, near=ends, threads=arguments.threads),
        "broadcast": lambda: scene.occluded(points[:, None], directions, threads=arguments.threads),
    }
    seconds, answers = {call: [] for call in calls}, {}
    for _ in range(arguments.rounds):
        for call, ask in calls.items():
            start = time.process_time()
            answers[call] = ask()
            seconds[call].append(time.process_time() - start)
    assert all((answers[call] == answers["broadcast"]).all() for call in calls)
    ratio = lambda call: float(np.median(np.divide(seconds[call], seconds["broadcast"])))
    rate = answers["broadcast"].size / np.median(seconds["broadcast"]) / 1e6
    print(
        f"| {name}, {kind} | {len(points)} x {len(directions)} | {answers['broadcast'].mean():.0%} "
        f"| {ratio('every ray'):.2f} | {ratio('one by one'):.2f} | {rate:.1f} |", flush=True,
    )


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--rays", type=int, default=2_000_000)
    options.add_argument("--rounds", type=int, default=5)
    options.add_argument("--threads", type=int, default=1)
    arguments = options.parse_args()
    print("| scene, directions | points x directions | occluded | CPU of every ray | CPU of one by one | million rays a second |")
    print("|---|---|---|---|---|---|")
    for name in ("city", "hills"):
        for kind, directions in [
            ("32 suns", suns(32)), ("64 suns", suns(64)), ("sky of 145", am.sky_patches(145)[0].astype(np.float32)), ("2000 suns", suns(2000)),
        ]:
            measure(name, kind, directions, arguments)


if __name__ == "__main__":
    main()
