"""Open3D's ``RaycastingScene``, answered by antumbra: numpy in, numpy out, without Open3D.

>>> from antumbra.open3d import RaycastingScene
>>> scene = RaycastingScene()
>>> scene.add_triangles(vertices, triangles)
0
>>> scene.cast_rays(rays)["t_hit"]

Names, arguments and results are those of ``open3d.t.geometry.RaycastingScene``, with arrays in place of tensors. Where the
two differ:

- Rays and points may be float64, which are brought to a local origin before they are rounded. Results are float32.
- ``list_intersections`` has the hits of each ray by distance.
- A point is inside if it is inside any geometry, also where several overlap. Random samples are not needed for that:
  ``nsamples`` changes nothing.
"""

from __future__ import annotations

from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._core import Closest, HitList, Hits, Scene


class RaycastingScene:
    """Triangle meshes, and questions about rays and points. The tree is built at the first question."""

    INVALID_ID = 0xFFFFFFFF
    """Geometry and primitive of a ray that hits nothing."""

    def __init__(self, nthreads: int = 0, device: Any = None) -> None:
        if device is not None and not str(device).upper().startswith("CPU"):
            raise ValueError(f"device: found {device}, wanted CPU:0")
        self._meshes: list[tuple[NDArray[Any], NDArray[Any]]] = []
        self._threads = nthreads
        self._scene: Scene | None = None

    def add_triangles(self, vertex_positions: Any, triangle_indices: Any = None) -> int:
        """Adds a mesh, and returns its number. Vertices are (n, 3), triangles (m, 3).

        One argument may be a mesh: one of Open3D, or any object with ``vertices`` and ``faces``.
        """
        if triangle_indices is None:
            mesh = vertex_positions
            if hasattr(mesh, "vertex"):
                vertices, triangles = mesh.vertex.positions, mesh.triangle.indices
            elif hasattr(mesh, "triangles") and not hasattr(mesh, "faces"):
                vertices, triangles = mesh.vertices, mesh.triangles
            else:
                vertices, triangles = mesh.vertices, mesh.faces
        else:
            vertices, triangles = vertex_positions, triangle_indices
        self._meshes.append((_numpy(vertices), _numpy(triangles)))
        self._scene = None
        return len(self._meshes) - 1

    @property
    def scene(self) -> Scene:
        """The scene of all meshes added so far."""
        if self._scene is None:
            self._scene = Scene(self._meshes, threads=self._threads or None)
        return self._scene

    def _of(self, nthreads: int) -> int | None:
        """Number of threads of a call."""
        return nthreads or self._threads or None

    def cast_rays(self, rays: ArrayLike, nthreads: int = 0) -> dict[str, NDArray[Any]]:
        """First hits of rays (..., 6): ``t_hit``, ``geometry_ids``, ``primitive_ids``, ``primitive_uvs``, ``primitive_normals``."""
        hits = self.scene.intersect(_numpy(rays), threads=self._of(nthreads))
        return {"t_hit": hits.t, **_ids(hits), "primitive_uvs": hits.uv, "primitive_normals": _normals(hits)}

    def test_occlusions(
        self, rays: ArrayLike, tnear: float = 0.0, tfar: float = np.inf, nthreads: int = 0
    ) -> NDArray[np.bool_]:
        """Whether anything is in the way of rays (..., 6) between two distances: bool."""
        return self.scene.occluded(_numpy(rays), distance=tfar, near=tnear, threads=self._of(nthreads))

    def count_intersections(self, rays: ArrayLike, nthreads: int = 0) -> NDArray[np.int32]:
        """Number of hits of rays (..., 6): int32."""
        return self.scene.count(_numpy(rays), threads=self._of(nthreads))

    def list_intersections(self, rays: ArrayLike, nthreads: int = 0) -> dict[str, NDArray[Any]]:
        """All hits of rays (..., 6): ``ray_splits``, ``ray_ids``, ``t_hit``, ``geometry_ids``, ``primitive_ids``, ``primitive_uvs``."""
        hits = self.scene.intersect_all(_numpy(rays), threads=self._of(nthreads))
        return {
            "ray_splits": hits.splits,
            "ray_ids": hits.ray,
            "t_hit": hits.t,
            **_ids(hits),
            "primitive_uvs": hits.uv,
        }

    def compute_closest_points(self, query_points: ArrayLike, nthreads: int = 0) -> dict[str, NDArray[Any]]:
        """Nearest points of the surfaces: ``points``, ``geometry_ids``, ``primitive_ids``, ``primitive_uvs``, ``primitive_normals``."""
        near = self.scene.closest(_numpy(query_points), threads=self._of(nthreads))
        return {
            "points": near.point.astype(np.float32),
            **_ids(near),
            "primitive_uvs": near.uv,
            "primitive_normals": _normals(near),
        }

    def compute_distance(self, query_points: ArrayLike, nthreads: int = 0) -> NDArray[np.float32]:
        """Distances of points to the nearest surface: float32."""
        return self.scene.closest(_numpy(query_points), threads=self._of(nthreads)).distance

    def compute_signed_distance(
        self, query_points: ArrayLike, nthreads: int = 0, nsamples: int = 1
    ) -> NDArray[np.float32]:
        """Distances of points to the nearest surface, negative inside: float32."""
        _odd(nsamples)
        points, threads = _numpy(query_points), self._of(nthreads)
        distance = self.scene.closest(points, threads=threads).distance
        signed: NDArray[np.float32] = np.where(self.scene.contains(points, threads=threads), -distance, distance)
        return signed

    def compute_occupancy(
        self, query_points: ArrayLike, nthreads: int = 0, nsamples: int = 1
    ) -> NDArray[np.float32]:
        """1 for points inside, 0 for points outside: float32."""
        _odd(nsamples)
        return self.scene.contains(_numpy(query_points), threads=self._of(nthreads)).astype(np.float32)

    @overload
    @staticmethod
    def create_rays_pinhole(
        intrinsic_matrix: ArrayLike, extrinsic_matrix: ArrayLike, width_px: int, height_px: int
    ) -> NDArray[np.float32]: ...
    @overload
    @staticmethod
    def create_rays_pinhole(
        *, fov_deg: float, center: ArrayLike, eye: ArrayLike, up: ArrayLike, width_px: int, height_px: int
    ) -> NDArray[np.float32]: ...
    @staticmethod
    def create_rays_pinhole(*arguments: Any, **named: Any) -> NDArray[np.float32]:
        """Rays (height, width, 6) of a camera without lens, through the middles of pixels.

        Either by matrices, ``(intrinsic_matrix, extrinsic_matrix, width_px, height_px)``, or by a view,
        ``(fov_deg, center, eye, up, width_px, height_px)``. The angle of view is the horizontal one. Directions have a depth of 1. As in Open3D, a
        view has its rows from the bottom up, and its columns from right to left.
        """
        if len(arguments) + len(named) == 6:
            intrinsic, extrinsic, width, height = _view(*arguments, **named)
        else:
            intrinsic, extrinsic, width, height = _matrices(*arguments, **named)
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        pixels = np.stack([x, y, np.ones_like(x)], -1)
        turn, move = extrinsic[:3, :3], extrinsic[:3, 3]
        rays = np.empty((height, width, 6), np.float32)
        rays[..., :3] = -turn.T @ move
        rays[..., 3:] = pixels @ np.linalg.inv(intrinsic).T @ turn
        return rays


def _numpy(values: Any) -> NDArray[Any]:
    """Tensors and vectors of Open3D, and whatever else becomes an array."""
    return np.asarray(values.numpy() if hasattr(values, "numpy") else values)


def _ids(found: Hits | HitList | Closest) -> dict[str, NDArray[np.uint32]]:
    """-1 becomes INVALID_ID."""
    return {"geometry_ids": found.mesh.view(np.uint32), "primitive_ids": found.triangle.view(np.uint32)}


def _normals(found: Hits | Closest) -> NDArray[np.float32]:
    """Normals, 0 where nothing is hit."""
    normals = found.normal.copy()
    normals[found.triangle < 0] = 0
    return normals


def _odd(nsamples: int) -> None:
    if nsamples < 1 or nsamples % 2 == 0:
        raise ValueError(f"nsamples: found {nsamples}, wanted an odd number of at least 1")


def _matrices(
    intrinsic_matrix: ArrayLike, extrinsic_matrix: ArrayLike, width_px: int, height_px: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], int, int]:
    return _numpy(intrinsic_matrix).astype(float), _numpy(extrinsic_matrix).astype(float), width_px, height_px


def _view(
    fov_deg: float, center: ArrayLike, eye: ArrayLike, up: ArrayLike, width_px: int, height_px: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], int, int]:
    focal = 0.5 * width_px / np.tan(0.5 * np.radians(fov_deg))
    intrinsic = np.array([[focal, 0, 0.5 * width_px], [0, focal, 0.5 * height_px], [0, 0, 1]])
    here = _numpy(eye).astype(float)
    ahead = _numpy(center).astype(float) - here
    ahead /= np.linalg.norm(ahead)
    across = np.cross(_numpy(up).astype(float), ahead)
    across /= np.linalg.norm(across)
    extrinsic = np.eye(4)
    extrinsic[:3, :3] = across, np.cross(ahead, across), ahead
    extrinsic[:3, 3] = -extrinsic[:3, :3] @ here
    return intrinsic, extrinsic, width_px, height_px
