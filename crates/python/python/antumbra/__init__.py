"""Occlusion queries on numpy arrays: visibility between points, sun hours, ambient occlusion.

>>> import antumbra as am
>>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
>>> scene.occluded([[0.2, 0.2, 0], [2, 2, 0]], [0, 0, 1])
array([ True, False])

Rays have any leading shape and stride, and are float32, float64 or integers. Answers have the shape of the rays.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._core import (
    BitMatrix,
    ChildOrder,
    Closest,
    DegenerateWarning,
    HitList,
    Hits,
    Map,
    Picture,
    Queries,
    Scene,
    World,
    __version__,
    get_threads,
    heat_map,
    render,
    set_threads,
    sky_patches,
    texel_atlas,
)
from ._sun import Irradiation, SunPositions, irradiation, sun_positions


class Mesh(NamedTuple):
    """One mesh of a scene: the same as the pair ``(vertices, faces)``.

    Examples
    --------
    >>> import antumbra as am
    >>> am.Scene([am.Mesh([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])])
    <antumbra.Scene: 1 meshes, 1 triangles>
    """

    vertices: Any
    """Corners of triangles, of shape (n, 3)."""
    faces: Any
    """Three vertices per triangle, of shape (m, 3)."""


class Instance(NamedTuple):
    """A placement of a mesh: the same as the pair ``(mesh, transform)``.

    Examples
    --------
    >>> import antumbra as am
    >>> import numpy as np
    >>> roof = am.Mesh([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    >>> am.Scene([roof], instances=[am.Instance(0, np.eye(4))])
    <antumbra.Scene: 1 meshes, 1 triangles, 1 instances>
    """

    mesh: int
    """Place of the mesh in the list of meshes."""
    transform: Any
    """Affine map from the mesh to the world, of shape (4, 4) or (3, 4), translation in the last column."""


class Occluders(NamedTuple):
    """Something in the way of each ray, from ``occluder``. Arrays have the shape of the rays.

    Examples
    --------
    >>> import antumbra as am
    >>> scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    >>> found = scene.occluder([[0.2, 0.2, 0], [2, 2, 0]], [0, 0, 1])
    >>> found.hit
    array([ True, False])
    >>> scene.occluded([[0.2, 0.2, 0], [2, 2, 0]], [0, 0, 1], exclude=found)
    array([False, False])
    """

    triangle: NDArray[np.int32]
    """Place of the triangle in the faces of its mesh, -1 if nothing is in the way."""
    mesh: NDArray[np.int32]
    """Place of the mesh in the list of meshes, -1 if nothing is in the way."""
    instance: NDArray[np.int32]
    """Place of the instance in the list of instances, -1 for meshes that stand in the world themselves."""

    @property
    def hit(self) -> NDArray[np.bool_]:
        """Whether anything is in the way: bool."""
        found: NDArray[np.bool_] = self.triangle >= 0
        return found


__all__ = [
    "BitMatrix",
    "ChildOrder",
    "Closest",
    "DegenerateWarning",
    "HitList",
    "Hits",
    "Instance",
    "Irradiation",
    "Map",
    "Mesh",
    "Occluders",
    "Picture",
    "Queries",
    "Scene",
    "SunPositions",
    "World",
    "__version__",
    "get_threads",
    "heat_map",
    "irradiation",
    "render",
    "set_threads",
    "sky_patches",
    "sun_positions",
    "texel_atlas",
]
