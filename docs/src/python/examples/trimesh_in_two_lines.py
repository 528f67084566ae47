"""trimesh with the rays of antumbra: python trimesh_in_two_lines.py [FOLDER]"""

import sys
from pathlib import Path

import antumbra.trimesh

antumbra.trimesh.install()

# From here on it is trimesh as ever.
import numpy as np
import trimesh

# A chain of three links.
links = [trimesh.creation.torus(1.0, 0.2) for _ in range(3)]
links[1].apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
for place, link in enumerate(links):
    link.apply_translation([1.2 * (place - 1), 0, 0])
mesh = trimesh.util.concatenate(links)
mesh.apply_transform(trimesh.transformations.euler_matrix(0.6, 0.4, 0.3))
print(type(mesh.ray))

# How thick the body is along each ray: hits come in pairs.
size = 400
x, y = np.meshgrid(np.linspace(-2.5, 2.5, size), np.linspace(2.5, -2.5, size))
origins = np.stack([x, y, np.full_like(x, 5)], -1).reshape(-1, 3)
directions = np.broadcast_to([0, 0, -1.0], origins.shape)
locations, index_ray, _ = mesh.ray.intersects_location(origins, directions)
signs = np.where(np.arange(len(index_ray)) - np.searchsorted(index_ray, index_ray) & 1, -1, 1)
thickness = np.bincount(index_ray, signs * locations[:, 2], len(origins)).reshape(size, size)
print(f"{len(mesh.faces)} triangles, {len(locations)} hits, at most {thickness.max():.2f} thick")
print("volume", round(thickness.sum() * (5 / (size - 1)) ** 2, 2), "by rays")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
antumbra.heat_map(thickness, 0, 1).save(folder / "trimesh_in_two_lines.png")
