"""Meshes of other packages, and grids of heights, as vertices and faces. No package is imported: objects bring theirs."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._labelled import plan, real

Pair = tuple[Any, Any]
"""Vertices and faces."""

Placement = tuple[int, Any]
"""Number of a mesh, and its transform."""

_WANTED = (
    "wanted vertices and faces, a mesh (of trimesh, Open3D, pyvista or meshio, or any object with vertices and faces), "
    "Curves, a trimesh.Scene, or a list of these, of pairs (vertices, faces) and of Assembly"
)


def meshes(given: Any) -> tuple[list[Any], list[Placement]]:
    """Meshes of an object or of a list of objects, and where they are placed if the objects say so. Curves and assemblies stay what they are."""
    if isinstance(given, (str, os.PathLike)):
        raise TypeError(f"meshes: found the path {os.fspath(given)!r}, {_WANTED}; use Scene.from_file to read a file")
    scene = _trimesh_scene(given)
    if scene is not None:
        return scene
    if _is_taken_whole(given):
        return [given], []
    mesh = _mesh(given, "meshes")
    if mesh is not None:
        return [mesh], []
    if isinstance(given, tuple) and len(given) == 2 and all(len(getattr(item, "shape", ())) == 2 for item in given):
        return [given], []
    if hasattr(given, "dtype") or hasattr(given, "__dlpack__"):
        shape = tuple(getattr(given, "shape", ()))
        if len(shape) == 2 and shape[1] == 3 and shape[0] != 0:
            raise TypeError(f"faces: found none beside an array of shape {shape}, wanted integers of shape (m, 3)")
        hint = "; use Scene.from_heights for a grid of heights" if len(shape) == 2 else ""
        if shape != (0,):
            raise TypeError(f"meshes: found an array of shape {shape}, {_WANTED}{hint}")
    if not isinstance(given, Iterable):
        raise TypeError(f"meshes: found {_name(given)}, {_WANTED}")
    pairs: list[Any] = []
    placements: list[Placement] = []
    for place, item in enumerate(given):
        if _is_taken_whole(item):
            pairs.append(item)
            continue
        scene = _trimesh_scene(item)
        if scene is not None:
            placements += [(len(pairs) + mesh, transform) for mesh, transform in scene[1]]
            pairs += scene[0]
            continue
        mesh = _mesh(item, f"meshes[{place}]")
        if mesh is None:
            mesh = _pair(item, place)
        pairs.append(mesh)
    return pairs, placements


def _is_taken_whole(given: Any) -> bool:
    """Whether something is as the classes Curves or Assembly."""
    return all(hasattr(given, name) for name in ("points", "radii", "kind", "counts")) or hasattr(given, "instances")


def _pair(item: Any, place: int) -> Pair:
    if isinstance(item, (tuple, list)) and len(item) == 2:
        return item[0], item[1]
    found = f"the path {os.fspath(item)!r}" if isinstance(item, (str, os.PathLike)) else _name(item)
    raise TypeError(
        f"meshes: item {place} is neither a pair (vertices, faces) nor a mesh: found {found}, wanted one of both"
    )


def _name(thing: Any) -> str:
    kind = type(thing)
    return kind.__name__ if kind.__module__ == "builtins" else f"{kind.__module__}.{kind.__name__}"


def _packages(thing: Any) -> Iterator[str]:
    """Packages whose classes an object is of."""
    return (kind.__module__.partition(".")[0] for kind in type(thing).__mro__)


def _trimesh_scene(given: Any) -> tuple[list[Pair], list[Placement]] | None:
    """Meshes that the nodes of a trimesh.Scene name, and one instance for each node, in the order of ``nodes_geometry``."""
    if "trimesh" not in _packages(given) or not hasattr(given, "graph") or not hasattr(given, "geometry"):
        return None
    numbers: dict[str, int] = {}
    pairs: list[Pair] = []
    placements: list[Placement] = []
    left_out: set[str] = set()
    for node in given.graph.nodes_geometry:
        transform, name = given.graph.get(node)
        mesh = given.geometry[name]
        if not hasattr(mesh, "faces"):
            left_out.add(f"{name} ({_name(mesh)})")
            continue
        if name not in numbers:
            numbers[name] = len(pairs)
            pairs.append((mesh.vertices, mesh.faces))
        placements.append((numbers[name], transform))
    if left_out:
        warnings.warn(f"without faces, and left out: {', '.join(sorted(left_out))}", UserWarning, stacklevel=3)
    return pairs, placements


def _mesh(given: Any, where: str) -> Pair | None:
    """Vertices and faces of one mesh; None for what is none."""
    packages = set(_packages(given))
    if "open3d" in packages:
        return _open3d(given, where)
    if packages & {"pyvista", "vtkmodules"}:
        return _pyvista(given, where)
    if "meshio" in packages:
        return _meshio(given, where)
    if hasattr(given, "vertices") and hasattr(given, "faces"):
        return given.vertices, given.faces
    return None


def _open3d(given: Any, where: str) -> Pair | None:
    if hasattr(given, "vertex") and hasattr(given, "triangle"):
        return _tensor(given.vertex.positions), _tensor(given.triangle.indices)
    if hasattr(given, "vertices") and hasattr(given, "triangles"):
        return np.asarray(given.vertices), np.asarray(given.triangles)
    if hasattr(given, "numpy"):
        return None
    raise TypeError(f"{where}: found {_name(given)}, wanted a TriangleMesh of Open3D")


def _tensor(given: Any) -> Any:
    """A tensor as an array, wherever it is."""
    return given.cpu().numpy()


def _pyvista(given: Any, where: str) -> Pair:
    if not hasattr(given, "is_all_triangles") or not hasattr(given, "triangulate"):
        raise TypeError(f"{where}: found {_name(given)}, wanted pyvista.PolyData: use its method extract_surface()")
    surface = given if _is_triangles(given) else given.triangulate()
    if given.n_cells and not surface.faces.size:
        raise ValueError(f"{where}: found {_name(given)} without polygons, wanted triangles or polygons")
    return surface.points, surface.faces.reshape(-1, 4)[:, 1:]


def _is_triangles(given: Any) -> bool:
    every = given.is_all_triangles
    return bool(every() if callable(every) else every) and not given.n_strips


def _meshio(given: Any, where: str) -> Pair:
    """Triangles of the blocks, in their order. A quad is two triangles, a polygon a fan from its first corner. Lines and
    vertices hit nothing, and are left out."""
    faces: list[NDArray[Any]] = []
    for block in given.cells:
        data = np.asarray(block.data) if block.type != "polygon" else block.data
        if block.type == "triangle":
            faces.append(data)
        elif block.type == "quad":
            faces.append(data[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))
        elif block.type == "polygon":
            faces += [_fan(np.asarray(polygon)) for polygon in data]
        elif block.type not in ("vertex", "line", "line3"):
            raise ValueError(
                f"{where}: found cells of type {block.type!r}, wanted triangles, quads or polygons: extract the surface first"
            )
    return given.points, np.concatenate(faces) if faces else np.zeros((0, 3), np.int64)


def _fan(polygon: NDArray[Any]) -> NDArray[Any]:
    return np.stack([np.broadcast_to(polygon[0], len(polygon) - 2), polygon[1:-1], polygon[2:]], -1)


def grid(heights: Any, transform: Any) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and faces of a grid of heights: see ``Scene.from_heights``."""
    if hasattr(heights, "coords") and hasattr(heights, "dims"):
        z, x, y = _labelled(heights, transform)
    else:
        z = real(heights)
        if z.ndim != 2:
            raise ValueError(f"heights: found shape {z.shape}, wanted (rows, columns)")
        rows, columns = np.arange(float(z.shape[0])), np.arange(float(z.shape[1]))
        x, y = _placed(rows[:, None], columns, transform)
    vertices = np.stack(np.broadcast_arrays(x, y, z), -1).reshape(-1, 3)
    return vertices, _cells(vertices.reshape(*z.shape, 3))


def _labelled(heights: Any, transform: Any) -> tuple[NDArray[np.float64], ...]:
    """Heights of an xarray.DataArray, and the coordinates x and y of its columns and rows."""
    if transform is not None:
        raise ValueError("transform: found one beside a DataArray, whose coordinates x and y say where it is; wanted None")
    heights = plan(heights)
    rows, columns = heights.dims
    missing = [name for name in (rows, columns) if name not in heights.coords]
    if missing:
        raise ValueError(f"heights: found no coordinates along {missing[0]!r}, wanted y and x with coordinates")
    x, y = (np.asarray(heights.coords[name].values, np.float64) for name in (columns, rows))
    return real(heights.values), x, y[:, None]


def _placed(rows: Any, columns: Any, transform: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """x and y of heights by their rows and columns."""
    numbers = np.asarray((1.0, 1.0) if transform is None else tuple(transform), np.float64)
    if not np.isfinite(numbers).all():
        raise ValueError(f"transform: found {numbers.tolist()}, wanted finite numbers")
    if numbers.shape == (2,):
        dx, dy = numbers
        return dx * columns, dy * rows
    if numbers.shape == (9,) and numbers[6:].tolist() == [0.0, 0.0, 1.0]:
        numbers = numbers[:6]
    if numbers.shape != (6,):
        raise ValueError(
            f"transform: found {numbers.size} numbers, wanted (dx, dy) or (a, b, c, d, e, f), "
            "as rasterio's transform has them; GDAL's GetGeoTransform() has the order (c, a, b, f, d, e)"
        )
    a, b, c, d, e, f = numbers
    column, row = columns + 0.5, rows + 0.5
    return a * column + b * row + c, d * column + e * row + f


def _cells(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Two triangles for each cell whose corners are finite, one where one is not; counterclockwise seen from above."""
    rows, columns = points.shape[:2]
    if rows < 2 or columns < 2:
        raise ValueError(f"heights: found shape {(rows, columns)}, wanted at least 2 rows and 2 columns")
    numbers = np.arange(rows * columns).reshape(rows, columns)
    first, right, below, last = numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, :-1], numbers[1:, 1:]
    along, down = points[0, 1, :2] - points[0, 0, :2], points[1, 0, :2] - points[0, 0, :2]
    turn = along[0] * down[1] - along[1] * down[0]
    if turn == 0:
        raise ValueError("transform: found rows and columns that run the same way, wanted a grid with an area")
    if turn > 0 and along[1] == down[0] == 0:
        # From the south, or mirrored: read the other way, squares are cut from north west to south east, as in files.
        first, right, below, last, turn = right, first, last, below, -turn
    whole = np.isfinite(points[..., 2]).reshape(-1)
    # Of four triangles in the square, those that keep off a missing corner.
    cut = whole[first] & whole[last]
    cells = [(first, np.where(cut, last, below), right), (np.where(cut, first, right), below, last)]
    faces = np.stack([np.stack(cell, -1) for cell in cells], 2).reshape(-1, 3)
    if turn > 0:
        faces = faces[:, [0, 2, 1]]
    kept: NDArray[np.int64] = faces[whole[faces].all(1)]
    return kept
