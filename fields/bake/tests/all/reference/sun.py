"""Sun and sky by other programs: writes sun.csv, which tests/all/reference.rs compares with ours.

    pip install numpy pandas pvlib pyradiance
    python sun.py > sun.csv

Suns are those of pvlib. Shadows are triangles in double precision. Diffuse light of open walls is that of Radiance's
gendaymtx, with 145 patches of the sky.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pvlib
import pyradiance

LATITUDE, LONGITUDE, HEIGHT = 48.2, 16.4, 170.0


def box(i, j):
    """Middle, half widths and height of a building."""
    tall = 40 if (5 * i + 7 * j) % 13 == 0 else 0
    return (
        np.array([20.0 + 26 * i, 20.0 + 26 * j]),
        np.array([4.0 + (7 * i + 5 * j) % 5, 4.0 + (3 * i + 11 * j) % 5]),
        6.0 + 3 * ((i * i + 3 * j) % 8) + tall,
    )


def sensor(k):
    """Point and normal: on a street, on a wall that faces south, on a roof."""
    i, j = 5 * k % 11, 7 * k % 11
    (x, y), (width, length), height = box(i, j)
    if k % 3 == 0:
        return [x + 13, y + 13, 0], [0, 0, 1]
    if k % 3 == 1:
        return [x, y - length, 2], [0, -1, 0]
    return [x + width / 2, y, height], [0, 0, 1]


def light(day, hour):
    """Direct normal and diffuse horizontal irradiance of an hour, which are counted from 0."""
    if not 9 <= hour <= 14:
        return 0, 0
    return 100 * ((7 * day + 3 * hour) % 9), 40 + 20 * ((5 * day + hour) % 7)


def triangles():
    corners = [[x, y, 0] for x, y in ((0, 0), (320, 0), (320, 320), (0, 320))]
    found = [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]
    for i in range(12):
        for j in range(12):
            (x, y), (w, d), h = box(i, j)
            p = [[x + a * w, y + b * d, z] for z in (0, h) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            for a, b, c, e in ((4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)):
                found += [[p[a], p[b], p[c]], [p[a], p[c], p[e]]]
    return np.array(found, dtype=float)


def occluded(point, directions, mesh):
    """Whether rays hit a triangle, by Moeller and Trumbore."""
    a = mesh[:, 0]
    e1, e2 = mesh[:, 1] - a, mesh[:, 2] - a
    found = np.zeros(len(directions), dtype=bool)
    for begin in range(0, len(directions), 64):
        d = directions[begin : begin + 64]
        with np.errstate(divide="ignore", invalid="ignore"):
            h = np.cross(d[:, None], e2[None])
            f = 1 / np.einsum("ij,kij->ki", e1, h)
            s = point - a
            q = np.cross(s, e1)
            u = f * np.einsum("ij,kij->ki", s, h)
            v = f * (d @ q.T)
            t = f * np.einsum("ij,ij->i", e2, q)
            hits = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-4)
        found[begin : begin + 64] = hits.any(axis=1)
    return found


def city(suns, direct):
    """Hours and direct irradiation of the sensors in kWh/m2."""
    mesh = triangles()
    up = suns[:, 2] > 0
    for k in range(12):
        point, normal = (np.array(x, dtype=float) for x in sensor(k))
        cosines = suns @ normal
        seen = up & (cosines > 0)
        seen[seen] = ~occluded(point + 1e-3 * normal, suns[seen], mesh)
        yield k, seen.sum(), (seen * cosines * direct).sum() / 1000


def sky(times, direct, diffuse):
    """Diffuse irradiation of open surfaces in kWh/m2: up, south, east, west, north."""
    with tempfile.TemporaryDirectory() as folder:
        weather = Path(folder, "weather.wea")
        with weather.open("w") as file:
            # Longitudes are west positive.
            file.write(
                f"place test\nlatitude {LATITUDE}\nlongitude {-LONGITUDE}\ntime_zone -15\n"
                f"site_elevation {HEIGHT}\nweather_data_file_units 1\n"
            )
            for time, sun, air in zip(times, direct, diffuse):
                file.write(f"{time.month} {time.day} {time.hour + 0.5} {sun} {air}\n")
        program = Path(pyradiance.__file__).parent / "bin" / "gendaymtx"
        # The sky alone, without colours, on a black ground: the mean of all hours.
        command = [program, "-s", "-m", "1", "-O1", "-c", "1", "1", "1", "-g", "0", "0", "0", "-A", weather]
        text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    rows = [float(line.split()[0]) for line in text.split("\n\n", 1)[1].split("\n") if line.strip()]
    radiances = np.array(rows)[1:] * len(times) / 1000
    directions, angles = [], []
    for count, degrees in zip((30, 30, 24, 24, 18, 12, 6, 1), (6, 18, 30, 42, 54, 66, 78, 90)):
        low, high = (84, 90) if count == 1 else (degrees - 6, degrees + 6)
        angle = 2 * np.pi * (np.sin(np.radians(high)) - np.sin(np.radians(low))) / count
        for k in range(count):
            around, above = 2 * np.pi * k / count, np.radians(degrees)
            directions.append([np.sin(around) * np.cos(above), np.cos(around) * np.cos(above), np.sin(above)])
            angles.append(angle)
    assert len(radiances) == len(directions) == 145
    for name, normal in (
        ("up", [0, 0, 1]),
        ("south", [0, -1, 0]),
        ("east", [1, 0, 0]),
        ("west", [-1, 0, 0]),
        ("north", [0, 1, 0]),
    ):
        cosines = np.clip(np.array(directions) @ np.array(normal, dtype=float), 0, None)
        yield name, (radiances * angles * cosines).sum()


def main():
    times = pd.date_range("2021-01-01 00:30", periods=8760, freq="h", tz="Etc/GMT-1")
    found = pvlib.solarposition.get_solarposition(times, LATITUDE, LONGITUDE, HEIGHT)
    around = np.radians(found.azimuth.values)
    above = np.radians(found.apparent_elevation.values)
    suns = np.c_[np.sin(around) * np.cos(above), np.cos(around) * np.cos(above), np.sin(above)]
    light_of = np.array([light(time.day_of_year - 1, time.hour) for time in times])
    print(f"# pvlib {pvlib.__version__}, pyradiance {pyradiance.__version__}, numpy {np.__version__}")
    print("sensor,hours,direct_kwh_m2")
    for k, hours, direct in city(suns, light_of[:, 0]):
        print(f"{k},{hours},{direct:.4f}")
    print("surface,diffuse_kwh_m2")
    for name, diffuse in sky(times, light_of[:, 0], light_of[:, 1]):
        print(f"{name},{diffuse:.4f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
