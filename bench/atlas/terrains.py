"""Terrains of the atlas: GeoTIFFs in EPSG:32633, made from a seed or cut from a surface model of New Zealand."""

import os

import numpy as np
import rasterio
from rasterio.transform import from_origin

EAST, NORTH = 500_000, 5_316_000  # on the central meridian of the zone, so that grid north is true north


def fractal(n, power, seed):
    """Heights from 0 to 1 whose spectrum falls with this power."""
    noise = np.fft.rfft2(np.random.default_rng(seed).standard_normal((n, n)))
    k = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n)[None])
    k[0, 0] = 1
    noise *= k ** (-power / 2)
    noise[0, 0] = 0
    z = np.fft.irfft2(noise, s=(n, n))
    return (z - z.min()) / (z.max() - z.min())


def town(n=512):
    """Nearly flat ground with 140 houses of flat roofs and 600 trees, cells of a metre."""
    random = np.random.default_rng(7)
    z = fractal(n, 4.2, 2) * 8
    for _ in range(140):
        i, j = random.integers(0, n - 40, 2)
        a, b = random.integers(8, 36, 2)
        house = z[i : i + a, j : j + b]
        house[:] = np.maximum(house, house.mean() + 3 + 50 * random.random() ** 4)
    for _ in range(600):
        i, j = random.integers(0, n - 8, 2)
        z[i : i + 5, j : j + 5] += 4 + 10 * random.random()
    return z, 1


def old_town(n=512):
    """Blocks of 4 to 6 storeys with pitched roofs and courts between crooked streets of 3 to 6 m, on a slope, cells of a metre."""
    random = np.random.default_rng(11)
    row, column = np.mgrid[:n, :n].astype(float)
    ground = 0.07 * row + 0.04 * column + 6 * fractal(n, 4.2, 4)
    y, x = np.mgrid[-1 : n // 45 + 2, -1 : n // 45 + 2].reshape(2, -1) * 45 + random.uniform(-11, 11, (2, (n // 45 + 3) ** 2))
    block = np.argmin([(column - a) ** 2 + (row - b) ** 2 for a, b in zip(x, y)], axis=0)
    street = random.uniform(3, 6, (x.size, x.size))
    # The nearest street of a cell runs halfway between two centres of blocks, a house every 11 m along it.
    away, house = np.full((n, n), np.inf), np.zeros((n, n), int)
    for k in range(x.size):
        across, down = x[k] - x[block], y[k] - y[block]
        length = np.hypot(across, down) + (block == k)
        here, there = column - (x[block] + x[k]) / 2, row - (y[block] + y[k]) / 2
        distance = -(here * across + there * down) / length - street[np.minimum(block, k), np.maximum(block, k)] / 2
        nearer = (distance < away) & (block != k)
        away[nearer] = distance[nearer]
        house[nearer] = ((block * x.size + k) * 64 + 32 + (here * down - there * across) / length // 11)[nearer]
    house = np.unique(house, return_inverse=True)[1].reshape(n, n)
    floor = (np.bincount(house.ravel(), ground.ravel()) / np.bincount(house.ravel()))[house]
    eaves = floor + 3.2 * random.integers(4, 7, house.max() + 1)[house]
    depth = random.uniform(9, 13, house.max() + 1)[house]
    pitch = np.tan(np.radians(random.uniform(40, 55, house.max() + 1)))[house]
    square = np.bincount(block.ravel()).argmax()
    built = (away > 0) & (away < depth) & (block != square)
    z = np.where(built, eaves + pitch * np.minimum(away, depth - away), ground)
    # The largest block is a square with a church, whose tower is 60 m high.
    east, north = column - x[square], y[square] - row
    u, v = east * np.cos(0.3) + north * np.sin(0.3), np.abs(north * np.cos(0.3) - east * np.sin(0.3))
    foot = ground[block == square].mean()
    z = np.where((u > -10) & (u < 16) & (v < 7), foot + 13 + 1.3 * (7 - v), z)
    return np.where((u > -18) & (u <= -10) & (v < 4), foot + 44 + 4 * (4 - np.maximum(np.abs(u + 14), v)), z), 1


def alps(n=256):
    return fractal(n, 4.0, 1) * 2000, 20


def ridge(n=256):
    """A ridge 600 m high that runs at 30 degrees to the columns, with 40 m of rough ground, cells of 20 m."""
    y, x = np.mgrid[:n, :n] - n / 2
    across = x * np.cos(np.pi / 6) + y * np.sin(np.pi / 6)
    return 600 * np.exp(-((across / 20) ** 2)) + 40 * fractal(n, 3.0, 3), 20


def tower(n=512):
    """A plain at height 0 with a tower of 12 x 12 cells, 40 m high, cells of a metre."""
    z = np.zeros((n, n))
    z[330:342, 110:122] = 40
    return z, 1


def new_zealand(path, n=700):
    """The part of the surface model between its middle row and column, without missing data."""
    with rasterio.open(path) as file:
        z = file.read(1)[380 : 380 + n, 1170 : 1170 + n]
        assert (z != file.nodata).all() and np.isfinite(z).all()
    return z, 1


def write(path, z, cell, left=EAST, top=NORTH):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    profile = dict(driver="GTiff", height=z.shape[0], width=z.shape[1], count=1, dtype="float32", crs="EPSG:32633")
    with rasterio.open(path, "w", transform=from_origin(left, top, cell, cell), **profile) as file:
        file.write(z.astype(np.float32), 1)


def make(folder, new_zealand_file):
    """Writes all terrains; returns their paths by name. Each has its own folder, since the program looks at rasters beside its scene."""
    made = {"tower": tower(), "town": town(), "old-town": old_town(), "ridge": ridge(), "alps": alps()}
    if new_zealand_file:
        made["new-zealand"] = new_zealand(new_zealand_file)
    paths = {name: os.path.join(folder, name, name + ".tif") for name in made}
    for name, (z, cell) in made.items():
        write(paths[name], z, cell, EAST - z.shape[1] // 2 * cell, NORTH + z.shape[0] // 2 * cell)
    return paths
