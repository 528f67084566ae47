"""Hours of direct sun on the ground of a city, on the longest and on the shortest day: python city_sun_hours.py [FOLDER]"""

import sys
from datetime import datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import antumbra as am
import numpy as np

SIZE, CELLS = 400.0, 240
ROME = (41.9, 12.5, ZoneInfo("Europe/Rome"))
STEP = timedelta(minutes=10)


def blocks(rng, streets=10):
    """Boxes on a grid of streets: vertices and faces of each."""
    faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
             [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]]
    corner = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
    block = SIZE / streets
    for x in range(streets):
        for y in range(streets):
            low = [(x + 0.18) * block, (y + 0.18) * block, 0]
            yield low + corner * [0.64 * block, 0.64 * block, rng.gamma(3, 7)], faces


scene = am.Scene(list(blocks(np.random.default_rng(3))))

# One sensor in the middle of each cell of the ground, a little above it.
middles = (np.arange(CELLS) + 0.5) * SIZE / CELLS
x, y = np.meshgrid(middles, middles[::-1])
sensors = np.stack([x, y, np.full_like(x, 0.1)], -1)
inside = scene.contains(sensors)

pictures = []
for month in (6, 12):
    midnight = datetime(2025, month, 21)
    times = [midnight + (step + 0.5) * STEP for step in range(24 * 6)]
    sun = am.sun_positions(*ROME[:2], times, ROME[2])
    hours = scene.sun_hours(sensors, np.broadcast_to([0, 0, 1], sensors.shape), sun)
    open_ground = hours[~inside]
    print(f"21.{month}.: {sun.up.sum() * STEP.seconds / 3600:.1f} h of sun, {open_ground.mean():.1f} h on the ground")
    pictures.append(am.heat_map(np.where(inside, np.nan, hours), 0, 15).pixels)

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
am.Picture(np.concatenate(pictures, 1)).save(folder / "city_sun_hours.png")
