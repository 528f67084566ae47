"""Tools of the atlas. Each question has a dictionary from names of tools to functions of a terrain.

A function returns its answer, the seconds of user time of this tool alone, and its command.
Programs are measured whole, with reading and writing; packages by their call, after one call that compiles.
"""

import os
import shlex
import subprocess
import time

import numpy as np
import rasterio

from terrains import write

ANTUMBRA = os.environ.get("ANTUMBRA", "antumbra")
GRASS = os.environ.get("GISBASE", "/usr/lib/grass82")
EYE = 1.7
LATITUDE = 48.0


class Terrain:
    """A raster with what tools want of it: heights, cell size, place, and a folder for their files."""

    def __init__(self, name, path):
        self.name, self.path = name, path
        with rasterio.open(path) as file:
            self.z, self.box, self.cell = file.read(1), file.bounds, file.res[0]
        self.folder = os.path.splitext(path)[0]
        os.makedirs(self.folder, exist_ok=True)

    def file(self, name):
        return os.path.join(self.folder, name)

    def centre(self, row, column):
        return self.box.left + (column + 0.5) * self.cell, self.box.top - (row + 0.5) * self.cell


def run(*words, env=None):
    """Runs a program; returns its seconds of user time and the command without folders."""
    words = [str(word) for word in words]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=env)
    said = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise RuntimeError(f"{shlex.join(words)}:\n{said.decode()[-2000:]}")
    return usage.ru_utime, " ".join(os.path.basename(word) if "=" not in word else word for word in words)


def call(function, *args, **options):
    """Calls a function of a package; returns its answer and the seconds of user time of this process."""
    start = time.process_time()
    answer = function(*args, **options)
    return answer, time.process_time() - start


def raster(path):
    with rasterio.open(path) as file:
        return file.read(1)


# The program


def ours_horizons(t, azimuths, first=0.0):
    out = t.file("horizon.npy")
    # Azimuths from grid north, which tiles share.
    directions = ["--azimuths", azimuths, "--first", repr(first), "--north", 0]
    took = run(ANTUMBRA, "horizon", t.path, "--cells", *directions, "--threads", 1, "-o", out)
    return np.load(out, mmap_mode="r").reshape(-1, *t.z.shape), *took


def ours_seen(t, row, column):
    out, eye = t.file("seen.tif"), t.file("eye.csv")
    with open(eye, "w") as file:
        file.write("x,y\n{!r},{!r}\n".format(*t.centre(row, column)))
    took = run(ANTUMBRA, "visible", t.path, eye, "--viewshed", "--eye", EYE, "--threads", 1, "-o", out)
    return raster(out) > 0, *took


def ours_hours(t):
    """The program's hours of the same day in half hours; its suns are its own."""
    where = ["--lat", LATITUDE, "--lon", 15, "--timezone", 1, "--north", 0, "--altitude", 0]
    day = ["--from", "2025-06-21", "--to", "2025-06-21", "--step", 30]
    out = t.file("hours.npy")
    took = run(ANTUMBRA, "sun", t.path, "--cells", *where, *day, "--threads", 1, "-o", out)
    return np.load(out), *took


def ours_lit(t, azimuth, altitude):
    horizon, *took = ours_horizons(t, 1, azimuth)
    return altitude > horizon[0], *took


def mirrored(t):
    """The raster with west and east exchanged: its triangles are those of the other diagonal."""
    path = t.file("mirrored/mirrored.tif")
    write(path, t.z[:, ::-1], t.cell, t.box.left, t.box.top)
    return Terrain(t.name, path)


def other_horizons(t, azimuths):
    found, *took = ours_horizons(mirrored(t), azimuths)
    return np.array([found[-k % azimuths, :, ::-1] for k in range(azimuths)]), *took


def other_seen(t, row, column):
    seen, *took = ours_seen(mirrored(t), row, t.z.shape[1] - 1 - column)
    return seen[:, ::-1], *took


def other_lit(t, azimuth, altitude):
    lit, *took = ours_lit(mirrored(t), 360 - azimuth, altitude)
    return lit[:, ::-1], *took


def other_sky(t):
    found, *took = ours_horizons(mirrored(t), 120)
    sine = [np.sin(np.radians(np.maximum(plane, 0).astype(float))) for plane in found]
    return np.mean([1 - plane**2 for plane in sine], axis=0)[:, ::-1], *took


def tiles(t, rim, answer):
    """Joins the answers for chunks of 256 x 256 cells, each with a rim as dask.array.map_overlap gives it."""
    if max(t.z.shape) <= 256:
        raise ValueError("the raster is one chunk and needs no rim")
    joined, seconds = None, 0
    for row in range(0, t.z.shape[0], 256):
        for column in range(0, t.z.shape[1], 256):
            top, left = max(row - rim, 0), max(column - rim, 0)
            cut = t.z[top : row + 256 + rim, left : column + 256 + rim]
            path = t.file("tile/tile.tif")
            write(path, cut, t.cell, t.box.left + left * t.cell, t.box.top - top * t.cell)
            found, took, command = answer(Terrain("tile", path))
            if joined is None:
                joined = np.empty((*found.shape[:-2], *t.z.shape), found.dtype)
            inner = np.s_[..., row - top : row - top + 256, column - left : column - left + 256]
            joined[..., row : row + 256, column : column + 256] = found[inner]
            seconds += took
    return joined, seconds, f"map_overlap, chunks of 256, depth {rim}: {command}"


def rim_horizons(rim):
    return lambda t, azimuths: tiles(t, rim, lambda tile: ours_horizons(tile, azimuths))


def rim_lit(rim):
    return lambda t, azimuth, altitude: tiles(t, rim, lambda tile: ours_lit(tile, azimuth, altitude))


# GRASS


def grass(t, module, *words):
    """Runs a module in a session of this terrain, which the first call makes."""
    base = t.file("grass")
    env = dict(os.environ, GISBASE=GRASS, GISRC=t.file("gisrc"), LD_LIBRARY_PATH=GRASS + "/lib")
    env["PATH"] = f"{GRASS}/bin:{env['PATH']}"
    env["GRASS_OVERWRITE"] = "1"
    if not os.path.exists(base):
        run("grass", "-c", t.path, "-e", base)
        with open(t.file("gisrc"), "w") as file:
            file.write(f"GISDBASE: {t.folder}\nLOCATION_NAME: grass\nMAPSET: PERMANENT\n")
        run("r.in.gdal", f"input={t.path}", "output=dem", env=env)
        run("g.region", "raster=dem", env=env)
        run("r.mapcalc", f"lat = {LATITUDE}", env=env)
        run("r.mapcalc", "lon = 15.0", env=env)
    return run(module, *words, env=env)


def grass_map(t, name):
    out = t.file("grass.tif")
    grass(t, "r.out.gdal", f"input={name}", f"output={out}", "type=Float64", "-f", "-c")
    return raster(out)


def grass_horizons(t, azimuths):
    """Directions of r.horizon count from east against the clock."""
    step = 360 / azimuths
    took = grass(t, "r.horizon", "-d", "elevation=dem", "start=0", "end=360", f"step={step:g}", "output=h")
    found = []
    for k in range(azimuths):
        direction = (90 - k * step) % 360
        name = f"h_{direction:05.1f}".replace(".", "_") if step % 1 else f"h_{direction:03.0f}"
        found.append(grass_map(t, name))
    return np.array(found), *took


def grass_seen(t, row, column):
    place = "coordinates={!r},{!r}".format(*t.centre(row, column))
    took = grass(t, "r.viewshed", "-b", "input=dem", "output=seen", place, f"observer_elevation={EYE}", "target_elevation=0", "memory=2000")
    return grass_map(t, "seen") > 0, *took


def grass_hours(t):
    took = grass(t, "r.sun", "elevation=dem", "lat=lat", "long=lon", "day=172", "step=0.5", "insol_time=hours", "nprocs=1")
    return grass_map(t, "hours"), *took


# SAGA


def saga(tool, *words):
    return run("saga_cmd", "--cores=1", "ta_lighting", tool, *words)


def saga_seen(t, row, column):
    import geopandas
    from shapely.geometry import Point

    eye, out = t.file("eye.shp"), t.file("saga.tif")
    geopandas.GeoDataFrame({"eye": [EYE]}, geometry=[Point(*t.centre(row, column))], crs="EPSG:32633").to_file(eye)
    took = saga(6, "-ELEVATION", t.path, "-VISIBILITY", out, "-METHOD", 0, "-POINTS", eye, "-HEIGHT", "eye")
    return raster(out) > 0, *took


def saga_lit(t, azimuth, altitude):
    """Shadows only: SAGA gives 90 degrees, or pi / 2, to cells in shadow."""
    out = t.file("saga.tif")
    took = saga(0, "-ELEVATION", t.path, "-SHADE", out, "-METHOD", 3, "-AZIMUTH", azimuth, "-DECLINATION", altitude, "-SHADOW", 0)
    shade = raster(out)
    return ~((shade > 1.5) & (shade < 2)), *took


def saga_sky(t):
    """The visible sky, in percent."""
    out = t.file("v.tif")
    words = ["-DEM", t.path, "-VISIBLE", out, "-SVF", t.file("s.tif"), "-SIMPLE", t.file("saga-simple.tif"), "-RADIUS", 10000]
    took = saga(3, *words, "-NDIRS", 16, "-METHOD", 0)
    return raster(out) / 100, *took


# Packages of Python


def rvt_horizons(t, azimuths):
    import rvt.vis

    found, seconds = [], 0
    for k in range(azimuths):
        # Heights in cells, because `resolution` does not reach the horizon.
        answer, took = call(rvt.vis.shadow_horizon, t.z / t.cell, 1, shadow_az=k * 360 / azimuths, shadow_el=30)
        found.append(answer["horizon"])
        seconds += took
    return np.array(found), seconds, "rvt.vis.shadow_horizon(z / cell, 1, shadow_az=azimuth, shadow_el=30)"


def rvt_lit(t, azimuth, altitude):
    import rvt.vis

    answer, took = call(rvt.vis.shadow_horizon, t.z / t.cell, 1, shadow_az=azimuth, shadow_el=altitude)
    return answer["shadow"] > 0, took, "rvt.vis.shadow_horizon(z / cell, 1, shadow_az=azimuth, shadow_el=altitude)"


def rvt_sky(t):
    import rvt.vis

    answer, took = call(rvt.vis.sky_view_factor, t.z, t.cell, svf_n_dir=16, svf_r_max=100)
    return answer["svf"], took, "rvt.vis.sky_view_factor(z, cell, svf_n_dir=16, svf_r_max=100)"


def topocalc_horizons(t, azimuths):
    """Azimuths of topocalc count from south, positive to the east; the answer is the sine of the horizon."""
    from topocalc.horizon import horizon

    found, seconds, z = [], 0, t.z.astype(float)
    for k in range(azimuths):
        angle = 180 - k * 360 / azimuths
        sine, took = call(horizon, angle, z, t.cell)
        found.append(np.degrees(np.arcsin(sine)))
        seconds += took
    return np.array(found), seconds, "topocalc.horizon.horizon(180 - azimuth, z, cell)"


def xarray_seen(t, row, column):
    import xarray
    import xrspatial

    rows, columns = (np.arange(n) for n in t.z.shape)
    x, y = t.centre(rows, columns)[0], t.centre(rows, columns)[1]
    da = xarray.DataArray(t.z.astype(float), dims=["y", "x"], coords={"y": y, "x": x})
    answer, took = call(xrspatial.viewshed, da, x=x[column], y=y[row], observer_elev=EYE)
    return answer.values >= 0, took, "xrspatial.viewshed(da, x, y, observer_elev=1.7)"


def umep_lit(t, azimuth, altitude):
    from umep.util.shadowingfunctions import shadowingfunctionglobalradiation as shadows

    lit, took = call(shadows, t.z - t.z.min(), azimuth, altitude, 1 / t.cell, 1)
    return lit > 0, took, "umep.util.shadowingfunctions.shadowingfunctionglobalradiation(z, azimuth, altitude, 1 / cell, 1)"


def umep_sky(t):
    from umep.functions.svf_functions import svfForProcessing153

    none, z = np.zeros_like(t.z), t.z - t.z.min()
    answer, took = call(svfForProcessing153, z, none, none, 1 / t.cell, 0, z.max())
    return answer["svf"], took, "umep.functions.svf_functions.svfForProcessing153(z, none, none, 1 / cell, 0, z.max())"


def solweig_lit(t, azimuth, altitude):
    from solweig import disable_gpu, rustalgos

    disable_gpu()
    z = t.z - t.z.min()
    answer, took = call(rustalgos.shadowing.calculate_shadows_wall_ht_25, azimuth, altitude, t.cell, float(z.max()), z)
    return np.asarray(answer.bldg_sh) > 0.5, took, "solweig.rustalgos.shadowing.calculate_shadows_wall_ht_25(azimuth, altitude, cell, z.max(), z)"


def solweig_sky(t):
    from solweig import disable_gpu, rustalgos

    disable_gpu()
    none, z = np.zeros_like(t.z), t.z - t.z.min()
    answer, took = call(rustalgos.skyview.calculate_svf, z, none, none, t.cell, False, float(z.max()), 2)
    return np.asarray(answer.svf), took, "solweig.rustalgos.skyview.calculate_svf(z, none, none, cell, False, z.max(), 2)"


def insolation_lit(t, azimuth, altitude):
    from insolation import insolf

    sun = insolf.normalvector(90 - altitude, azimuth)
    lit, took = call(insolf.doshade, t.z.astype(float), t.cell, sun)
    return lit > 0, took, "insolation.insolf.doshade(z, cell, insolf.normalvector(90 - altitude, azimuth))"


def gdal_seen(t, row, column):
    out = t.file("gdal.tif")
    x, y = t.centre(row, column)
    took = run("gdal_viewshed", "-ox", repr(x), "-oy", repr(y), "-oz", EYE, "-tz", 0, "-md", 0, "-cc", 0, t.path, out)
    return raster(out) > 0, *took


OTHER = "exact, other diagonal"
RIMS = (100, 500)
HORIZONS = {OTHER: other_horizons, "GRASS r.horizon": grass_horizons, "RVT": rvt_horizons, "topocalc": topocalc_horizons}
HORIZONS |= {f"rim of {rim} cells": rim_horizons(rim) for rim in RIMS}
SEEN = {OTHER: other_seen, "GDAL gdal_viewshed": gdal_seen, "GRASS r.viewshed": grass_seen, "SAGA Visibility": saga_seen, "xarray-spatial": xarray_seen}
LIT = {OTHER: other_lit, "SAGA Hillshading": saga_lit, "RVT": rvt_lit, "UMEP": umep_lit}
LIT |= {"solweig": solweig_lit, "insolation": insolation_lit} | {f"rim of {rim} cells": rim_lit(rim) for rim in RIMS}


def hours_by(lit):
    """Hours as half an hour for each sun that lights a cell."""

    def hours(t):
        total, seconds = np.zeros(t.z.shape), 0
        for azimuth, altitude in suns():
            found, took, command = lit(t, azimuth, altitude)
            total += 0.5 * found
            seconds += took
        return total, seconds, command

    return hours


def suns(day=172):
    """Azimuths and altitudes of the suns in the middle of each half hour of true solar time, as r.sun has them."""
    year = 2 * np.pi * day / 365.25
    declination = np.arcsin(0.3978 * np.sin(year - 1.4 + 0.0355 * np.sin(year - 0.0489)))
    latitude, angle = np.radians(LATITUDE), np.radians(15 * (np.arange(0.25, 24, 0.5) - 12))
    up = np.sin(latitude) * np.sin(declination) + np.cos(latitude) * np.cos(declination) * np.cos(angle)
    north = np.cos(latitude) * np.sin(declination) - np.sin(latitude) * np.cos(declination) * np.cos(angle)
    azimuth = np.degrees(np.arctan2(-np.cos(declination) * np.sin(angle), north)) % 360
    return [(float(a), float(np.degrees(np.arcsin(u)))) for a, u in zip(azimuth, up) if u > 0]


HOURS = {OTHER: hours_by(other_lit), "GRASS r.sun": grass_hours, "UMEP": hours_by(umep_lit), "insolation": hours_by(insolation_lit)}
# Tools and the part of the sky that they take: by cosine on a level surface, by solid angle, or the mean part of a quarter circle.
SKY = {OTHER: (other_sky, "cosine"), "SAGA Sky View Factor": (saga_sky, "arc"), "RVT": (rvt_sky, "angle"), "UMEP": (umep_sky, "cosine"), "solweig": (solweig_sky, "cosine")}
