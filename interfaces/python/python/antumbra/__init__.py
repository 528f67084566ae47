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
from ._terrain import HeightField, Horizons, Sky


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


class Curves(NamedTuple):
    """Thin curves, such as hairs, grass and wires: one item in the list of meshes of a scene.

    Curves are flat and face every ray: a ray hits what is within the radius of the axis. Inner points join segments without a gap, and
    both ends are cut off flat. Straight segments stand for cubic curves, at most 256 for each piece. With fewer, they are no farther from
    the curve than a tenth of its largest radius.

    A hit has the number of the segment in ``triangle``, the number of the curve in ``curve`` and the parameter in ``along``. The
    nearest point of a curve is on its axis. Segments with a number that is not finite, with two equal ends or without a radius are left
    out, with a ``DegenerateWarning``.

    Parameters
    ----------
    points : array (n, 3) or (..., n, 3)
        Points of one curve, or of many curves of n points each. With ``counts``, (n, 3) of all curves one after the other.
    radii : number or array
        Radii of the points, broadcast to the shape of the points without its last axis: at least 0.
    kind : "linear", "bezier", "bspline" or "catmull-rom"
        Linear curves have at least 2 points. The others are cubic: Bezier curves have 4, 7, 10, ... points, of which
        each third one ends a piece. B-splines and Catmull-Rom splines have at least 4.
    counts : array (k,) of integers, optional
        Number of points of each curve.

    Examples
    --------
    >>> import antumbra as am
    >>> wires = am.Curves([[[0, 0, 1], [4, 0, 1], [4, 4, 1]]], 0.1)
    >>> scene = am.Scene(wires)
    >>> hits = scene.intersect([[1, 0.05, 0], [1, 0.2, 0], [4, 1, 0]], [0, 0, 1])
    >>> hits.curve, hits.along
    (array([ 0, -1,  0], dtype=int32), array([0.25,  nan, 1.25], dtype=float32))
    """

    points: Any
    """Points of shape (n, 3) for one curve, (..., n, 3) for many curves of n points, or (n, 3) with ``counts``."""
    radii: Any
    """Radii of the points: a number, or an array that is broadcast to the shape of the points without its last axis."""
    kind: str = "linear"
    """"linear"; "bezier", cubic and of 4, 7, 10, ... points; "bspline" or "catmull-rom", cubic and of at least 4 points."""
    counts: Any = None
    """Number of points of each curve, of shape (k,), where curves of different lengths are one after the other."""


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


class Assembly(NamedTuple):
    """Instances that are placed together: one item in the list of meshes of a ``Scene``, for instances of instances to any depth.

    Each path from the scene to a mesh is an instance of its own: ``hits.instance`` is its number, and ``scene.paths[hits.instance]``
    the path. Each assembly has to be placed, by an instance of the scene or by another assembly that is placed. Masks of assemblies
    count for nothing.

    Parameters
    ----------
    instances : sequence of Instance or of (mesh, transform)
        Placements inside of the assembly. A mesh is a place in the list of meshes of the scene, and may be another assembly.

    Examples
    --------
    >>> import antumbra as am
    >>> import numpy as np
    >>> def at(x):
    ...     return np.array([[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0]])
    >>> leaf = am.Mesh([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    >>> twig = am.Assembly([am.Instance(0, at(0)), am.Instance(0, at(2))])
    >>> scene = am.Scene([leaf, twig], instances=[am.Instance(1, at(0)), am.Instance(1, at(10))])
    >>> hits = scene.intersect([[0.2, 0.2, 0], [12.2, 0.2, 0]], [0, 0, 1])
    >>> scene.paths[hits.instance]
    array([[0, 0],
           [1, 1]])
    """

    instances: Any
    """Sequence of ``Instance`` or of (mesh, transform), whose mesh is a place in the list of the scene."""


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
    "Assembly",
    "BitMatrix",
    "ChildOrder",
    "Closest",
    "Curves",
    "DegenerateWarning",
    "HeightField",
    "HitList",
    "Hits",
    "Horizons",
    "Instance",
    "Irradiation",
    "Map",
    "Mesh",
    "Occluders",
    "Picture",
    "Queries",
    "Scene",
    "Sky",
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
