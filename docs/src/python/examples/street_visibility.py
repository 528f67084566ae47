"""Who sees whom from the windows of a street, as a matrix of bits: python street_visibility.py [FOLDER]"""

import sys
from pathlib import Path

import antumbra as am
import numpy as np


def box(low, high):
    corner = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
    faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
             [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]]
    return np.asarray(low) + corner * np.subtract(high, low), faces


rng = np.random.default_rng(2)
houses, windows = [], []
x = 0.0
while x < 200:
    length = rng.uniform(9, 16)
    for side in (-1, 1):
        # Houses stand more or less far back, and have windows of four storeys towards the street.
        front, tall = side * rng.uniform(6, 10), rng.uniform(9, 16)
        houses.append(box([x, min(front, side * 20), 0], [x + length - 1, max(front, side * 20), tall]))
        for floor in np.arange(1.5, tall - 1, 3):
            for place in np.arange(x + 1.5, x + length - 2, 2):
                windows.append([place, front - 0.05 * side, floor])
    x += length
trees = [box([at - 1.5, -1.5, 3], [at + 1.5, 1.5, 9]) for at in range(10, 200, 12)]

scene = am.Scene(houses + trees)
# In order of the side and the place along the street.
windows = np.array(windows)
windows = windows[np.lexsort((windows[:, 2], windows[:, 0], windows[:, 1] > 0))]
seen = scene.visibility(windows, margin=0.01)
counts = seen.count(axis=1) - 1
print(f"{len(windows)} windows, {seen.count()} pairs of {len(windows) ** 2}; each sees {counts.mean():.0f} others")
print(f"{seen.words.nbytes / 1e3:.0f} kB instead of {len(windows) ** 2 / 1e3:.0f} kB")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
am.Picture(seen.to_numpy() * np.float32(0.8)).save(folder / "street_visibility.png")
