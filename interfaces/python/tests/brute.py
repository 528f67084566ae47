"""Answers about rays and points in numpy alone: every ray against every triangle, in double precision."""

import numpy as np

EDGE = 1e-6
"""Rays that pass so near an edge, in weights of corners, are not compared: rounding decides about them."""


def soup(rng, triangles, size=1.0):
    """Triangles anywhere in a cube, each with corners of its own, which float32 holds exactly."""
    middle = rng.uniform(-1, 1, (triangles, 1, 3))
    corners = middle + size * rng.uniform(-0.5, 0.5, (triangles, 3, 3))
    vertices = corners.reshape(-1, 3).astype(np.float32)
    return vertices, np.arange(3 * triangles).reshape(-1, 3)


def box(low=(-1, -1, -1), high=(1, 1, 1)):
    """A closed box, its triangles counterclockwise seen from outside."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    corner = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
    vertices = low + corner * (high - low)
    faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
             [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]]
    return vertices, np.array(faces)


def all_hits(vertices, faces, origins, directions):
    """Distances of every ray to every triangle, inf where it misses, and whether each is clear of edges and ends."""
    a, b, c = (np.asarray(vertices, float)[faces[:, k]] for k in range(3))
    o, d = np.asarray(origins, float)[:, None], np.asarray(directions, float)[:, None]
    e, f = b - a, c - a
    with np.errstate(all="ignore"):
        p = np.cross(d, f)
        det = np.einsum("mk,nmk->nm", e, p)
        s = o - a
        u = np.einsum("nmk,nmk->nm", s, p) / det
        q = np.cross(s, e)
        v = np.einsum("nmk,nmk->nm", np.broadcast_to(d, q.shape), q) / det
        t = np.einsum("mk,nmk->nm", f, q) / det
        scale = np.linalg.norm(d, axis=-1) * np.linalg.norm(np.cross(e, f), axis=-1)
        flat = np.abs(det) < 1e-6 * scale
        inside = (u >= 0) & (v >= 0) & (u + v <= 1)
        near_edge = np.minimum(np.minimum(np.abs(u), np.abs(v)), np.abs(1 - u - v)) < EDGE
    clear = ~(near_edge | flat | (np.abs(t) < 1e-6))
    return np.where(inside & (t > 0), t, np.inf), clear


def first_hits(vertices, faces, origins, directions):
    """Distance and triangle of the first hit of each ray, and whether the answer is beyond rounding."""
    t, clear = all_hits(vertices, faces, origins, directions)
    if not len(faces):
        return np.full(len(t), np.inf), np.full(len(t), -1), np.ones(len(t), bool)
    triangle = t.argmin(1)
    best = np.take_along_axis(t, triangle[:, None], 1)[:, 0]
    second = np.partition(t, 1, 1)[:, 1] if t.shape[1] > 1 else np.full(len(t), np.inf)
    with np.errstate(invalid="ignore"):
        tie = (second - best < 1e-5 * np.maximum(best, 1)) & np.isfinite(second)
    return best, np.where(np.isfinite(best), triangle, -1), clear.all(1) & ~tie


def closest(vertices, faces, points):
    """Distance of each point to the nearest triangle, by trying faces, edges and corners."""
    a, b, c = (np.asarray(vertices, float)[faces[:, k]][None] for k in range(3))
    p = np.asarray(points, float)[:, None]

    def to_segment(a, b):
        along = b - a
        part = ((p - a) * along).sum(-1) / (along * along).sum(-1)
        return np.linalg.norm(a + np.clip(part, 0, 1)[..., None] * along - p, axis=-1)

    best = np.minimum(np.minimum(to_segment(a, b), to_segment(b, c)), to_segment(c, a))
    normal = np.cross(b - a, c - a)
    height = ((p - a) * normal).sum(-1) / (normal * normal).sum(-1)
    foot = p - height[..., None] * normal
    side = [(np.cross(y - x, foot - x) * normal).sum(-1) >= 0 for x, y in ((a, b), (b, c), (c, a))]
    over = side[0] & side[1] & side[2]
    best = np.where(over, np.minimum(best, np.abs(height) * np.linalg.norm(normal, axis=-1)), best)
    return best.min(1)
