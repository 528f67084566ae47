"""The scene of embreex: meshes are added by ``mesh_construction``, rays traced by ``run``."""

from __future__ import annotations

from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._core import Scene
from .rtcore import EmbreeDevice

_FAR = 1e37
"""Where rays end if nothing else is said."""


class EmbreeScene:
    """Triangle meshes, and queries about rays. The tree is built at the first query.

    Parameters
    ----------
    device : EmbreeDevice, optional
        A device. Changes nothing.
    robust : bool
        Changes nothing: answers are watertight either way.

    Raises
    ------
    TypeError
        The device is something else.

    Examples
    --------
    >>> import numpy as np
    >>> from antumbra.embreex import mesh_construction, rtcore_scene
    >>> scene = rtcore_scene.EmbreeScene()
    >>> mesh = mesh_construction.TriangleMesh(scene, np.float32([[0, 0, 1], [1, 0, 1], [0, 1, 1]]), np.int32([[0, 1, 2]]))
    >>> scene.run(np.float32([[0.2, 0.2, 0]]), np.float32([[0, 0, 1]]), query="DISTANCE")
    array([1.], dtype=float32)
    """

    def __init__(self, device: EmbreeDevice | None = None, robust: bool = True) -> None:
        if device is not None and not isinstance(device, EmbreeDevice):
            raise TypeError(f"device: found {type(device).__name__}, wanted an EmbreeDevice or None")
        self.device = device or EmbreeDevice()
        self._meshes: list[tuple[NDArray[Any], NDArray[Any]]] = []
        self._normals: list[NDArray[np.float32]] = []
        self._scene: Scene | None = None

    def _add(self, vertices: NDArray[Any], faces: NDArray[Any]) -> int:
        self._meshes.append((vertices, faces))
        self._scene = None
        return len(self._meshes) - 1

    @property
    def scene(self) -> Scene:
        """The scene of all meshes that were added so far: an ``antumbra.Scene``."""
        if self._scene is None:
            # As Embree has them, vertices are rounded where they are.
            self._scene = Scene([(v.astype(np.float32), f) for v, f in self._meshes], origin=(0.0, 0.0, 0.0))
            self._normals = [_normals(*mesh) for mesh in self._meshes]
        return self._scene

    @overload
    def run(
        self,
        vec_origins: ArrayLike,
        vec_directions: ArrayLike,
        dists: ArrayLike | None = None,
        query: str = "INTERSECT",
        output: Literal[None, False, 0] = None,
    ) -> NDArray[Any]: ...
    @overload
    def run(
        self, vec_origins: ArrayLike, vec_directions: ArrayLike, dists: ArrayLike | None = None, query: str = "INTERSECT", *, output: Any
    ) -> dict[str, NDArray[Any]]: ...
    def run(
        self,
        vec_origins: ArrayLike,
        vec_directions: ArrayLike,
        dists: ArrayLike | None = None,
        query: str = "INTERSECT",
        output: Any = None,
    ) -> NDArray[Any] | dict[str, NDArray[Any]]:
        """Traces rays.

        Parameters
        ----------
        vec_origins : array (n, 3)
            Origins.
        vec_directions : array (n, 3) or (1, 3)
            Directions, of any length but 0.
        dists : float or array (n,), optional
            Ends of the rays, in lengths of their directions: 1e37.
        query : "INTERSECT", "OCCLUDED" or "DISTANCE"
            What is returned without ``output``.
        output : bool, optional
            Whether to return everything about the first hits.

        Returns
        -------
        array (n,) or dict
            INTERSECT: int32, the number of the first triangle in its mesh, -1 for none. DISTANCE: float32, the distance of the
            first hit, or the end of the ray. OCCLUDED: int32, 0 if anything is hit, -1 if not. With ``output``: a dict of ``u``,
            ``v``, ``Ng`` (n, 3), ``tfar``, ``primID`` and ``geomID``.

        Raises
        ------
        ValueError
            The query is another one, an argument has another shape, or OCCLUDED is combined with ``output``.

        Examples
        --------
        >>> import numpy as np
        >>> from antumbra.embreex import mesh_construction, rtcore_scene
        >>> scene = rtcore_scene.EmbreeScene()
        >>> mesh = mesh_construction.TriangleMesh(scene, np.float32([[[0, 0, 1], [1, 0, 1], [0, 1, 1]]]))
        >>> hits = scene.run(np.float32([[0.25, 0.5, 0]]), np.float32([[0, 0, 1]]), output=True)
        >>> hits["u"], hits["v"], hits["geomID"]
        (array([0.25], dtype=float32), array([0.5], dtype=float32), array([0], dtype=int32))
        """
        if query not in ("INTERSECT", "OCCLUDED", "DISTANCE"):
            raise ValueError(f'query: found {query!r}, wanted "INTERSECT", "OCCLUDED" or "DISTANCE"')
        origins, directions = np.asarray(vec_origins), np.asarray(vec_directions)
        count = len(origins) if origins.ndim else 0
        if origins.shape != (count, 3):
            raise ValueError(f"vec_origins: found shape {origins.shape}, wanted (n, 3)")
        if directions.shape not in ((count, 3), (1, 3)):
            raise ValueError(f"vec_directions: found shape {directions.shape}, wanted ({count}, 3) or (1, 3)")
        far = np.asarray(_FAR if dists is None else dists, np.float32)
        if far.shape not in ((), (count,)):
            raise ValueError(f"dists: found shape {far.shape}, wanted () or ({count},)")
        if query == "OCCLUDED":
            if output:
                raise ValueError(f"output: found {output!r} with OCCLUDED, wanted None: no hit is looked for")
            return np.where(self.scene.occluded(origins, directions, far), np.int32(0), np.int32(-1))
        if query == "INTERSECT" and not output:
            return self.scene.intersect(origins, directions, far).triangle
        hits = self.scene.intersect(origins, directions, far)
        distance: NDArray[np.float32] = np.where(hits.hit, hits.t, far)
        if not output:
            return distance
        normals = np.zeros((count, 3), np.float32)
        for mesh, of_mesh in enumerate(self._normals):
            here = hits.mesh == mesh
            normals[here] = of_mesh[hits.triangle[here]]
        u, v = np.ascontiguousarray(hits.uv.T)
        return {"u": u, "v": v, "Ng": normals, "tfar": distance, "primID": hits.triangle, "geomID": hits.mesh}


def _normals(vertices: NDArray[Any], faces: NDArray[Any]) -> NDArray[np.float32]:
    """Normals of triangles, as long as twice their area."""
    a, b, c = (vertices.astype(np.float32)[faces[:, corner]] for corner in range(3))
    normals: NDArray[np.float32] = np.cross(b - a, c - a)
    return normals
