"""Meshes of embreex: what is made is added to a scene."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .rtcore_scene import EmbreeScene

# Sides of a hexahedron, each cut along the diagonal from its first corner. Where the second triangle comes first, that is the order
# of embreex, which numbers triangles so.
_SIDES = [((0, 3, 2, 1), True), ((4, 5, 6, 7), False), ((0, 1, 5, 4), False), ((1, 2, 6, 5), False), ((0, 4, 7, 3), True), ((3, 7, 6, 2), True)]
_HEXAHEDRON = [
    triangle
    for (a, b, c, d), is_swapped in _SIDES
    for triangle in ([(a, c, d), (a, b, c)] if is_swapped else [(a, b, c), (a, c, d)])
]
_TETRAHEDRON = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


class TriangleMesh:
    """Triangles, which are added to a scene.

    Parameters
    ----------
    scene : EmbreeScene
        Scene that they are added to.
    vertices : array (m, 3, 3) or (n, 3)
        Corners of each triangle, or vertices that indices name.
    indices : array (m, 3) of integers, optional
        Three vertices per triangle.

    Raises
    ------
    IndexError
        An index names a vertex that is not there.
    ValueError
        An argument has another shape.

    Examples
    --------
    >>> import numpy as np
    >>> from antumbra.embreex import mesh_construction, rtcore_scene
    >>> scene = rtcore_scene.EmbreeScene()
    >>> mesh = mesh_construction.TriangleMesh(scene, np.float32([[[0, 0, 1], [1, 0, 1], [0, 1, 1]]]))
    >>> scene.run(np.float32([[0.2, 0.2, 0]]), np.float32([[0, 0, 1]]))
    array([0], dtype=int32)
    """

    def __init__(self, scene: EmbreeScene, vertices: ArrayLike, indices: ArrayLike | None = None) -> None:
        corners = np.asarray(vertices)
        if indices is None:
            if corners.ndim != 3 or corners.shape[1:] != (3, 3):
                raise ValueError(f"vertices: found shape {corners.shape} without indices, wanted (m, 3, 3)")
            self._mesh = scene._add(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        else:
            faces = _indices(corners, indices, (3,))
            self._mesh = scene._add(corners, faces)


class ElementMesh(TriangleMesh):
    """Sides of tetrahedra or hexahedra, which are added to a scene: 4 or 12 triangles for each.

    Parameters
    ----------
    scene : EmbreeScene
        Scene that they are added to.
    vertices : array (n, 3)
        Vertices.
    indices : array (m, 4) or (m, 8) of integers
        Corners of each element. The corners of a hexahedron go around one side, then around the side across, as in Exodus II.

    Raises
    ------
    IndexError
        An index names a vertex that is not there.
    ValueError
        An argument has another shape.

    Examples
    --------
    >>> import numpy as np
    >>> from antumbra.embreex import mesh_construction, rtcore_scene
    >>> scene = rtcore_scene.EmbreeScene()
    >>> corners = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> mesh = mesh_construction.ElementMesh(scene, corners, np.int32([[0, 1, 2, 3]]))
    >>> scene.run(np.float32([[-0.1, 0.1, 0.1]]), np.float32([[1, 0, 0]]), query="DISTANCE")
    array([0.1], dtype=float32)
    """

    def __init__(self, scene: EmbreeScene, vertices: ArrayLike, indices: ArrayLike) -> None:
        corners = np.asarray(vertices)
        elements = _indices(corners, indices, (4, 8))
        sides = _TETRAHEDRON if elements.shape[1] == 4 else _HEXAHEDRON
        self._mesh = scene._add(corners, elements[:, sides].reshape(-1, 3))


def _indices(vertices: NDArray[Any], indices: ArrayLike, corners: tuple[int, ...]) -> NDArray[np.int64]:
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ValueError(f"vertices: found shape {vertices.shape} with indices, wanted (n, 3)")
    array = np.asarray(indices)
    if array.ndim != 2 or array.shape[1] not in corners:
        wanted = " or ".join(f"(m, {count})" for count in corners)
        raise ValueError(f"indices: found shape {array.shape}, wanted {wanted}")
    if array.size and (array.dtype.kind not in "iu" or array.min() < 0 or array.max() >= len(vertices)):
        raise IndexError(f"indices: found {array.min()} to {array.max()}, wanted integers from 0 to {len(vertices) - 1}")
    return array.astype(np.int64)
