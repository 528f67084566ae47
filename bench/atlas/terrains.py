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
    profile = dict(driver="GTiff", height=z.shape[0], width=z.shape[1], count=1, dtype="float32", crs="EPSG:32633")
    with rasterio.open(path, "w", transform=from_origin(left, top, cell, cell), **profile) as file:
        file.write(z.astype(np.float32), 1)


def make(folder, new_zealand_file):
    """Writes all terrains; returns their paths by name."""
    os.makedirs(folder, exist_ok=True)
    made = {"tower": tower(), "town": town(), "ridge": ridge(), "alps": alps()}
    if new_zealand_file:
        made["new-zealand"] = new_zealand(new_zealand_file)
    paths = {name: os.path.join(folder, name + ".tif") for name in made}
    for name, (z, cell) in made.items():
        write(paths[name], z, cell, EAST - z.shape[1] // 2 * cell, NORTH + z.shape[0] // 2 * cell)
    return paths
