"""Viewshed of a height raster: this program, gdal_viewshed and xarray-spatial against lines of sight in double precision.

    python bench/bakes/compare_viewshed.py --program target/release/antumbra [--size 100] [--observers 3]

needs numpy and rasterio, and compares what else it finds: gdal_viewshed (Debian: gdal-bin) and xarray-spatial (PyPI).
The surface is the same for all of them only at the centres of cells. Between them, this program has two triangles for each
square of centres. The reference has the same triangles; `--bilinear` takes bilinear heights along the lines between cells instead,
as others do. Cells whose line of sight is nearer than 1 mm to the surface are left out.

Prints a table: wrong cells of each program, and its CPU seconds.
"""

import argparse
import resource
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import rasterio
from rasterio.transform import from_origin

RADIUS, REFRACTION = 6371008.8, 0.13
CELL, EYE = 30.0, 1.7
CLOSE = 1e-3


def terrain(size, seed=7):
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:size, :size]
    heights = 300 + 30 * np.sin(x / 9) * np.cos(y / 13) + 100 * np.sin(x / 97) * np.sin(y / 83)
    return (heights + 5 * rng.random((size, size))).astype(np.float32)


def clearance(heights, observer, diagonals, curvature=True):
    """Least height of each line of sight above the surface, strictly between its ends: [size, size]."""
    size = len(heights)
    row, column = observer
    y, x = np.mgrid[:size, :size].astype(float)
    squared = ((x - column) ** 2 + (y - row) ** 2) * CELL**2
    low = heights.astype(float) - curvature * (1 - REFRACTION) * squared / (2 * RADIUS)
    eye = low[row, column] + EYE
    least = np.full((size, size), np.inf)
    dx, dy = x - column, y - row

    def take(t, x0, y0, x1, y1, part):
        inside = (t > 1e-12) & (t < 1 - 1e-12) & (y1 < size) & (x1 < size) & (y0 >= 0) & (y0 < size)
        x0, x1 = np.clip(x0, 0, size - 1), np.clip(x1, 0, size - 1)
        y0, y1 = np.clip(y0, 0, size - 1), np.clip(y1, 0, size - 1)
        surface = low[y0, x0] * (1 - part) + low[y1, x1] * part
        over = eye + t * (low - eye) - surface
        np.minimum(least, np.where(inside, over, np.inf), out=least)

    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(size):
            t = np.nan_to_num((k - column) / dx, nan=-1, posinf=-1, neginf=-1)
            at = row + t * dy
            y0 = np.floor(np.clip(at, 0, size - 1)).astype(int)
            take(t, np.full_like(y0, k), y0, np.full_like(y0, k), np.minimum(y0 + 1, size - 1), at - y0)
            t = np.nan_to_num((k - row) / dy, nan=-1, posinf=-1, neginf=-1)
            at = column + t * dx
            x0 = np.floor(np.clip(at, 0, size - 1)).astype(int)
            take(t, x0, np.full_like(x0, k), np.minimum(x0 + 1, size - 1), np.full_like(x0, k), at - x0)
        for k in range(1 - size, size) if diagonals else ():
            t = np.nan_to_num((k - (column - row)) / (dx - dy), nan=-1, posinf=-1, neginf=-1)
            at = column + t * dx
            x0 = np.floor(np.clip(at, 0, size - 1)).astype(int)
            take(t, x0, x0 - k, x0 + 1, x0 - k + 1, at - x0)
    return least


def cpu_seconds(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([str(word) for word in command], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/antumbra")
    parser.add_argument("--size", type=int, default=100)
    parser.add_argument("--observers", type=int, default=3)
    parser.add_argument("--bilinear", action="store_true", help="reference without the diagonals of squares")
    parser.add_argument("--together", action="store_true", help="all observers in one run of this program, for the time only")
    parser.add_argument("--time", action="store_true", help="times only, for sizes that the reference is too slow for")
    args = parser.parse_args()
    size, folder = args.size, Path(tempfile.mkdtemp())
    heights = terrain(size)
    transform = from_origin(600000, 5340000, CELL, CELL)
    profile = dict(driver="GTiff", width=size, height=size, count=1, dtype="float32", crs="EPSG:25832", transform=transform)
    with rasterio.open(folder / "dem.tif", "w", **profile) as file:
        file.write(heights, 1)
    rng = np.random.default_rng(1)
    observers = rng.integers(size // 5, size - size // 5, (args.observers, 2))
    if args.together:
        places = [transform * (column + 0.5, row + 0.5) for row, column in observers]
        (folder / "all.csv").write_text("x,y\n" + "".join(f"{x},{y}\n" for x, y in places))
        command = [args.program, "visible", folder / "dem.tif", folder / "all.csv", "--viewshed", "--curvature"]
        time = cpu_seconds([*command, "--eye", EYE, "-o", folder / "all.tif"])
        with rasterio.open(folder / "all.tif") as file:
            pairs = int(np.nansum(file.read(1).astype(float)))
        print(f"{args.observers} observers, {size} x {size} cells: {time:.2f} CPU s, {pairs} pairs see each other")
        return
    wrong, seconds, compared = {}, {}, 0
    for row, column in observers:
        x, y = transform * (column + 0.5, row + 0.5)
        seen = {}

        def note(name, cells, time):
            seen[name] = cells
            seconds[name] = seconds.get(name, 0) + time

        (folder / "o.csv").write_text(f"x,y\n{x},{y}\n")
        command = [args.program, "visible", folder / "dem.tif", folder / "o.csv", "--viewshed", "--curvature"]
        time = cpu_seconds([*command, "--eye", EYE, "-o", folder / "ours.tif"])
        with rasterio.open(folder / "ours.tif") as file:
            assert file.transform == transform and file.crs == profile["crs"]
            note("antumbra", file.read(1) > 0, time)
        if shutil.which("gdal_viewshed"):
            flags = ["-ox", x, "-oy", y, "-oz", EYE, "-tz", 0, "-cc", 1 - REFRACTION, "-md", 0]
            time = cpu_seconds(["gdal_viewshed", *flags, folder / "dem.tif", folder / "gdal.tif"])
            with rasterio.open(folder / "gdal.tif") as file:
                note("gdal_viewshed", file.read(1) > 0, time)
        try:
            import time as clock

            import xarray
            import xrspatial
        except ImportError:
            pass
        else:
            xs = transform.c + CELL * (np.arange(size) + 0.5)
            ys = transform.f - CELL * (np.arange(size) + 0.5)
            raster = xarray.DataArray(heights.astype(float), coords={"y": ys, "x": xs}, dims=["y", "x"])
            begin = clock.process_time()
            angles = xrspatial.viewshed(raster, x=x, y=y, observer_elev=EYE)
            note("xarray-spatial (flat earth)", angles.values >= 0, clock.process_time() - begin)
        if args.time:
            continue
        free = {flat: clearance(heights, (row, column), not args.bilinear, not flat) for flat in (False, True)}
        for name, cells in seen.items():
            least = free["flat" in name]
            counts = np.abs(least) > CLOSE
            # The observer's own cell and its neighbours have nothing strictly between.
            counts[row, column] = False
            wrong.setdefault(name, [0, 0])
            wrong[name][0] += np.count_nonzero(counts & (cells != (least > 0)))
            wrong[name][1] += np.count_nonzero(counts & (least > 0))
        compared += np.count_nonzero(np.abs(free[False]) > CLOSE)
    print(f"{args.observers} observers, {size} x {size} cells, {compared} compared")
    print("| program | wrong cells | of so many visible | CPU s |\n|---|---|---|---|")
    for name, time in seconds.items():
        bad, visible = wrong.get(name, ["", ""])
        print(f"| {name} | {bad} | {visible} | {time:.2f} |")


if __name__ == "__main__":
    main()
