"""Height fields: the arguments of questions about the cells of a raster of heights."""

from __future__ import annotations

import math
import warnings
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._core import _Field, _suns
from ._labelled import cells, real
from ._sun import SunPositions

REFRACTION = 0.13
EARTH_RADIUS = 6_371_008.8
SHOWN = ["sky-view", "sky-open", "openness"]


class Horizons(NamedTuple):
    """How high the surface is around each cell, from ``HeightField.horizons``.

    Examples
    --------
    >>> import antumbra as am
    >>> found = am.HeightField([[0, 0, 2], [0, 0, 2]]).horizons([90])
    >>> found.azimuths, found.angles.shape
    (array([90.]), (1, 2, 3))
    """

    azimuths: NDArray[np.float64]
    """Degrees from the north of the map (y) through east: (n,)."""
    angles: NDArray[np.float32]
    """Elevations of the horizon in degrees: (n, rows, columns). -90 where no surface is ahead, NaN without data."""


class Sky(NamedTuple):
    """How much of the sky each cell sees, from ``HeightField.sky``.

    Examples
    --------
    >>> import antumbra as am
    >>> am.HeightField([[0, 0], [0, 0]]).sky().values
    array([[1., 1.],
           [1., 1.]], dtype=float32)
    """

    values: NDArray[np.float32]
    """The measure of each cell: (rows, columns). NaN without data."""
    quadrature_error: tuple[float, float] | None
    """Mean and greatest difference from the next coarser lattice, or from every second azimuth; None if there are too few."""


class HeightField:
    """Heights in the cells of a raster, such as a digital elevation model, whose cells are answered all at once.

    The surface has a vertex at the centre of each cell. Each square between four centres is two triangles, cut from north west to south
    east in whatever order the heights are stored; turned grids are cut from ``heights[i, j]`` to ``heights[i + 1, j + 1]``. A square with
    one corner without data is one triangle, and one with more is a hole.

    Answers are exact for this surface, and bits are the same for any number of threads. They need no mesh, tree or rays: a cell costs a few
    operations however far it looks.

    Parameters
    ----------
    heights : array (rows, columns) of real numbers, or xarray.DataArray
        Heights in the unit of the cells. NaN, and what is masked in a masked array, is no data. An array of float64 in C order is not
        copied, so leave it as it is while you use the field; other types and orders are, and so are rows from south to north. A DataArray
        has evenly spaced coordinates: see ``antumbra.xarray``.
    transform : six numbers, affine.Affine or float, optional
        Where the cells are. Six numbers are in the order of GDAL's ``GetGeoTransform()``, for corners of cells:
        ``x = t[0] + column * t[1] + row * t[2]``, ``y = t[3] + column * t[4] + row * t[5]``. rasterio's ``transform`` is an Affine. One number
        is the edge of square cells in rows from north to south, of which the first corner is at 0, 0; 1 without it.

    Raises
    ------
    ValueError, TypeError
        The heights have another shape or type, or are infinite, or the transform is none.

    Examples
    --------
    A wall of 2 m in the east of a plain:

    >>> import antumbra as am
    >>> field = am.HeightField([[0, 0, 0, 2], [0, 0, 0, 2]], 1.0)
    >>> field
    <antumbra.HeightField: 2 x 4 cells>
    >>> field.lit(90.0, 50.0)
    array([[ True,  True, False,  True],
           [ True,  True, False,  True]])
    """

    def __init__(self, heights: Any, transform: Any = None) -> None:
        if hasattr(heights, "coords") and hasattr(heights, "dims"):
            if transform is not None:
                raise ValueError("transform: found one beside a DataArray, whose coordinates say where it is; wanted None")
            _, heights, transform = cells(heights)
        array = real(heights)
        if array.ndim != 2:
            raise ValueError(f"heights: found shape {array.shape}, wanted (rows, columns)")
        rows, columns = array.shape
        x, a, b, y, d, e = self._transform = _transform(transform)
        # Mirrored grids are read the other way, so that squares are cut as in files.
        is_level = b == d == 0
        down, right = (-1 if is_level and e > 0 else 1), (-1 if is_level and a < 0 else 1)
        if down < 0:
            y, e = y + e * rows, -e
        if right < 0:
            x, a = x + a * columns, -a
        self._order = (..., slice(None, None, down), slice(None, None, right))
        self._given = array
        self._field = _Field(np.require(array[self._order], np.float64, ["C", "A"]), (x, a, b, y, d, e))

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of rows and columns."""
        return self._given.shape

    @property
    def transform(self) -> tuple[float, float, float, float, float, float]:
        """Where the cells are: six numbers in the order of GDAL."""
        return self._transform

    def horizons(
        self,
        azimuths: str | ArrayLike = "lattice:16",
        *,
        rise: float = 0.0,
        curvature: bool = False,
        refraction: float = REFRACTION,
        earth_radius: float = EARTH_RADIUS,
        threads: int | None = None,
        progress: Any = None,
    ) -> Horizons:
        """How high the surface around each cell is in each azimuth: all of the sky above is seen.

        Parameters
        ----------
        azimuths : str or array (n,)
            ``"lattice:N"`` has the azimuths of steps between cells, for N of 8, 16, 32, 48, 80, 96, 144, 176 or 224: one sweep answers all
            cells, in the least time. They are not evenly spread. An array has degrees from the north of the map (y) through east; those
            that are steps of at most two columns and rows, such as 0 and 90, are swept too.
        rise : float
            Height of eyes above their cells, from 0.
        curvature : bool
            Whether the earth is round: places d away lie lower by ``(1 - refraction) * d**2 / (2 * earth_radius)``.
        refraction, earth_radius : float
            Refraction of light in the air, and the radius in the unit of the cells.
        threads : int, optional
            Number of threads; see ``set_threads``.
        progress : optional
            Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.

        Returns
        -------
        Horizons
            ``azimuths``, float64 of shape (n,), and ``angles``, float32 of shape (n, rows, columns), in degrees. -90 where no surface is
            ahead, as at the border. NaN without data.

        Raises
        ------
        ValueError, TypeError
            An argument is outside its range, or has another shape or type.
        MemoryError
            There is no memory for the angles.

        Examples
        --------
        >>> import antumbra as am
        >>> field = am.HeightField([[0, 0, 0, 2], [0, 0, 0, 2]])
        >>> field.horizons([90]).angles[0, 0]
        array([ 33.690067,  45.      ,  63.434948, -90.      ], dtype=float32)
        >>> field.horizons("lattice:8").azimuths
        array([  0.,  45.,  90., 135., 180., 225., 270., 315.])
        """
        drop = _drop(curvature, refraction, earth_radius)
        angles, found = self._field.horizons(_azimuths(azimuths), _from_zero("rise", rise), drop, (threads, progress))
        return Horizons(np.array(found), self._shaped(angles, len(found)))

    def sky(
        self,
        show: str = "sky-view",
        azimuths: str | ArrayLike = "lattice:16",
        *,
        rise: float = 0.0,
        threads: int | None = None,
        progress: Any = None,
    ) -> Sky:
        """How much of the sky each cell sees, summed over its horizons: what ``antumbra horizon --cells --show`` computes.

        The sky ends at the horizontal. Where no surface is ahead, as at the border, the horizon is level.

        Parameters
        ----------
        show : str
            ``"sky-view"``: part of the light of an even sky that the surface of the cell receives, ``(1 + cos s) / 2`` for a slope s
            without a horizon (Dozier and Frew 1990). ``"sky-open"``: part of the hemisphere above that neither the horizon nor the
            surface of the cell hides. ``"openness"``: degrees from the zenith down to the horizon, on average, also below the
            horizontal (Yokoyama, Shirasawa and Pike 2002).
        azimuths : str or array (n,)
            As for ``horizons``, at least one. Each stands for the part of the circle halfway to its neighbours.
        rise : float
            Height of eyes above their cells, from 0.
        threads : int, optional
            Number of threads; see ``set_threads``.
        progress : optional
            Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.

        Returns
        -------
        Sky
            ``values``, float32 of shape (rows, columns), NaN without data and, but for the openness, for cells without a triangle; and
            ``quadrature_error``.

        Raises
        ------
        ValueError, TypeError
            An argument is outside its range, or has another shape or type.
        MemoryError
            There is no memory for the values.

        Examples
        --------
        A court inside walls, whose middle sees more than its edge:

        >>> import numpy as np, antumbra as am
        >>> heights = np.pad(np.zeros((5, 5)), 1, constant_values=2.0)
        >>> values, error = am.HeightField(heights).sky()
        >>> bool(values[3, 3] > values[1, 3]), error is not None
        (True, True)
        """
        if show not in SHOWN:
            raise ValueError(f"show: found {show!r}, wanted 'sky-view', 'sky-open' or 'openness'")
        found, error = self._field.sky(SHOWN.index(show), _azimuths(azimuths), _from_zero("rise", rise), (threads, progress))
        return Sky(self._shaped(found), error if error is None else tuple(error))

    def lit(
        self,
        azimuth: ArrayLike,
        elevation: ArrayLike,
        *,
        rise: float = 0.0,
        threads: int | None = None,
        progress: Any = None,
    ) -> NDArray[np.bool_]:
        """Which cells get light from far away, such as from the sun.

        A cell is lit if the light is higher than the horizon of the cell in its azimuth. A light exactly on the horizon is hidden. Whether
        the surface faces the light does not count here, but does for ``sun_hours``.

        Parameters
        ----------
        azimuth, elevation : float or arrays (...)
            Degrees from the north of the map (y) through east, and degrees above the horizon, from -90 to 90. Shapes are broadcast.
        rise : float
            Height of eyes above their cells, from 0.
        threads : int, optional
            Number of threads, which share the lights; see ``set_threads``.
        progress : optional
            Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.

        Returns
        -------
        array (..., rows, columns) of bool
            False without data.

        Raises
        ------
        ValueError, TypeError
            An argument is outside its range, or has another type, or shapes do not fit.
        MemoryError
            There is no memory for the result.

        Examples
        --------
        >>> import antumbra as am
        >>> field = am.HeightField([[0, 0, 0, 2], [0, 0, 0, 2]])
        >>> field.lit(90, [10, 50, 90])[:, 0]
        array([[False, False, False,  True],
               [ True,  True, False,  True],
               [ True,  True,  True,  True]])
        """
        a, e = _numbers(azimuth, "azimuth"), _numbers(elevation, "elevation")
        if not (np.abs(e) <= 90).all():
            raise ValueError(f"elevation: found {e[~(np.abs(e) <= 90)].flat[0]}, wanted -90 to 90 degrees")
        try:
            a, e = np.broadcast_arrays(a, e)
        except ValueError:
            raise ValueError(f"shapes do not fit: found azimuth {a.shape}, elevation {e.shape}") from None
        lights = list(zip(a.ravel().tolist(), e.ravel().tolist()))
        lit, _ = self._field.lit(lights, _from_zero("rise", rise), (threads, progress))
        return self._shaped(lit, *a.shape)

    def sun_hours(
        self,
        suns: SunPositions | ArrayLike,
        weights: ArrayLike | None = None,
        *,
        rise: float = 0.0,
        north: float = 0.0,
        threads: int | None = None,
        progress: Any = None,
    ) -> NDArray[np.float64]:
        """Hours of direct sun of the cells, which face as the surface does: what ``antumbra sun --cells`` computes.

        Parameters
        ----------
        suns : SunPositions, or array (k, 3)
            What ``sun_positions`` returns, of which the steps by day count, or directions on the map to the sun above the horizon.
        weights : float or array (k,), optional
            Length of each step in hours, or whatever else is to be added up. Positions know the lengths of their steps; directions
            need weights.
        rise : float
            Height of sensors above their cells, from 0.
        north : float
            Angle from the north of the map (y) to true north in degrees, clockwise: the one that ``sun_positions`` was called with.
        threads : int, optional
            Number of threads; see ``set_threads``.
        progress : optional
            Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.

        Returns
        -------
        array (rows, columns) of float64
            NaN without data, and for cells that belong to no triangle.

        Raises
        ------
        ValueError, TypeError
            An argument has another shape or type, shapes do not fit, or nothing says how long a step is: directions without
            weights, or a single time.

        Examples
        --------
        >>> import antumbra as am
        >>> field = am.HeightField([[0, 0, 0, 0, 30], [0, 0, 0, 0, 30]], 10.0)
        >>> field.sun_hours([[0, 0, 1], [1, 0, 1]], weights=0.5)[0]
        array([1. , 0.5, 0.5, 0.5, 0.5])

        A whole day, in steps of an hour:

        >>> times = [f"2025-06-21T{hour:02}:30" for hour in range(24)]
        >>> sun = am.sun_positions(48.2, 16.4, times, "Europe/Vienna")
        >>> field.sun_hours(sun)[0]
        array([15., 14., 14.,  9.,  9.])
        """
        directions, lengths = _suns(suns, weights, "z")
        place = _from_zero("rise", rise), north
        hours, _ = self._field.sun_hours(_positions(suns, directions, north), lengths, place, (threads, progress))
        return self._shaped(hours)

    def viewshed(
        self,
        places: ArrayLike,
        *,
        eye: float = 0.0,
        target: float = 0.0,
        radius: float | None = None,
        curvature: bool = False,
        refraction: float = REFRACTION,
        earth_radius: float = EARTH_RADIUS,
        threads: int | None = None,
        progress: Any = None,
    ) -> NDArray[np.bool_]:
        """Which cells observers see.

        A cell is seen if no part of the surface is above the line from the eye to the centre of the cell, raised by ``target``. A line
        may touch the surface. An eye below the surface sees nothing, and a warning counts such eyes.

        Parameters
        ----------
        places : array (..., 2) or (..., 3)
            Points x, y on the surface, or x, y and z anywhere, in coordinates of the map.
        eye : float
            Height of eyes above the places, from 0.
        target : float
            Height of targets above the surface, from 0.
        radius : float, optional
            Greatest distance of sight, in plan.
        curvature, refraction, earth_radius
            A round earth, as for ``horizons``.
        threads : int, optional
            Number of threads; see ``set_threads``.
        progress : optional
            Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.

        Returns
        -------
        array (..., rows, columns) of bool
            False without data.

        Raises
        ------
        ValueError, TypeError
            An argument is outside its range, has another shape or type, or a place without z is beside the surface.
        MemoryError
            There is no memory for the result.

        Examples
        --------
        >>> import antumbra as am
        >>> field = am.HeightField([[0, 0, 9, 0, 0], [0, 0, 9, 0, 0]])
        >>> field.viewshed([0.5, -0.5], eye=1.7)
        array([[ True,  True,  True, False, False],
               [ True,  True,  True, False, False]])
        """
        sight, shape = _sight(places, eye, target, _drop(curvature, refraction, earth_radius), radius)
        seen, buried = self._field.viewshed(sight, (threads, progress))
        _warn_of_buried(buried, sight)
        return self._shaped(seen, *shape)

    def target_heights(
        self,
        places: ArrayLike,
        *,
        eye: float = 0.0,
        radius: float | None = None,
        curvature: bool = False,
        refraction: float = REFRACTION,
        earth_radius: float = EARTH_RADIUS,
        threads: int | None = None,
        progress: Any = None,
    ) -> NDArray[np.float32]:
        """Least height above ground from which one of the observers sees each cell, such as of a wind turbine on it.

        Parameters
        ----------
        places, eye, radius, curvature, refraction, earth_radius
            Observers, as for ``viewshed``. The memory is the same for any number of them.
        threads : int, optional
            Number of threads; see ``set_threads``.
        progress : optional
            Function of ``(done, total)``, or an object with ``update(n)``, as tqdm's bars have.

        Returns
        -------
        array (rows, columns) of float32
            0 where the ground is seen, inf where no height helps, for example beyond ``radius``. NaN without data.

        Raises
        ------
        ValueError, TypeError
            As for ``viewshed``.

        Examples
        --------
        >>> import antumbra as am
        >>> field = am.HeightField([[0, 0, 3, 0, 0], [0, 0, 3, 0, 0]])
        >>> field.target_heights([0.5, -0.5], eye=2)[0].round(3)
        array([0. , 0. , 0. , 3.5, 4. ], dtype=float32)
        """
        sight, _ = _sight(places, eye, 0.0, _drop(curvature, refraction, earth_radius), radius)
        heights, buried = self._field.target_heights(sight, (threads, progress))
        _warn_of_buried(buried, sight)
        return self._shaped(heights)

    def _shaped(self, values: NDArray[Any], *lead: int) -> NDArray[Any]:
        """Values of the cells, of which there may be several each, in the order of the heights."""
        made: NDArray[Any] = values.reshape(*lead, *self.shape)[self._order]
        return made

    def __repr__(self) -> str:
        rows, columns = self.shape
        return f"<antumbra.HeightField: {rows} x {columns} cells>"

    def __reduce__(self) -> tuple[Any, ...]:
        return HeightField, (self._given, self._transform)


def _transform(given: Any) -> tuple[float, float, float, float, float, float]:
    """Six numbers in the order of GDAL."""
    if hasattr(given, "to_gdal"):
        given = given.to_gdal()
    numbers = np.asarray(1.0 if given is None else given, np.float64)
    if numbers.shape == ():
        numbers = np.array([0.0, numbers, 0.0, 0.0, 0.0, -numbers])
    order = "six numbers in the order of GDAL: x0, dx by column, dx by row, y0, dy by column, dy by row"
    if numbers.shape != (6,):
        raise ValueError(f"transform: found shape {numbers.shape}, wanted {order}; an Affine; or the edge of square cells")
    found = numbers.tolist()
    x, a, b, y, d, e = found
    if not np.isfinite(numbers).all() or a * e == b * d:
        raise ValueError(f"transform: found {found}, wanted finite numbers, and cells with an area")
    if a == y == 0 and e != 0:
        raise ValueError(f"transform: found {found}, which is in the order of rasterio; wanted its Affine, or {order}")
    return x, a, b, y, d, e


def _azimuths(given: Any) -> int | list[float]:
    """Number of azimuths of a lattice, or degrees."""
    if not isinstance(given, str):
        return _numbers(given, "azimuths", 1).tolist()  # type: ignore[no-any-return]
    start, _, count = given.partition(":")
    if start != "lattice" or not count.isdecimal():
        raise ValueError(f"azimuths: found {given!r}, wanted 'lattice:8', 'lattice:16', ... or an array of degrees")
    return int(count)


def _positions(suns: Any, directions: Any, north: float) -> list[tuple[float, float]]:
    """Azimuths from true north and elevations of the suns that count, whose directions these are."""
    x, y, z = np.array(directions, np.float64).reshape(-1, 3).T
    if not hasattr(suns, "elevation"):
        if north != 0:
            raise ValueError(f"north: found {north}, wanted 0 beside directions, which are on the map already")
        if not (np.hypot(np.hypot(x, y), z) > 0).all():
            raise ValueError("suns: found a direction of length 0 or NaN, wanted directions with a length")
        return list(zip(np.degrees(np.arctan2(x, y)).tolist(), np.degrees(np.arctan2(z, np.hypot(x, y))).tolist()))
    azimuth, elevation = suns.azimuth[suns.up], suns.elevation[suns.up]
    turn, height = np.radians(azimuth + north), np.radians(elevation)
    expected = np.sin(turn) * np.cos(height), np.cos(turn) * np.cos(height), np.sin(height)
    if not np.allclose((x, y, z), expected, rtol=0, atol=1e-6):
        raise ValueError(f'north: found {north}, wanted the north that sun_positions was called with, and up="z" there')
    return list(zip(azimuth.tolist(), elevation.tolist()))


def _numbers(given: Any, name: str, axes: int | None = None) -> NDArray[np.float64]:
    """Finite numbers, with so many axes."""
    array = np.asarray(given)
    if array.dtype.kind not in "fiu" and array.size:
        raise TypeError(f"{name}: found dtype {array.dtype}, wanted real numbers")
    if axes is not None and array.ndim != axes:
        raise ValueError(f"{name}: found shape {array.shape}, wanted (n,)")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: found {array[~np.isfinite(array)].flat[0]}, wanted finite numbers")
    return array.astype(np.float64)


def _from_zero(name: str, number: float) -> float:
    if not (number >= 0 and math.isfinite(number)):
        raise ValueError(f"{name}: found {number}, wanted a length from 0")
    return float(number)


def _drop(curvature: bool, refraction: float, earth_radius: float) -> float:
    """Height that places lose per squared distance."""
    if not (0 < earth_radius < math.inf and -10 <= refraction < 1):
        wanted = "wanted a length above 0, and a number from -10 to below 1"
        raise ValueError(f"earth_radius, refraction: found {earth_radius} and {refraction}, {wanted}")
    return (1 - refraction) / (2 * earth_radius) if curvature else 0.0


def _sight(places: Any, eye: float, target: float, drop: float, radius: float | None) -> tuple[Any, tuple[int, ...]]:
    """Points with a z that is NaN on the surface, height of eyes, and limits of sight; and the shape of the places."""
    given = _numbers(places, "places")
    if given.ndim < 1 or given.shape[-1] not in (2, 3):
        raise ValueError(f"places: found shape {given.shape}, wanted (..., 2) or (..., 3)")
    if radius is not None and not radius > 0:
        raise ValueError(f"radius: found {radius}, wanted a length above 0, or None")
    points = np.full(given.shape[:-1] + (3,), np.nan)
    points[..., : given.shape[-1]] = given
    limits = _from_zero("target", target), drop, math.inf if radius is None else radius
    return (points.reshape(-1, 3).tolist(), _from_zero("eye", eye), limits), given.shape[:-1]


def _warn_of_buried(buried: int, sight: Any) -> None:
    if buried:
        warnings.warn(f"{buried} of {len(sight[0])} eyes are below the surface and see nothing", stacklevel=3)
