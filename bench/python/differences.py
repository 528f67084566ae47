"""Rays whose first triangle differs between antumbra and embreex, one by one, in double precision.

For each ray: the triangles of both, how far apart they are along the ray, relative to the distance, and how near the ray passes to
an edge of either, in weights of corners. A ray is explained if either is within rounding of single precision."""

import antumbra as am
import numpy as np
import scenes
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene


def meet(vertices, triangle, origin, direction):
    """Distance to the plane of a triangle, and the smallest weight of a corner there."""
    a, b, c = vertices[triangle].astype(float)
    e, f, p = b - a, c - a, np.cross(direction, c - a)
    det, s = e @ p, origin - a
    u, v = s @ p / det, direction @ np.cross(s, e) / det
    return f @ np.cross(s, e) / det, min(u, v, 1 - u - v)


for name in ("city", "terrain"):
    vertices, faces = getattr(scenes, name)()
    scene, embree = am.Scene(vertices, faces), EmbreeScene()
    TriangleMesh(embree, vertices, faces)
    for kind, (origins, directions) in scenes.rays(name, vertices, faces, 1_000_000).items():
        ours, theirs = scene.intersect(origins, directions).triangle, embree.run(origins, directions)
        explained = 0
        different = np.flatnonzero(ours != theirs)
        for ray in different:
            o, d = origins[ray].astype(float), directions[ray].astype(float)
            found = [meet(vertices, faces[t], o, d) for t in (ours[ray], theirs[ray]) if t >= 0]
            apart = abs(found[0][0] - found[-1][0]) / max(abs(found[0][0]), 1)
            # A coordinate of the scene is up to 1000 times as large as a small triangle: so much is a weight off.
            edge = min(abs(weight) for _, weight in found)
            good = (len(found) == 2 and apart < 1e-5) or edge < 1e-3
            explained += good
            print(f"{name} {kind} ray {ray}: {ours[ray]} and {theirs[ray]}, {apart:.1e} apart, {edge:.1e} from an edge", "" if good else "UNEXPLAINED")
        print(f"{name} {kind}: {len(different)} differ, {explained} explained")
