"""Ambient occlusion of the vertices of a scan, drawn with another question about rays: python ao_of_a_scan.py [FOLDER]"""

import sys
from pathlib import Path

import antumbra as am
import numpy as np


def scan(n=200):
    """A wrinkled body, as a scanner gives it: vertices and faces."""
    rng = np.random.default_rng(1)
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * n, endpoint=False), np.linspace(0.02, np.pi - 0.02, n))
    way = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], -1)
    radius = np.ones_like(u)
    for _ in range(60):
        wave, shift = rng.normal(size=3) * rng.uniform(2, 14), rng.uniform(0, 6.28)
        radius += 0.42 / (1 + np.linalg.norm(wave)) * np.sin(way @ wave + shift)
    row, column = np.mgrid[: n - 1, : 2 * n]
    a, b = row * 2 * n + column, row * 2 * n + (column + 1) % (2 * n)
    faces = np.stack([a, a + 2 * n, b, b, a + 2 * n, b + 2 * n], -1)
    return (radius[..., None] * way).reshape(-1, 3), faces.reshape(-1, 3)


def vertex_normals(vertices, faces):
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return sum(np.stack([np.bincount(faces[:, k], normals[:, x], len(vertices)) for x in range(3)], -1) for k in range(3))


vertices, faces = scan()
scene = am.Scene(vertices, faces)
open_sky = scene.ambient_occlusion(vertices, vertex_normals(vertices, faces), samples=64)
print(f"{len(faces)} triangles, {len(vertices)} vertices: {open_sky.min():.2f} to {open_sky.max():.2f} open")

# A camera: one ray for each pixel, all from one point.
size = 420
x, y = np.meshgrid(np.linspace(-0.4, 0.4, size), np.linspace(0.4, -0.4, size))
directions = np.stack([np.ones_like(x), -x, y], -1)
hits = scene.intersect([-3.6, 0, 0], directions)

# The values of the three corners, by their weights where the ray hits.
weights = np.concatenate([1 - hits.uv.sum(-1, keepdims=True), hits.uv], -1)
shade = (open_sky[faces[hits.triangle]] * weights).sum(-1)
folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
am.Picture(np.where(hits.hit, shade**2.2, 0.02)).save(folder / "ao_of_a_scan.png")
