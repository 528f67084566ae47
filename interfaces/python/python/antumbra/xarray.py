"""Accessor of xarray: what the cells of a DataArray of heights see.

>>> import numpy as np
>>> import xarray
>>> import antumbra.xarray
>>> heights = xarray.DataArray(np.zeros((2, 3)), dims=("y", "x"), coords={"y": [15.0, 5.0], "x": [5.0, 15.0, 25.0]})
>>> heights[:, 2] = 10.0
>>> heights.antumbra.lit(90.0, 40.0).values
array([[ True, False,  True],
       [ True, False,  True]])

``import antumbra.xarray`` adds the accessor ``antumbra`` to every ``xarray.DataArray``; ``import antumbra`` by itself imports no xarray.

- Dimensions are ``y`` and ``x``, or ``northing`` and ``easting``, in any order; others have the length 1.
- Coordinates are in the unit of the heights and evenly spaced, in either direction. Where rioxarray is imported, ``heights.rio.transform()``
  counts for arrays without coordinates. Degrees are refused, because their cells have no length.
- ``_FillValue``, ``scale_factor`` and ``add_offset`` among the attributes count, as rioxarray has them.
- Arrays in chunks are loaded whole, since what is far away may be in the way.
- Results have the coordinates of the heights, the coordinate system as well, and the attributes ``units`` and ``long_name``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray
from numpy.typing import ArrayLike

from . import _labelled
from ._sun import SunPositions
from ._terrain import HeightField


@xarray.register_dataarray_accessor("antumbra")  # type: ignore[no-untyped-call]
class Terrain:
    """Questions about the cells of a DataArray of heights, its accessor ``antumbra``.

    Parameters
    ----------
    heights : xarray.DataArray
        Heights.

    Raises
    ------
    ValueError, TypeError
        The dimensions, the coordinates or the heights are none of a raster of heights.

    Examples
    --------
    >>> import xarray
    >>> import antumbra.xarray
    >>> heights = xarray.DataArray([[0, 1], [2, 3]], dims=("y", "x"), coords={"y": [15, 5], "x": [5, 15]})
    >>> heights.antumbra.field
    <antumbra.HeightField: 2 x 2 cells>
    """

    def __init__(self, heights: Any) -> None:
        self._heights, values, transform = _labelled.cells(heights)
        self.field = HeightField(values, transform)
        """The heights as a ``HeightField``."""

    def horizons(self, azimuths: str | ArrayLike = "lattice:16", **options: Any) -> Any:
        """How high the surface around each cell is in each azimuth.

        Parameters
        ----------
        azimuths, options
            As for ``HeightField.horizons``.

        Returns
        -------
        xarray.DataArray
            float32 degrees of dimensions (azimuth, y, x), with the azimuths as a coordinate.

        Raises
        ------
        ValueError, TypeError
            As ``HeightField.horizons``.

        Examples
        --------
        >>> import xarray
        >>> import antumbra.xarray
        >>> heights = xarray.DataArray([[0, 1], [0, 1]], dims=("y", "x"), coords={"y": [1, 0], "x": [0, 1]})
        >>> heights.antumbra.horizons().sel(azimuth=90.0).values
        array([[ 45., -90.],
               [ 45., -90.]], dtype=float32)
        """
        found, angles = self.field.horizons(azimuths, **options)
        north = {"units": "degrees", "long_name": "azimuth from grid north through east"}
        coords = {"azimuth": ("azimuth", found, north)}
        return self._made(angles, "horizon", "degrees", "elevation of the horizon", ("azimuth",), coords)

    def sky(self, show: str = "sky-view", azimuths: str | ArrayLike = "lattice:16", **options: Any) -> Any:
        """How much of the sky each cell sees.

        Parameters
        ----------
        show, azimuths, options
            As for ``HeightField.sky``.

        Returns
        -------
        xarray.DataArray
            float32 of dimensions (y, x), with the attribute ``quadrature_error``.

        Raises
        ------
        ValueError, TypeError
            As ``HeightField.sky``.

        Examples
        --------
        >>> import xarray
        >>> import antumbra.xarray
        >>> heights = xarray.DataArray([[0, 0], [0, 0]], dims=("y", "x"), coords={"y": [1, 0], "x": [0, 1]})
        >>> heights.antumbra.sky("openness").values
        array([[90., 90.],
               [90., 90.]], dtype=float32)
        """
        values, error = self.field.sky(show, azimuths, **options)
        unit = "degrees" if show == "openness" else "1"
        made = self._made(values, show.replace("-", "_"), unit, "sky above the cell by its horizons")
        return made if error is None else made.assign_attrs(quadrature_error=error)

    def lit(self, azimuth: Any, elevation: Any, **options: Any) -> Any:
        """Which cells get light from far away.

        Parameters
        ----------
        azimuth, elevation : float, array (k,) or xarray.DataArray
            As for ``HeightField.lit``. Dimensions of DataArrays, such as times, become dimensions of the result; the one of arrays is
            called sun.
        options
            As for ``HeightField.lit``.

        Returns
        -------
        xarray.DataArray
            bool of dimensions (..., y, x), with azimuth and elevation as coordinates.

        Raises
        ------
        ValueError, TypeError
            As ``HeightField.lit``.

        Examples
        --------
        >>> import xarray
        >>> import antumbra.xarray
        >>> heights = xarray.DataArray([[0, 1], [0, 1]], dims=("y", "x"), coords={"y": [1, 0], "x": [0, 1]})
        >>> heights.antumbra.lit(90, [30, 60]).dims
        ('sun', 'y', 'x')
        """
        def light(given: Any) -> Any:
            return given if hasattr(given, "coords") else xarray.DataArray(given, dims=("sun",)[: np.ndim(given)])

        azimuth, elevation = xarray.broadcast(light(azimuth), light(elevation))
        lit = self.field.lit(azimuth.values, elevation.values, **options)
        suns = {**azimuth.coords, "azimuth": azimuth.variable, "elevation": elevation.variable}
        return self._made(lit, "lit", "1", "whether the cell gets light", azimuth.dims, suns)

    def sun_hours(self, suns: SunPositions | ArrayLike, weights: ArrayLike | None = None, **options: Any) -> Any:
        """Hours of direct sun of the cells.

        Parameters
        ----------
        suns, weights, options
            As for ``HeightField.sun_hours``.

        Returns
        -------
        xarray.DataArray
            float64 hours of dimensions (y, x).

        Raises
        ------
        ValueError, TypeError
            As ``HeightField.sun_hours``.

        Examples
        --------
        >>> import xarray
        >>> import antumbra.xarray
        >>> heights = xarray.DataArray([[0, 1], [0, 1]], dims=("y", "x"), coords={"y": [1, 0], "x": [0, 1]})
        >>> heights.antumbra.sun_hours([[0, 0, 1], [-1, 0, 2]], weights=0.5).values
        array([[1., 1.],
               [1., 1.]])
        """
        hours = self.field.sun_hours(suns, weights, **options)
        return self._made(hours, "sun_hours", "h", "hours of direct sun")

    def viewshed(self, places: ArrayLike, **options: Any) -> Any:
        """Which cells observers see.

        Parameters
        ----------
        places : (x, y), (x, y, z) or array (k, 2) or (k, 3)
            One place or several, as for ``HeightField.viewshed``.
        options
            As for ``HeightField.viewshed``.

        Returns
        -------
        xarray.DataArray
            bool of dimensions (y, x), or (observer, y, x) of several places.

        Raises
        ------
        ValueError, TypeError
            As ``HeightField.viewshed``.

        Examples
        --------
        >>> import xarray
        >>> import antumbra.xarray
        >>> heights = xarray.DataArray([[0, 9, 0], [0, 9, 0]], dims=("y", "x"), coords={"y": [1, 0], "x": [0, 1, 2]})
        >>> heights.antumbra.viewshed((0, 1), eye=2).values[0]
        array([ True,  True, False])
        """
        seen = self.field.viewshed(places, **options)
        return self._made(seen, "seen", "1", "whether the observer sees the cell", ("observer",) * (seen.ndim - 2))

    def target_heights(self, places: ArrayLike, **options: Any) -> Any:
        """Least height above ground from which one of the observers sees each cell.

        Parameters
        ----------
        places, options
            As for ``HeightField.target_heights``.

        Returns
        -------
        xarray.DataArray
            float32 of dimensions (y, x), in the unit of the heights.

        Raises
        ------
        ValueError, TypeError
            As ``HeightField.target_heights``.

        Examples
        --------
        >>> import xarray
        >>> import antumbra.xarray
        >>> heights = xarray.DataArray([[0, 3, 0], [0, 3, 0]], dims=("y", "x"), coords={"y": [1, 0], "x": [0, 1, 2]})
        >>> heights.antumbra.target_heights((0, 1), eye=2).values[0].round(3)
        array([0., 0., 4.], dtype=float32)
        """
        heights = self.field.target_heights(places, **options)
        unit = self._heights.attrs.get("units", "")
        return self._made(heights, "target_height", unit, "height above ground from which the cell is seen")

    def _made(self, values: Any, name: str, units: str, long_name: str, dims: Any = (), coords: Any = {}) -> Any:
        """Values of cells with the coordinates of the heights. Others are of `dims`, which come before those of cells."""
        heights = self._heights
        attrs = {"units": units, "long_name": long_name}
        attrs |= {key: heights.attrs[key] for key in ("grid_mapping", "crs") if key in heights.attrs}
        coords = {**heights.coords, **coords}
        made = xarray.DataArray(values, dims=(*dims, *heights.dims), coords=coords, name=name, attrs=attrs)
        if "grid_mapping" in heights.encoding:
            made.encoding["grid_mapping"] = heights.encoding["grid_mapping"]
        return made
