"""What an observer sees of a terrain in national coordinates: python viewshed.py [FOLDER]"""

import sys
from pathlib import Path

import antumbra as am
import numpy as np

CELLS, CELL = 320, 30.0
EAST, NORTH = 2_600_000.0, 1_200_000.0  # metres: float32 alone would keep steps of a quarter of a metre
TOWER = 30.0


def heights(n):
    """Hills of all sizes: noise whose power falls with the frequency."""
    rng = np.random.default_rng(9)
    f = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n)[None])
    f[0, 0] = np.inf
    noise = np.fft.irfft2(np.fft.rfft2(rng.normal(size=(n, n))) * f**-2.2, (n, n))
    return 900 + 250 * noise / noise.std()


z = heights(CELLS + 1)
# The first row is the northern one, as in a raster.
x, y = np.meshgrid(EAST + CELL * np.arange(CELLS + 1), NORTH - CELL * np.arange(CELLS + 1))
points = np.stack([x, y, z], -1)
first = (np.arange(CELLS)[:, None] * (CELLS + 1) + np.arange(CELLS)).reshape(-1)
faces = np.concatenate([first[:, None] + [0, CELLS + 1, 1], first[:, None] + [1, CELLS + 1, CELLS + 2]])
scene = am.Scene(points.reshape(-1, 3), faces)

# On a tower, on the highest hill that is not at the border.
inner = z[40:-40, 40:-40]
top = np.add(np.unravel_index(inner.argmax(), inner.shape), 40)
observer = points[tuple(top)] + [0, 0, TOWER]
# The middles of cells, a hand above the ground. The observer is one point, which is broadcast.
middles = (points[:-1, :-1] + points[1:, 1:] + points[1:, :-1] + points[:-1, 1:]) / 4 + [0, 0, 0.1]
seen = scene.visible(observer, middles)
print(f"{seen.mean():.1%} of {CELLS * CELL / 1000:.0f} km by {CELLS * CELL / 1000:.0f} km, origin {scene.origin}")

# A relief, lit from the north-west, with what is seen in red.
slope_x, slope_y = np.gradient(z, CELL)[1][:-1, :-1], np.gradient(z, CELL)[0][:-1, :-1]
relief = np.clip(0.5 - 0.9 * (slope_x + slope_y) / np.sqrt(1 + slope_x**2 + slope_y**2), 0, 1) ** 2
picture = relief[..., None] * np.where(seen[..., None], [1.0, 0.25, 0.1], [0.6, 0.65, 0.6])
row, column = np.ogrid[:CELLS, :CELLS]
picture[(row - top[0]) ** 2 + (column - top[1]) ** 2 < 12] = [0.1, 0.3, 1]
folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
am.Picture(picture).save(folder / "viewshed.png")
