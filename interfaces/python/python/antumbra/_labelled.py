"""Heights as arrays, and in an xarray.DataArray with the places of its cells. xarray is not imported: objects bring theirs."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

_ROWS, _COLUMNS = ("y", "northing"), ("x", "easting")
_WANTED = "wanted y and x, or northing and easting"
_PROJECT = (
    "heights: its coordinates are degrees, in which cells have no length; project it to metres first, "
    "as with rioxarray's heights.rio.reproject(heights.rio.estimate_utm_crs())"
)
_UNEVEN = 1e-3
"""Parts of a cell by which coordinates may differ from even steps: those in single precision do."""

_NOWHERE = (0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
"""What rioxarray says of arrays that are at no place."""


def real(heights: Any) -> NDArray[np.float64]:
    """Heights in double precision; what is masked is a hole."""
    if isinstance(heights, np.ma.MaskedArray):
        heights = np.where(np.ma.getmaskarray(heights), np.nan, np.ma.getdata(heights))
    if not hasattr(heights, "__array__") and hasattr(heights, "__dlpack__"):
        heights = np.from_dlpack(heights)
    array = np.asarray(heights)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"heights: found dtype {array.dtype}, wanted real numbers")
    return array.astype(np.float64, copy=False)


def plan(heights: Any) -> Any:
    """The array in the order (y, x), whatever these are called."""
    given = tuple(heights.dims)
    found = [next((name for name in given if str(name).lower() in names), None) for names in (_ROWS, _COLUMNS)]
    if None in found:
        missing = "yx"[found.index(None)]
        raise ValueError(f"heights: found dimensions {given}, {_WANTED} with coordinates; rename({{...: {missing!r}}})")
    for name in given:
        if name not in found:
            if heights.sizes[name] != 1:
                raise ValueError(f"heights: found dimensions {given}, {_WANTED}: select one along {name!r}")
            heights = heights.isel({name: 0})
    return heights.transpose(*found)


def cells(heights: Any) -> tuple[Any, NDArray[np.float64], tuple[float, ...]]:
    """The array in the order (y, x), its heights with NaN where there is no data, and a transform in the order of GDAL."""
    if {"lat", "latitude", "lon", "longitude"} & {str(name).lower() for name in heights.dims}:
        raise ValueError(f"{_PROJECT} (found dimensions {tuple(heights.dims)})")
    heights = plan(heights)
    rows, columns = heights.dims
    rio = getattr(heights, "rio", None)
    crs = getattr(rio, "crs", None)
    units = [str(heights.coords[name].attrs.get("units", "")) for name in (rows, columns) if name in heights.coords]
    if (crs is not None and crs.is_geographic) or any(unit.startswith("degree") for unit in units):
        raise ValueError(_PROJECT)
    known = rio.transform().to_gdal() if rio is not None and (rows, columns) == ("y", "x") else None
    transform = _transform(heights, rows, columns, known)
    x, a, _, y, _, e = transform
    ends = [(x, y), (x + a * heights.sizes[columns], y + e * heights.sizes[rows])]
    if crs is None and max(abs(a), abs(e)) < 0.1 and all(abs(x) <= 360 and abs(y) <= 90 for x, y in ends):
        text = f"cells of {abs(a):.6g} on coordinates that are on the globe look like degrees; sizes must be in the unit of the heights"
        warnings.warn(text, stacklevel=4)
    return heights, _values(heights, rio), transform


def _transform(heights: Any, rows: Any, columns: Any, known: Any) -> tuple[float, ...]:
    """By coordinates; `known` counts where there are none, and where it is the same but for rounding."""
    if known not in (None, _NOWHERE) and not {rows, columns} & set(heights.coords):
        return tuple(known)
    (x, a), (y, e) = (_steps(heights, name, known and known[at]) for name, at in ((columns, 1), (rows, 5)))
    found = (x, a, 0.0, y, 0.0, e)
    is_known = known is not None and np.allclose(known, found, rtol=0, atol=_UNEVEN * min(abs(a), abs(e)))
    return tuple(known) if is_known else found


def _steps(heights: Any, name: Any, step: float | None) -> tuple[float, float]:
    """Edge of the first cell and side of the cells along an axis."""
    if name not in heights.coords:
        raise ValueError(f"heights: found no coordinates along {name!r}, wanted some, or HeightField(heights.values, transform)")
    at = np.asarray(heights.coords[name].values, np.float64)
    if len(at) > 1:
        step = (at[-1] - at[0]) / (len(at) - 1)
    if not step or not np.isfinite(at).all():
        raise ValueError(f"heights: found coordinates {at[:3].tolist()} along {name!r}, wanted at least two finite ones that differ")
    off = np.abs(at - (at[0] + step * np.arange(len(at)))) / abs(step)
    if off.max() > _UNEVEN:
        place = int(off.argmax())
        raise ValueError(
            f"heights: coordinate {place} along {name!r} is {at[place]}, which is {off[place]:.3g} cells off even steps of {step}; "
            "wanted evenly spaced ones: interp to such"
        )
    return float(at[0] - 0.5 * step), float(step)


def _values(heights: Any, rio: Any) -> NDArray[np.float64]:
    """Heights as the file means them: without the mark of missing data, scaled and moved."""
    values, attrs = real(heights.values), heights.attrs
    marks = [attrs.get(name) for name in ("_FillValue", "missing_value", "nodata")] + [getattr(rio, "nodata", None)]
    values = np.where(np.isin(values, [mark for mark in marks if mark is not None]), np.nan, values)
    return values * float(attrs.get("scale_factor", 1.0)) + float(attrs.get("add_offset", 0.0))
