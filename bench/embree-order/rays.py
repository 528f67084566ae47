#!/usr/bin/env python3
"""Triangles and occlusion rays of a scene, for `embree-order`: rays.py SCENE.pbrt UP SEED POINTS FOLDER

Meshes are the PLY files that SCENE names outside of objects; objects and their instances are left out. UP is y or z. Rays start at random points of the surfaces (by area, on either side), 16 from each
point, in the order of a space-filling curve:

    shadow   to random points of the scene's area lights
    ao       cosine-weighted about the normal, unbounded
    sun      to 16 positions of a sun between two horizons, those above the surface only

Writes NAME.triangles (9 floats each) and NAME.KIND.GROUP.rays (origin, tnear, direction, tfar). The groups `training` (1024
points) and `held-out` (POINTS points) share no point.
"""

import os
import re
import sys

import numpy as np

TYPES = {"char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2", "int": "<i4", "uint": "<u4", "float": "<f4", "double": "<f8"}
TRAINING = 1024
PER_POINT = 16


def read_ply(path):
    """Corners of the triangles of a binary file, [n, 3, 3]."""
    with open(path, "rb") as file:
        data = file.read()
    end = data.index(b"end_header\n") + 11
    elements = []
    for line in data[:end].decode("ascii").splitlines():
        words = line.split()
        if words[0] == "format" and words[1] != "binary_little_endian":
            sys.exit(f"{path}: {words[1]}, not binary_little_endian")
        if words[0] == "element":
            elements.append((words[1], int(words[2]), []))
        if words[0] == "property":
            elements[-1][2].append(words[1:])
    (vertex, count, properties), (face, faces, lists) = elements
    assert (vertex, face, lists[0][0], len(lists)) == ("vertex", "face", "list", 1), path
    layout = np.dtype([(name, TYPES[kind]) for kind, name in properties])
    points = np.frombuffer(data, layout, count, end)
    end += count * layout.itemsize
    points = np.stack([points[axis] for axis in "xyz"], 1).astype(np.float32)
    layout = np.dtype([("n", TYPES[lists[0][1]]), ("i", TYPES[lists[0][2]], 3)])
    corners = np.frombuffer(data, layout, faces, end)
    assert (corners["n"] == 3).all(), f"{path}: a face is no triangle"
    return points[corners["i"]]


def lights(text):
    """Triangles of the area lights, [n, 3, 3]."""
    found = []
    for part in text.split("AreaLightSource")[1:]:
        part = part.split("AttributeEnd")[0]
        for indices, points in re.findall(r'"integer indices" \[([^\]]*)\] "point P" \[([^\]]*)\]', part):
            points = np.array(points.split(), np.float32).reshape(-1, 3)
            found.append(points[np.array(indices.split(), int).reshape(-1, 3)])
    return np.concatenate(found)


def sample(triangles, count, source):
    """Random points by area, with unit normals."""
    sides = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normals = np.cross(*sides).astype(np.float64)
    areas = np.linalg.norm(normals, axis=1)
    chosen = source.choice(len(triangles), count, p=areas / areas.sum())
    u, v = source.random((2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return triangles[chosen, 0] + u * sides[0][chosen] + v * sides[1][chosen], normals[chosen] / areas[chosen, None]


def morton(points):
    """Places along a space-filling curve."""
    low, high = points.min(0), points.max(0)
    cells = ((points - low) / (high - low).max() * 1023).astype(np.int64)
    return sum(((cells[:, axis] >> bit) & 1) << (3 * bit + axis) for bit in range(10) for axis in range(3))


def rays(origins, directions, far):
    return np.column_stack([origins, np.zeros(len(origins)), directions, np.broadcast_to(far, len(origins))]).astype(np.float32)


def make(triangles, lamps, up, count, source):
    points, normals = sample(triangles, count, source)
    normals *= source.choice([-1, 1], (count, 1))
    order = np.argsort(morton(points), kind="stable")
    points, normals = (np.repeat(of[order], PER_POINT, 0) for of in (points, normals))
    size = np.linalg.norm(triangles.reshape(-1, 3).max(0) - triangles.reshape(-1, 3).min(0))
    origins = points + 1e-4 * size * normals
    shadow = sample(lamps, len(origins), source)[0] - origins
    facing = (shadow * normals).sum(1) > 0
    ball = source.normal(size=(len(origins), 3))
    ao = normals + ball / np.linalg.norm(ball, axis=1)[:, None]
    angle = (0.05 + 0.9 * np.tile(np.arange(PER_POINT) / (PER_POINT - 1), count)) * np.pi
    sun = np.stack([np.cos(angle), 0.3 + 0 * angle, np.sin(angle)], 1)
    if up == "y":
        sun = sun[:, [0, 2, 1]]
    above = (sun * normals).sum(1) > 0
    return {"shadow": rays(origins, shadow, 0.999)[facing], "ao": rays(origins, ao, np.inf), "sun": rays(origins, sun, np.inf)[above]}


def main():
    if len(sys.argv) != 6 or sys.argv[2] not in "yz":
        sys.exit("usage: rays.py SCENE.pbrt y|z SEED POINTS FOLDER")
    path, up, seed, count, folder = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), sys.argv[5]
    with open(path) as file:
        text = file.read()
    here = os.path.dirname(path)
    world = re.sub(r"ObjectBegin.*?ObjectEnd", "", text, flags=re.S)
    meshes = re.findall(r'Shape "plymesh" "string filename" \["([^"]*)"\]', world)
    if not meshes:
        sys.exit(f"{path}: no mesh outside of objects")
    triangles = np.concatenate([read_ply(os.path.join(here, name)) for name in dict.fromkeys(meshes)])
    base = os.path.join(folder, os.path.splitext(os.path.basename(path))[0])
    os.makedirs(folder, exist_ok=True)
    triangles.astype(np.float32).tofile(base + ".triangles")
    source = np.random.default_rng(seed)
    for group, points in (("training", TRAINING), ("held-out", count)):
        for kind, found in make(triangles, lights(text), up, points, source).items():
            found.tofile(f"{base}.{kind}.{group}.rays")


if __name__ == "__main__":
    main()
