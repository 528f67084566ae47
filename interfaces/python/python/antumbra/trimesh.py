"""trimesh's queries about rays, answered by antumbra.

``antumbra.trimesh.install()`` changes every mesh that is made from then on, and
``mesh.ray = antumbra.trimesh.RayMeshIntersector(mesh)`` one.

Names, arguments and results equal ``trimesh.ray.ray_pyembree.RayMeshIntersector``. Where the two differ:

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
    """Queries about rays and one mesh. The tree is built at the first one, and again when the mesh has changed.

    Parameters
    ----------
    geometry : trimesh.Trimesh
        Mesh.
    scale_to_box : bool
        Changes nothing.

    Examples
    --------
    >>> import trimesh
    >>> from antumbra.trimesh import RayMeshIntersector
    >>> mesh = trimesh.creation.box()
    >>> mesh.ray = RayMeshIntersector(mesh)
    >>> mesh.contains([[0, 0, 0], [2, 0, 0]])
    array([ True, False])
    """

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
        """Whether each ray hits the mesh.

        Parameters
        ----------
        ray_origins, ray_directions : array (n, 3)
            Rays. Directions have any length but 0.

        Returns
        -------
        array (n,) of bool

        Raises
        ------
        ValueError
            The arrays have other shapes.

        Examples
        --------
        >>> import trimesh
        >>> from antumbra.trimesh import RayMeshIntersector
        >>> ray = RayMeshIntersector(trimesh.creation.box())
        >>> ray.intersects_any([[0.1, 0.2, 5], [9, 9, 9]], [[0, 0, -1], [0, 0, -1]])
        array([ True, False])
        """
        return self.scene.occluded(*_rays(ray_origins, ray_directions))

    def intersects_first(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, **_: Any
    ) -> NDArray[np.int64]:
        """The first triangle that each ray hits.

        Parameters
        ----------
        ray_origins, ray_directions : array (n, 3)
            Rays. Directions have any length but 0.

        Returns
        -------
        array (n,) of int64
            -1 for none.

        Raises
        ------
        ValueError
            The arrays have other shapes.

        Examples
        --------
        >>> import trimesh
        >>> from antumbra.trimesh import RayMeshIntersector
        >>> ray = RayMeshIntersector(trimesh.creation.box())
        >>> ray.intersects_first([[9, 9, 9]], [[0, 0, -1]])
        array([-1])
        """
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
        """Triangle and ray of each hit, and its location if that is wanted.

        Parameters
        ----------
        ray_origins, ray_directions : array (n, 3)
            Rays. Directions have any length but 0.
        multiple_hits : bool
            Whether all hits of a ray are returned, or the first.
        max_hits : int
            Number of hits of a ray that are kept, the nearest first.
        return_locations : bool
            Whether to return locations as well.

        Returns
        -------
        triangles, rays : arrays (m,) of int64
        locations : array (m, 3) of float64
            With ``return_locations``.

        Raises
        ------
        ValueError
            The arrays have other shapes.

        Examples
        --------
        >>> import trimesh
        >>> from antumbra.trimesh import RayMeshIntersector
        >>> ray = RayMeshIntersector(trimesh.creation.box())
        >>> triangles, rays = ray.intersects_id([[0.1, 0.2, 5]], [[0, 0, -1]])
        >>> rays
        array([0, 0])
        """
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
        """Location, ray and triangle of each hit.

        Parameters
        ----------
        ray_origins, ray_directions : array (n, 3)
            Rays. Directions have any length but 0.
        multiple_hits : bool
            Whether all hits of a ray are returned, or the first.

        Returns
        -------
        locations : array (m, 3) of float64
        rays, triangles : arrays (m,) of int64

        Raises
        ------
        ValueError
            The arrays have other shapes.

        Examples
        --------
        >>> import trimesh
        >>> from antumbra.trimesh import RayMeshIntersector
        >>> ray = RayMeshIntersector(trimesh.creation.box())
        >>> locations, rays, triangles = ray.intersects_location([[0.1, 0.2, 5]], [[0, 0, -1]], multiple_hits=False)
        >>> locations
        array([[0.1, 0.2, 0.5]])
        """
        triangles, rays, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits, return_locations=True
        )
        return locations, rays, triangles

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether each point is inside the mesh.

        Parameters
        ----------
        points : array (n, 3)
            Points.

        Returns
        -------
        array (n,) of bool

        Raises
        ------
        ValueError
            The arrays have other shapes.

        Examples
        --------
        >>> import trimesh
        >>> from antumbra.trimesh import RayMeshIntersector
        >>> ray = RayMeshIntersector(trimesh.creation.box())
        >>> ray.contains_points([[0, 0, 0], [2, 0, 0]])
        array([ True, False])
        """
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
    """Makes every trimesh mesh that is made from here on query antumbra, with embreex installed or without.

    Raises
    ------
    ImportError
        There is no trimesh.

    Examples
    --------
    >>> import trimesh
    >>> import antumbra.trimesh
    >>> before = trimesh.ray.has_embree, getattr(trimesh.ray, "ray_pyembree", None)
    >>> kind = getattr(before[1], "RayMeshIntersector", None)
    >>> antumbra.trimesh.install()
    >>> type(trimesh.creation.box().ray).__module__
    'antumbra.trimesh'
    >>> trimesh.ray.has_embree, trimesh.ray.ray_pyembree = before
    >>> if kind: trimesh.ray.ray_pyembree.RayMeshIntersector = kind
    """
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
