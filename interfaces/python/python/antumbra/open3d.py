"""Open3D's ``RaycastingScene``, answered by antumbra: tensors in, tensors out; numpy in, numpy out, without Open3D.

>>> import numpy as np
>>> from antumbra.open3d import RaycastingScene
>>> scene = RaycastingScene()
>>> scene.add_triangles(np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1]], np.float32), np.array([[0, 1, 2]], np.uint32))
0
>>> scene.cast_rays([[0.2, 0.2, 0, 0, 0, 1]])["t_hit"]
array([1.], dtype=float32)

Names, arguments and results equal ``open3d.t.geometry.RaycastingScene``. Results are tensors where rays or points are
tensors, or a mesh came from Open3D. Otherwise they are arrays, and Open3D is not imported. Where the two differ:

- Rays and points may be float64, which are brought to a local origin before they are rounded. Results are float32.
- ``list_intersections`` has the hits of each ray by distance.
- ``count_intersections`` and ``list_intersections`` report a hit on an edge or a vertex once for each side of the mesh, not once
  for each triangle.
- A point is inside if it is inside any geometry, also where several overlap. Random samples are not needed for that:
  ``nsamples`` changes nothing.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._core import Closest, HitList, Hits, Scene
from ._meshes import meshes as _meshes


class RaycastingScene:
    """Triangle meshes, and queries about rays and points. The tree is built at the first query.

    Parameters
    ----------
    nthreads : int
        Number of threads of calls that do not say it; 0 for all.
    device : optional
        ``"CPU:0"`` or a device of Open3D of this name.

    Raises
    ------
    ValueError
        The device is another one.

    Examples
    --------
    >>> import numpy as np
    >>> from antumbra.open3d import RaycastingScene
    >>> scene = RaycastingScene()
    >>> scene.add_triangles(np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1]], np.float32), np.array([[0, 1, 2]], np.uint32))
    0
    >>> scene.test_occlusions([[0.2, 0.2, 0, 0, 0, 1]])
    array([ True])
    """

    INVALID_ID = 0xFFFFFFFF
    """Geometry and primitive of a ray that hits nothing."""

    def __init__(self, nthreads: int = 0, device: Any = None) -> None:
        if device is not None and not str(device).upper().startswith("CPU"):
            raise ValueError(f"device: found {device}, wanted CPU:0")
        self._meshes: list[tuple[NDArray[Any], NDArray[Any]]] = []
        self._threads = nthreads
        self._scene: Scene | None = None
        self._has_tensors = False

    def add_triangles(self, vertex_positions: Any, triangle_indices: Any = None) -> int:
        """Adds a mesh.

        Parameters
        ----------
        vertex_positions : tensor or array (n, 3), or a mesh
            Vertices. Without triangles, a mesh: of Open3D, or any that ``Scene`` takes.
        triangle_indices : tensor or array (m, 3), optional
            Three vertices per triangle.

        Returns
        -------
        int
            Number of the mesh, which hits have in ``geometry_ids``.

        Raises
        ------
        TypeError
            There is no mesh in what was given.

        Examples
        --------
        >>> import antumbra.open3d
        >>> scene = antumbra.open3d.RaycastingScene()
        >>> scene.add_triangles([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
        0
        """
        given = vertex_positions if triangle_indices is None else (vertex_positions, triangle_indices)
        if triangle_indices is None:
            (mesh,), _ = _meshes(given)
            self._has_tensors |= _is_of_open3d(given)
        else:
            mesh = (_numpy(vertex_positions), _numpy(triangle_indices))
            self._has_tensors |= _is_of_open3d(vertex_positions) or _is_of_open3d(triangle_indices)
        self._meshes.append(mesh)
        self._scene = None
        return len(self._meshes) - 1

    @property
    def scene(self) -> Scene:
        """The scene of all meshes that were added so far: an ``antumbra.Scene``."""
        if self._scene is None:
            self._scene = Scene(self._meshes, threads=self._threads or None)
        return self._scene

    def _like(self, given: Any, found: Any) -> Any:
        """What was found, in tensors if what was given is one, or a mesh was."""
        if not (self._has_tensors or _is_of_open3d(given)):
            return found
        if isinstance(found, dict):
            return {name: _tensor(array) for name, array in found.items()}
        return _tensor(found)

    def _of(self, nthreads: int) -> int | None:
        """Number of threads of a call."""
        return nthreads or self._threads or None

    def cast_rays(self, rays: Any, nthreads: int = 0) -> dict[str, Any]:
        """First hits of rays.

        Parameters
        ----------
        rays : tensor or array (..., 6)
            Origin and direction in a row.
        nthreads : int
            Number of threads; 0 for the threads of the scene.

        Returns
        -------
        dict
            ``t_hit`` float32, ``geometry_ids`` and ``primitive_ids`` uint32, ``primitive_uvs`` (..., 2) and
            ``primitive_normals`` (..., 3) float32. Misses have inf, INVALID_ID and 0.

        Raises
        ------
        ValueError
            The rays have another shape.

        Examples
        --------
        >>> import antumbra.open3d
        >>> scene = antumbra.open3d.RaycastingScene()
        >>> _ = scene.add_triangles([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
        >>> scene.cast_rays([[0.25, 0.5, 0, 0, 0, 1]])["primitive_uvs"]
        array([[0.25, 0.5 ]], dtype=float32)
        """
        hits = self.scene.intersect(_numpy(rays), threads=self._of(nthreads))
        found = {"t_hit": hits.t, **_ids(hits), "primitive_uvs": hits.uv, "primitive_normals": _normals(hits)}
        return self._like(rays, found)  # type: ignore[no-any-return]

    def test_occlusions(self, rays: Any, tnear: float = 0.0, tfar: float = np.inf, nthreads: int = 0) -> Any:
        """Whether anything is in the way of rays.

        Parameters
        ----------
        rays : tensor or array (..., 6)
            Origin and direction in a row.
        tnear, tfar : float
            Interval that counts, in lengths of the direction.
        nthreads : int
            Number of threads; 0 for the threads of the scene.

        Returns
        -------
        tensor or array (...) of bool

        Raises
        ------
        ValueError
            The rays have another shape.

        Examples
        --------
        >>> import antumbra.open3d
        >>> scene = antumbra.open3d.RaycastingScene()
        >>> _ = scene.add_triangles([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
        >>> scene.test_occlusions([[0.2, 0.2, 0, 0, 0, 1]], tfar=0.5)
        array([False])
        """
        found = self.scene.occluded(_numpy(rays), distance=tfar, near=tnear, threads=self._of(nthreads))
        return self._like(rays, found)

    def count_intersections(self, rays: Any, nthreads: int = 0) -> Any:
        """Number of hits of rays.

        Parameters
        ----------
        rays : tensor or array (..., 6)
            Origin and direction in a row.
        nthreads : int
            Number of threads; 0 for the threads of the scene.

        Returns
        -------
        tensor or array (...) of int32

        Raises
        ------
        ValueError
            The rays have another shape.

        Examples
        --------
        Through the diagonal of a square:

        >>> import antumbra.open3d
        >>> scene = antumbra.open3d.RaycastingScene()
        >>> _ = scene.add_triangles([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], [[0, 1, 2], [0, 2, 3]])
        >>> scene.count_intersections([[0.5, 0.5, 0, 0, 0, 1]])
        array([1], dtype=int32)
        """
        found = self.scene.count(_numpy(rays), distinct=True, threads=self._of(nthreads))
        return self._like(rays, found)

    def list_intersections(self, rays: Any, nthreads: int = 0) -> dict[str, Any]:
        """All hits of rays, ray by ray, the nearest first.

        Parameters
        ----------
        rays : tensor or array (..., 6)
            Origin and direction in a row.
        nthreads : int
            Number of threads; 0 for the threads of the scene.

        Returns
        -------
        dict
            ``ray_splits`` (n + 1,), where the hits of each ray begin, ``ray_ids``, ``t_hit``, ``geometry_ids``,
            ``primitive_ids`` (m,) and ``primitive_uvs`` (m, 2).

        Raises
        ------
        ValueError
            The rays have another shape.

        Examples
        --------
        >>> import antumbra.open3d
        >>> scene = antumbra.open3d.RaycastingScene()
        >>> _ = scene.add_triangles([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
        >>> scene.list_intersections([[0.2, 0.2, 0, 0, 0, 1], [5, 5, 0, 0, 0, 1]])["ray_splits"]
        array([0, 1, 1])
        """
        hits = self.scene.intersect_all(_numpy(rays), distinct=True, threads=self._of(nthreads))
        found = {
            "ray_splits": hits.splits,
            "ray_ids": hits.ray,
            "t_hit": hits.t,
            **_ids(hits),
            "primitive_uvs": hits.uv,
        }
        return self._like(rays, found)  # type: ignore[no-any-return]

    def compute_closest_points(self, query_points: Any, nthreads: int = 0) -> dict[str, Any]:
        """Nearest points of the surfaces.

        Parameters
        ----------
        query_points : tensor or array (..., 3)
            Points.
        nthreads : int
            Number of threads; 0 for the threads of the scene.

        Returns
        -------
        dict
            ``points`` (..., 3), ``geometry_ids``, ``primitive_ids``, ``primitive_uvs`` (..., 2), ``primitive_normals`` (..., 3).

        Raises
        ------
        ValueError
            The points have another shape.

        Examples
        --------
        >>> import antumbra.open3d
        >>> scene = antumbra.open3d.RaycastingScene()
        >>> _ = scene.add_triangles([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
        >>> scene.compute_closest_points([[0.25, 0.25, 3]])["points"]
        array([[0.25, 0.25, 1.  ]], dtype=float32)
        """
        near = self.scene.closest(_numpy(query_points), threads=self._of(nthreads))
        found = {
            "points": near.point.astype(np.float32),
            **_ids(near),
            "primitive_uvs": near.uv,
            "primitive_normals": _normals(near),
        }
        return self._like(query_points, found)  # type: ignore[no-any-return]

    def compute_distance(self, query_points: Any, nthreads: int = 0) -> Any:
        """Distances of points to the nearest surface.

        Parameters
        ----------
        query_points : tensor or array (..., 3)
            Points.
        nthreads : int
            Number of threads; 0 for the threads of the scene.

        Returns
        -------
        tensor or array (...) of float32

        Raises
        ------
        ValueError
            The points have another shape.

        Examples
        --------
        >>> import antumbra.open3d
        >>> scene = antumbra.open3d.RaycastingScene()
        >>> _ = scene.add_triangles([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
        >>> scene.compute_distance([[0.25, 0.25, 3]])
        array([2.], dtype=float32)
        """
        found = self.scene.closest(_numpy(query_points), threads=self._of(nthreads)).distance
        return self._like(query_points, found)

    def compute_signed_distance(self, query_points: Any, nthreads: int = 0, nsamples: int = 1) -> Any:
        """Distances of points to the nearest surface, negative inside.

        Parameters
        ----------
        query_points : tensor or array (..., 3)
            Points.
        nthreads : int
            Number of threads; 0 for the threads of the scene.
        nsamples : int
            An odd number. Changes nothing, since one ray is enough here.

        Returns
        -------
        tensor or array (...) of float32

        Raises
        ------
        ValueError
            The points have another shape, or ``nsamples`` is even.

        Examples
        --------
        >>> import antumbra.open3d
        >>> scene = antumbra.open3d.RaycastingScene()
        >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
        >>> _ = scene.add_triangles(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        >>> scene.compute_signed_distance([[0.25, 0.25, 0.125], [0, 0, 2]])
        array([-0.125,  1.   ], dtype=float32)
        """
        _odd(nsamples)
        found = self.scene.signed_distance(_numpy(query_points), threads=self._of(nthreads))
        return self._like(query_points, found)

    def compute_occupancy(self, query_points: Any, nthreads: int = 0, nsamples: int = 1) -> Any:
        """Whether points are inside.

        Parameters
        ----------
        query_points : tensor or array (..., 3)
            Points.
        nthreads : int
            Number of threads; 0 for the threads of the scene.
        nsamples : int
            An odd number. Changes nothing, since one ray is enough here.

        Returns
        -------
        tensor or array (...) of float32
            1 for points inside, 0 for points outside.

        Raises
        ------
        ValueError
            The points have another shape, or ``nsamples`` is even.

        Examples
        --------
        >>> import antumbra.open3d
        >>> scene = antumbra.open3d.RaycastingScene()
        >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
        >>> _ = scene.add_triangles(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        >>> scene.compute_occupancy([[0.25, 0.25, 0.125], [0, 0, 2]])
        array([1., 0.], dtype=float32)
        """
        _odd(nsamples)
        found = self.scene.contains(_numpy(query_points), threads=self._of(nthreads)).astype(np.float32)
        return self._like(query_points, found)

    @staticmethod
    def create_rays_pinhole(*arguments: Any, **named: Any) -> Any:
        """Rays of a camera without lens, through the middles of pixels.

        Either by matrices, ``(intrinsic_matrix, extrinsic_matrix, width_px, height_px)``, or by a view,
        ``(fov_deg, center, eye, up, width_px, height_px)``. Directions have a depth of 1. As in Open3D, a view has its rows
        from the bottom up, and its columns from right to left.

        Parameters
        ----------
        intrinsic_matrix : tensor or array (3, 3)
            From the camera to pixels.
        extrinsic_matrix : tensor or array (4, 4)
            From the world to the camera.
        fov_deg : float
            Horizontal angle of view.
        center, eye, up : tensors or arrays (3,)
            Point in the middle of the picture, place of the camera, and a direction that is up in the picture.
        width_px, height_px : int
            Pixels of a row, and rows.

        Returns
        -------
        tensor or array (height, width, 6) of float32
            A tensor if a matrix or a vector is one.

        Raises
        ------
        TypeError
            Arguments are missing, or too many.

        Examples
        --------
        >>> import antumbra.open3d
        >>> rays = antumbra.open3d.RaycastingScene.create_rays_pinhole(
        ...     fov_deg=60, center=[0, 0, 0], eye=[0, 0, 5], up=[0, 1, 0], width_px=4, height_px=3)
        >>> rays.shape
        (3, 4, 6)
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
        if any(_is_of_open3d(given) for given in (*arguments, *named.values())):
            return _tensor(rays)
        return rays


def _numpy(values: Any) -> NDArray[Any]:
    """Tensors and vectors of Open3D, and whatever else becomes an array."""
    if hasattr(values, "numpy"):
        values = values.cpu().numpy() if hasattr(values, "cpu") else values.numpy()
    return np.asarray(values)


def _tensor(array: Any) -> Any:
    """The array as a tensor of Open3D."""
    # By its name: type checkers need not have Open3D.
    core: Any = importlib.import_module("open3d.core")
    return core.Tensor.from_numpy(np.ascontiguousarray(array).reshape(np.shape(array)))


def _is_of_open3d(given: Any) -> bool:
    return any(kind.__module__.partition(".")[0] == "open3d" for kind in type(given).__mro__)


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
