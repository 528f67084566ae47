"""The sun and its light at times as Python and numpy have them."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from datetime import datetime, timedelta, timezone, tzinfo
from typing import Any, Literal, NamedTuple
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._core import Queries, _sun_positions


class SunPositions(NamedTuple):
    """Where the sun is. Arrays have one item for each time, also below the horizon.

    Examples
    --------
    >>> import antumbra as am
    >>> am.sun_positions(0, 0, "2024-03-20T12:00", "UTC").direction.shape
    (1, 3)
    """

    azimuth: NDArray[np.float64]
    """Angles from north through east, 0 to 360 degrees."""
    elevation: NDArray[np.float64]
    """Angles above the horizon, -90 to 90 degrees."""
    direction: NDArray[np.float64]
    """Directions to the sun in the scene, of length 1: (k, 3)."""
    hours: NDArray[np.float64]
    """Length of the step of each time: the time to the next or the last one, whichever is nearer. NaN for a single time."""

    @property
    def up(self) -> NDArray[np.bool_]:
        """Whether the sun is above the horizon."""
        above: NDArray[np.bool_] = self.elevation > 0
        return above


def sun_positions(
    latitude: float,
    longitude: float,
    times: Any,
    timezone: float | str | tzinfo | None = None,
    *,
    height: float = 0.0,
    refraction: bool = True,
    up: Literal["y", "z"] = "z",
    north: float = 0.0,
) -> SunPositions:
    """Where the sun is at a place, by the solar position algorithm of NREL.

    Parameters
    ----------
    latitude, longitude : float
        Degrees, north and east positive.
    times : array (k,) of datetime64, sequence of datetime or of str, or one of these
        Times on the clocks of ``timezone``. Text is in ISO 8601, such as ``"2024-06-21T12:30"``. Times with a zone of their own
        keep it. Numbers are Unix times.
    timezone : float, str, tzinfo or None
        Hours ahead of UTC, a name such as ``"Europe/Rome"``, or a zone such as ``zoneinfo.ZoneInfo("Europe/Rome")``. None is
        UTC; the first times without a zone of their own that are taken so give a warning, which ``"UTC"`` avoids. An hour that the clocks skip in spring counts as if they did not, and of one that they repeat, the first is meant.
    height : float
        Metres above the sea.
    refraction : bool
        Whether the air lifts the sun, as at the sea.
    up, north
        As for ``sky_patches``.

    Returns
    -------
    SunPositions
        Arrays ``azimuth``, ``elevation``, ``direction`` and ``hours``, one item for each time.

    Raises
    ------
    ValueError, TypeError
        The place, a time or the zone is none.

    Examples
    --------
    >>> import antumbra as am
    >>> sun = am.sun_positions(51.5, 0.0, ["2024-06-21T12:00", "2024-06-21T23:59"], "UTC")
    >>> sun.up
    array([ True, False])
    >>> round(float(sun.elevation[0]), 1)
    61.9
    """
    unix = _unix(times, timezone)
    found = _sun_positions(latitude, longitude, height, unix, refraction, up, north)
    return SunPositions(*found, _lengths(np.asarray(unix)))


def _lengths(unix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Hours to the nearer one of the neighbours of each time."""
    apart = np.full(len(unix) + 1, np.inf)
    apart[1:-1] = np.abs(np.diff(unix))
    nearest = np.minimum(apart[1:], apart[:-1])
    return np.where(np.isinf(nearest), np.nan, nearest) / 3600.0


class Irradiation(NamedTuple):
    """Energy that surfaces receive, in the shape of the points.

    Examples
    --------
    >>> import antumbra as am
    >>> am.Irradiation(direct=0.75, diffuse=0.25)
    Irradiation(direct=0.75, diffuse=0.25)
    """

    direct: NDArray[np.float64]
    """From the sun, in kWh/m²."""
    diffuse: NDArray[np.float64]
    """From the sky, in kWh/m²."""


def irradiation(
    scene: Queries,
    points: ArrayLike,
    normals: ArrayLike | None,
    latitude: float,
    longitude: float,
    times: Any,
    direct_normal: ArrayLike,
    diffuse_horizontal: ArrayLike,
    timezone: float | str | tzinfo | None = None,
    *,
    hours: ArrayLike = 1.0,
    height: float = 0.0,
    patches: int = 145,
    uniform: bool = False,
    up: Literal["y", "z"] = "z",
    north: float = 0.0,
    threads: int | None = None,
    progress: Any = None,
) -> Irradiation:
    """Energy that points receive from the sun and from the sky, as far as they see them.

    The light of the sky is distributed by the model of Perez, Seals and Michalsky (1993). Light that surfaces reflect does not count.

    Parameters
    ----------
    scene : Scene or World
        What is in the way.
    points : array (..., 3)
    normals : array (..., 3) or None
        Normals of surfaces, of any length but 0: values of others are NaN. None for level surfaces in free space.
    latitude, longitude, times, timezone, height
        Place, and the middle of each step of time, as for ``sun_positions``.
    direct_normal : float or array (k,)
        Mean irradiance by the sun in each step, on a surface that faces the sun, in W/m².
    diffuse_horizontal : float or array (k,)
        Mean irradiance by the sky in each step, on level ground, in W/m².
    hours : float or array (k,)
        Length of each step in hours.
    patches, uniform, up, north
        The sky, as for ``sky_patches``.
    threads, progress
        As for ``Scene``.

    Returns
    -------
    Irradiation
        ``direct`` and ``diffuse``, float64 in the shape of the points.

    Raises
    ------
    ValueError
        The place, a time or an irradiance is outside its range, or an argument has another shape.

    Examples
    --------
    >>> from datetime import datetime, timezone
    >>> import antumbra as am
    >>> scene = am.Scene([[9, 9, 9], [9, 8, 9], [8, 9, 9]], [[0, 1, 2]])
    >>> noon = datetime(2024, 3, 20, 12, 7, tzinfo=timezone.utc)
    >>> energy = am.irradiation(scene, [0, 0, 0], [0, 0, 1], 0, 0, noon, 900, 100)
    >>> bool(abs(energy.direct - 0.9) < 0.001)
    True
    """
    unix = _unix(times, timezone)
    place, sky = (latitude, longitude, height), (patches, uniform, up, north)
    steps = (hours, direct_normal, diffuse_horizontal)
    return Irradiation(*scene._irradiation(points, normals, place, unix, steps, sky, threads, progress))


def _unix(times: Any, zone: float | str | tzinfo | None) -> list[float]:
    """Seconds since 1970 in UTC."""
    is_said, zone = zone is not None, _zone(zone)
    if isinstance(times, datetime | str):
        times = [times]
    if hasattr(times, "__array__"):
        times = np.atleast_1d(np.asarray(times))
        if times.ndim == 1 and times.dtype.kind in "UO":
            times = times.tolist()
    if isinstance(times, Iterable) and not isinstance(times, np.ndarray):
        times = list(times)
        if times and all(isinstance(time, datetime | str) for time in times):
            moments = [_moment(time, place) for place, time in enumerate(times)]
            if not is_said and any(moment.tzinfo is None for moment in moments):
                _warn_of_utc()
            return [_aware(time, zone).timestamp() for time in moments]
    array = np.atleast_1d(np.asarray(times))
    if array.ndim != 1:
        raise ValueError(f"times: found shape {array.shape}, wanted (k,)")
    if array.dtype.kind in "fiu":
        unix: list[float] = array.astype(np.float64).tolist()
        return unix
    if array.dtype.kind != "M":
        raise TypeError(f"times: found dtype {array.dtype}, wanted datetime64, datetime, text or numbers")
    if np.isnat(array).any():
        raise ValueError("times: found NaT, wanted times")
    if not is_said:
        _warn_of_utc()
    seconds = array.astype("datetime64[us]").astype(np.int64) / 1e6
    if isinstance(zone, tzinfo):
        epoch = datetime(1970, 1, 1)
        local = (epoch + timedelta(seconds=float(second)) for second in seconds)
        return [_aware(time, zone).timestamp() for time in local]
    return [float(second) for second in seconds - 3600.0 * zone]


def _warn_of_utc() -> None:
    """Says once that times are taken as UTC."""
    global _is_warned
    if not _is_warned:
        _is_warned = True
        text = "times without a zone are taken as UTC: give timezone, such as 'Europe/Rome' or 'UTC'"
        warnings.warn(text, stacklevel=4)


_is_warned = False


def _moment(time: datetime | str, place: int) -> datetime:
    """The time that a text says."""
    if isinstance(time, datetime):
        return time
    try:
        # Before Python 3.11, no letter stands for UTC.
        return datetime.fromisoformat(time[:-1] + "+00:00" if time.endswith("Z") else time)
    except ValueError:
        text = f"times[{place}]: found {time!r}, wanted a time in ISO 8601, such as '2024-06-21T12:30'"
        raise ValueError(text) from None


def _zone(zone: float | str | tzinfo | None) -> float | tzinfo:
    """Hours ahead of UTC, or a zone."""
    if isinstance(zone, tzinfo):
        return zone
    wanted = "wanted a name such as 'Europe/Berlin', hours ahead of UTC, a tzinfo or None"
    if isinstance(zone, str):
        try:
            return ZoneInfo(zone)
        except (ZoneInfoNotFoundError, ValueError, OSError):
            hint = " (where the system has no list of zones, install tzdata)"
            raise ValueError(f"timezone: found {zone!r}, {wanted}{hint}") from None
    try:
        hours = float(zone or 0.0)
    except (TypeError, ValueError):
        raise TypeError(f"timezone: found {type(zone).__name__}, {wanted}") from None
    if not -24 < hours < 24:
        raise ValueError(f"timezone: found {hours} hours, wanted less than 24 ahead of or behind UTC")
    return hours


def _aware(time: datetime, zone: float | tzinfo) -> datetime:
    if time.tzinfo is not None:
        return time
    if not isinstance(zone, tzinfo):
        zone = timezone(timedelta(hours=zone))
    return time.replace(tzinfo=zone)
