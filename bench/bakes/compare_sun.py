#!/usr/bin/env python3
"""Compares a .npz of `antumbra sun` with a computation that shares no code with it.

    compare_sun.py MESH.ply SUN.npz [--epw FILE] [--lat D --lon D --zone H --altitude M] [--up y|z] [--sensors N]

Suns are compared with those of pvlib's solar position algorithm. Occlusion is tested by numpy in double precision: each sensor tries, for each
direction, every triangle that may be in the way, without any tree. Sky patches, the sky of Perez and all sums are written here
from their papers. Needs numpy and pvlib. Exits with 1 if any value differs by more than 1e-6 of itself, or a sun by 0.01 degrees.

Two facts are taken over, because they define which rays are meant: directions are rounded to single precision, and rays begin
an origin offset above the sensor, 2.125 * 2**-19 times the largest coordinate.
"""

import argparse
import json
import sys
import time

import numpy as np
from numpy.linalg import norm


def read_ply(path):
    """Vertices and triangles of a binary PLY file."""
    with open(path, "rb") as file:
        data = file.read()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    fields, counts, element = [], {}, None
    kinds = {"float": "<f4", "uchar": "u1", "int": "<i4", "double": "<f8"}
    for line in data[:end].decode().splitlines():
        words = line.split()
        if words[0] == "element":
            element = words[1]
            counts[element] = int(words[2])
        elif words[0] == "property" and element == "vertex":
            fields.append((words[2], kinds[words[1]]))
    vertex = np.dtype(fields)
    vertices = np.frombuffer(data, vertex, counts["vertex"], end)
    face = np.dtype([("n", "u1"), ("corners", "<i4", 3)])
    faces = np.frombuffer(data, face, counts["face"], end + vertices.nbytes)
    points = np.stack([vertices[axis] for axis in "xyz"], axis=1).astype(float)
    return points, faces["corners"].astype(np.int64)


def suns(args, times):
    """Azimuths and apparent elevations in degrees by pvlib."""
    import pandas as pd
    from pvlib import spa

    stamps = pd.to_datetime(times, unit="s", utc=True)
    month = stamps.month.to_numpy()
    delta_t = spa.calculate_deltat(stamps.year.to_numpy(), month)
    table = spa.solar_position_numpy(
        times, args.lat, args.lon, args.altitude, 1013.25, 15.0, delta_t, 0.5667, 1
    )
    return table[4], table[2]


def direction(azimuth, elevation):
    """East, north, up."""
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.stack([np.cos(e) * np.sin(a), np.cos(e) * np.cos(a), np.sin(e)], axis=-1)


def patches(parts):
    """Centres and solid angles of Tregenza's sky, each patch in parts by parts."""
    height = 90 / (7 * parts + 0.5)
    azimuths, elevations, angles = [], [], []
    for row in range(7 * parts):
        count = [30, 30, 24, 24, 18, 12, 6][row // parts] * parts
        band = np.sin(np.radians(height * (row + 1))) - np.sin(np.radians(height * row))
        azimuths += list(360 * np.arange(count) / count)
        elevations += [height * (row + 0.5)] * count
        angles += [2 * np.pi * band / count] * count
    angles.append(2 * np.pi * (1 - np.cos(np.radians(height / 2))))
    return direction(np.array(azimuths + [0]), np.array(elevations + [90])), np.array(angles)


PEREZ = """
 1.3525 -0.2576 -0.2690 -1.4366 -0.7670 0.0007 1.2734 -0.1233 2.8000 0.6004 1.2375 1.0000 1.8734 0.6297 0.9738 0.2809 0.0356 -0.1246 -0.5718 0.9938
-1.2219 -0.7730 1.4148 1.1016 -0.2054 0.0367 -3.9128 0.9156 6.9750 0.1774 6.4477 -0.1239 -1.5798 -0.5081 -1.7812 0.1080 0.2624 0.0672 -0.2190 -0.4285
-1.1000 -0.2515 0.8952 0.0156 0.2782 -0.1812 -4.5000 1.1766 24.7219 -13.0812 -37.7000 34.8438 -5.0000 1.5218 3.9229 -2.6204 -0.0156 0.1597 0.4199 -0.5562
-0.5484 -0.6654 -0.2672 0.7117 0.7234 -0.6219 -5.6812 2.6297 33.3389 -18.3000 -62.2500 52.0781 -3.5000 0.0016 1.1477 0.1062 0.4659 -0.3296 -0.0876 -0.0329
-0.6000 -0.3566 -2.5000 2.3250 0.2937 0.0496 -5.6812 1.8415 21.0000 -4.7656 -21.5906 7.2492 -3.5000 -0.1554 1.4062 0.3988 0.0032 0.0766 -0.0656 -0.1294
-1.0156 -0.3670 1.0078 1.4051 0.2875 -0.5328 -3.8500 3.3750 14.0000 -0.9999 -7.1406 7.5469 -3.4000 -0.1078 -1.0750 1.5702 -0.0672 0.4016 0.3017 -0.4844
-1.0000 0.0211 0.5025 -0.5119 -0.3000 0.1922 0.7023 -1.6317 19.0000 -5.0000 1.2438 -1.9094 -4.0000 0.0250 0.3844 0.2656 1.0468 -0.3788 -2.4517 1.4656
-1.0500 0.0289 0.4260 0.3590 -0.3250 0.1156 0.7781 0.0025 31.0625 -14.5000 -46.1148 55.3750 -7.2312 0.4050 13.3500 0.6234 1.5000 -0.6426 1.8564 0.5636
"""


def perez(centres, angles, sun, elevation, day, direct, diffuse):
    """Radiances of patches (Perez, Seals and Michalsky 1993)."""
    if diffuse <= 0:
        return np.zeros(len(angles))
    light = np.ones(len(angles))
    if elevation > 0:
        z = np.radians(90 - elevation)
        clear = ((diffuse + direct) / diffuse + 1.041 * z**3) / (1 + 1.041 * z**3)
        mass = 1 / (np.cos(z) + 0.50572 * (96.07995 - (90 - elevation)) ** -1.6364)
        b = 2 * np.pi * (day - 1) / 365
        factor = 1.00011 + 0.034221 * np.cos(b) + 0.00128 * np.sin(b)
        factor += 0.000719 * np.cos(2 * b) + 0.000077 * np.sin(2 * b)
        bright = diffuse * mass / (1367 * factor)
        if 1.065 < clear < 2.8:
            bright = max(bright, 0.2)
        table = np.array(PEREZ.split(), float).reshape(8, 5, 4)
        k = np.searchsorted([1.065, 1.23, 1.5, 1.95, 2.8, 4.5, 6.2], clear, side="right")
        t = table[k]
        p = t[:, 0] + t[:, 1] * z + bright * (t[:, 2] + t[:, 3] * z)
        if k == 0:
            p[2] = np.exp((bright * (t[2, 0] + t[2, 1] * z)) ** t[2, 2]) - t[2, 3]
            p[3] = -np.exp(bright * (t[3, 0] + t[3, 1] * z)) + t[3, 2] + bright * t[3, 3]
        cosine = np.clip(centres @ sun, -1, 1)
        light = (1 + p[0] * np.exp(p[1] / np.maximum(centres[:, 2], 0.01)))
        light = light * (1 + p[2] * np.exp(p[3] * np.arccos(cosine)) + p[4] * cosine**2)
        light = np.maximum(light, 0)
    return light * diffuse / np.sum(light * angles * centres[:, 2])


def blocked(corners, eye, directions):
    """Whether any triangle lies in each direction from a point, in east, north, up. Every triangle that may be is tried."""
    local = corners - eye
    low, high = local.min(axis=1), local.max(axis=1)
    gap = np.maximum(np.maximum(low[:, :2], -high[:, :2]), 0)
    near = np.hypot(gap[:, 0], gap[:, 1])
    tangent = np.where(near > 0, high[:, 2] / np.maximum(near, 1e-300), np.inf)
    azimuths = np.degrees(np.arctan2(local[:, :, 0], local[:, :, 1]))
    turn = (azimuths - azimuths[:, :1] + 180) % 360 - 180
    # Degrees of azimuth that each triangle reaches into; all of them for triangles overhead.
    first = np.floor(azimuths[:, 0] + turn.min(axis=1) - 1e-7).astype(int)
    count = np.floor(azimuths[:, 0] + turn.max(axis=1) + 1e-7).astype(int) - first + 1
    count[(near == 0) | (count > 179)] = 360
    count[high[:, 2] <= 0] = 0
    triangles = np.repeat(np.arange(len(count)), count)
    steps = np.arange(len(triangles)) - np.repeat(np.cumsum(count) - count, count)
    degrees = (np.repeat(first, count) + steps) % 360
    order = np.argsort(degrees, kind="stable")
    triangles, bounds = triangles[order], np.searchsorted(degrees[order], np.arange(361))
    result = np.zeros(len(directions), bool)
    slope = directions[:, 2] / np.hypot(directions[:, 0], directions[:, 1]).clip(1e-300)
    bins = np.floor(np.degrees(np.arctan2(directions[:, 0], directions[:, 1]))).astype(int) % 360
    for index in np.unique(bins):
        rays = np.flatnonzero(bins == index)
        some = triangles[bounds[index] : bounds[index + 1]]
        candidates = some[tangent[some] >= slope[rays].min() * (1 - 1e-9) - 1e-12]
        for piece in np.array_split(candidates, max(1, len(candidates) * len(rays) // 2_000_000 + 1)):
            o, p, q = (local[piece, k][None] for k in range(3))
            d = directions[rays][:, None]
            e, f = p - o, q - o
            h = np.cross(d, f)
            determinant = np.sum(e * h, axis=-1)
            with np.errstate(divide="ignore", invalid="ignore"):
                u = np.sum(-o * h, axis=-1) / determinant
                g = np.cross(-o, e)
                v = np.sum(d * g, axis=-1) / determinant
                t = np.sum(f * g, axis=-1) / determinant
                hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
            result[rays] |= hit.any(axis=1)
    return result


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("mesh")
    parser.add_argument("npz")
    parser.add_argument("--epw")
    parser.add_argument("--lat", type=float)
    parser.add_argument("--lon", type=float)
    parser.add_argument("--zone", type=float, default=0)
    parser.add_argument("--altitude", type=float, default=0)
    parser.add_argument("--year", type=int, default=2025)
    parser.add_argument("--up", choices="yz", default="z")
    parser.add_argument("--sensors", type=int, default=100)
    parser.add_argument("--own-suns", action="store_true", help="trace towards pvlib's suns, not those of the file")
    args = parser.parse_args()
    start = time.time()
    found = np.load(args.npz)
    weather = None
    if args.epw:
        with open(args.epw, encoding="latin-1") as file:
            lines = file.read().splitlines()
        head = lines[0].split(",")
        args.lat, args.lon, args.zone, args.altitude = (float(head[i]) for i in (6, 7, 8, 9))
        weather = np.array([[float(x) for x in line.split(",")[:4] + line.split(",")[14:16]] for line in lines[8:]])
        dates = np.array([f"{int(y):04}-{int(m):02}-{int(d):02}" for y, m, d in weather[:, :3]], "datetime64[D]")
        times = dates.astype("datetime64[s]").astype(float) + 3600 * (weather[:, 3] - 0.5 - args.zone)
        days = (dates - dates.astype("datetime64[Y]").astype("datetime64[D]")).astype(int) + 1
    else:
        begin = np.datetime64(f"{args.year}-01-01", "s").astype(float) - 3600 * args.zone
        end = np.datetime64(f"{args.year + 1}-01-01", "s").astype(float) - 3600 * args.zone
        times = np.arange(begin + 1800, end, 3600)
    azimuth, elevation = suns(args, times)
    up = elevation > 0
    to_sun = direction(azimuth, elevation)
    worst = np.degrees(np.max(norm(to_sun[up] - direction(found["sun_azimuths"], found["sun_elevations"]), axis=1)))
    counts = found["suns_and_patches"]
    centres, angles = patches({145: 1, 577: 2, 2305: 4}[int(counts[1])])

    points, faces = read_ply(args.mesh)
    extent = np.float32(np.abs(points[faces]).max())
    offset = float(extent * np.float32(2.125 * 2**-19))
    # East, north and up of a mesh.
    axes = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]] if args.up == "y" else np.eye(3))
    corners = (points @ axes.T)[faces]
    chosen = np.linspace(0, len(found["points"]) - 1, args.sensors).astype(int)
    eyes = found["points"][chosen].astype(float)
    normals = found["normals"][chosen].astype(float)
    normals /= norm(normals, axis=1, keepdims=True)
    reach = np.maximum(np.float32(np.abs(eyes).max(axis=1)), extent) * np.float32(2.125 * 2**-19)
    eyes = (eyes + reach[:, None].astype(float) * normals).astype(np.float32).astype(float) @ axes.T
    normals = normals @ axes.T
    # Suns of both programs differ in the fourth decimal of a degree, which decides rays that pass an edge.
    if not args.own_suns:
        to_sun[up] = direction(found["sun_azimuths"], found["sun_elevations"])
    rays = np.concatenate([to_sun[up], centres]).astype(np.float32).astype(float)

    sky = None
    if weather is not None:
        sky = sum(
            perez(centres, angles, s, e, d, w[4], w[5]) for s, e, d, w in zip(to_sun, elevation, days, weather)
        )
    worst_of = dict(hours=0.0, sky_view=0.0, direct_kwh_m2=0.0, diffuse_kwh_m2=0.0)
    different, asked = 0, 0
    n = int(up.sum())
    bits = [
        np.unpackbits(found[name][chosen], axis=1, count=int(c), bitorder="little").astype(bool)
        for name, c in (("suns_seen", counts[0]), ("patches_seen", counts[1]))
    ]
    for i, sensor in enumerate(chosen):
        faces_it = rays @ normals[i] > 0
        seen = np.zeros(len(rays), bool)
        seen[faces_it] = ~blocked(corners, eyes[i], rays[faces_it])
        asked += int(faces_it.sum())
        different += int((seen[:n] != bits[0][i]).sum() + (seen[n:] != bits[1][i]).sum())
        cosine = np.maximum(centres @ normals[i], 0) * angles * seen[n:]
        values = dict(hours=float(seen[:n].sum()), sky_view=cosine.sum() / np.sum(centres[:, 2] * angles))
        if sky is not None:
            beam = weather[up, 4] * np.maximum(to_sun[up] @ normals[i], 0) * seen[:n]
            values["direct_kwh_m2"] = beam.sum() / 1000
            values["diffuse_kwh_m2"] = (cosine * sky).sum() / 1000
        for name, value in values.items():
            difference = abs(float(found[name][sensor]) - value) / max(1.0, abs(value))
            worst_of[name] = max(worst_of[name], difference)
        print(f"\r{i + 1} of {len(chosen)} sensors", end="", file=sys.stderr)
    print(file=sys.stderr)
    result = dict(
        triangles=len(faces), sensors=len(chosen), suns=n, patches=len(centres), rays=asked, different_rays=different,
        largest_difference_of_sun_degrees=float(worst), largest_relative_differences=worst_of, seconds=round(time.time() - start, 1),
    )
    print(json.dumps(result, indent=2))
    agrees = max(worst_of.values()) <= 1e-6 and worst < 0.01
    sys.exit(0 if agrees else 1)


if __name__ == "__main__":
    main()
