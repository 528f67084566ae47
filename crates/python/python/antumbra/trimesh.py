"""trimesh's questions about rays, answered by antumbra.

>>> import antumbra.trimesh
>>> antumbra.trimesh.install()              # every mesh from here on
>>> mesh.ray = antumbra.trimesh.RayMeshIntersector(mesh)        # or one

Names, arguments and results are those of ``trimesh.ray.ray_pyembree.RayMeshIntersector``. Where the two differ:

- All hits of a ray are found in one traversal, and come ray by ray, the nearest first.
- ``contains_points`` of a watertight mesh is exact, and uses trimesh's own heuristic for other meshes.
- Coordinates are rounded once, to float32 around a local origin. ``scale_to_box`` changes nothing.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._core import Scene

_OFFSET = 1e-6
"""Hits that lie so near the last one, in units of the mesh's size, are the same: a ray through an edge meets two triangles."""

_SMALLEST_OFFSET = 1e-8


class RayMeshIntersector:
    """Questions about rays and one mesh. The tree is built at the first one, and again when the mesh has changed."""

    def __init__(self, geometry: Any, scale_to_box: bool = True) -> None:
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._cached: tuple[int, Scene] | None = None

    @property
    def scene(self) -> Scene:
        """The scene of the mesh as it is now."""
        key = hash(self.mesh)
        if self._cached is None or self._cached[0] != key:
            vertices = np.asarray(self.mesh.vertices)
            self._cached = key, Scene(vertices, np.asarray(self.mesh.faces))
        return self._cached[1]

    def intersects_any(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, **_: Any
    ) -> NDArray[np.bool_]:
        """Whether each ray hits the mesh: bool of shape (n,)."""
        return self.scene.occluded(*_rays(ray_origins, ray_directions))

    def intersects_first(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, **_: Any
    ) -> NDArray[np.int64]:
        """The first triangle that each ray hits, -1 for none: int64 of shape (n,)."""
        return self.scene._first_triangles(*_rays(ray_origins, ray_directions))

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int = 100,
        return_locations: bool = False,
        **_: Any,
    ) -> tuple[NDArray[Any], ...]:
        """Triangle and ray of each hit, and its location if asked for: int64, int64, float64 of shape (m, 3)."""
        mesh = self.mesh
        found = self.scene._distinct_hits(
            *_rays(ray_origins, ray_directions),
            np.asarray(mesh.vertices),
            max_hits=max_hits if multiple_hits else min(max_hits, 1),
            offset=max(_SMALLEST_OFFSET, float(mesh.scale) * _OFFSET),
        )
        return found if return_locations else found[:2]

    def intersects_location(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        **_: Any,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Location, ray and triangle of each hit: float64 of shape (m, 3), int64, int64."""
        triangles, rays, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits, return_locations=True
        )
        return locations, rays, triangles

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether each point lies inside the mesh: bool of shape (n,)."""
        if self.mesh.is_watertight:
            return self.scene.contains(points)
        from trimesh.ray.ray_util import contains_points

        inside: NDArray[np.bool_] = contains_points(self, points)
        return inside

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_cached": None}

    def __copy__(self, *_: Any) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh, self._scale_to_box)

    __deepcopy__ = __copy__


def _rays(origins: ArrayLike, directions: ArrayLike) -> tuple[NDArray[Any], NDArray[Any]]:
    """Both as arrays, which must be as long as each other."""
    o, d = np.asanyarray(origins), np.asanyarray(directions)
    if o.shape != d.shape:
        raise ValueError("Ray origin and direction don't match!")
    return o, d


def install() -> None:
    """Makes every trimesh mesh that is made from here on ask antumbra, with embreex installed or without."""
    import trimesh

    ray: Any = trimesh.ray
    if ray.has_embree:
        ray.ray_pyembree.RayMeshIntersector = RayMeshIntersector
        return
    # A module of ours takes the place of the one that could not be imported.
    module: Any = ModuleType("trimesh.ray.ray_pyembree")
    module.RayMeshIntersector = RayMeshIntersector
    sys.modules[module.__name__] = ray.ray_pyembree = module
    ray.has_embree = True
