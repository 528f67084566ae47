"""Height fields: against brute force over all triangles, closed forms, the program, and whatever callers may give."""

import os
import pathlib
import pickle
import subprocess
import threading
import time

import antumbra as am
import numpy as np
import pytest

RNG = np.random.default_rng(17)

TRANSFORMS = {
    "north up": (1000.0, 2.0, 0.0, 5000.0, 0.0, -2.0),
    "from the south": (1000.0, 2.0, 0.0, 5000.0, 0.0, 2.0),
    "mirrored": (1000.0, -2.0, 0.0, 5000.0, 0.0, -2.0),
    "oblong": (0.0, 3.0, 0.0, 0.0, 0.0, -1.0),
    "turned": (10.0, 1.5, 0.7, 20.0, 0.6, -1.3),
    "sheared from the south": (10.0, 1.5, 0.4, 20.0, 0.0, 1.3),
}


def rough(rows=9, columns=11, holes=0.15):
    z = RNG.uniform(0, 6, (rows, columns))
    z[RNG.random(z.shape) < holes] = np.nan
    return z


def centres(shape, transform):
    x, a, b, y, d, e = transform
    row, column = (at + 0.5 for at in np.indices(shape))
    return np.stack([x + a * column + b * row, y + d * column + e * row], -1)


class Brute:
    """The triangles of a field, cut as the docstring of the class says."""

    def __init__(self, z, transform):
        self.z, self.at = z, centres(z.shape, transform)
        level = transform[2] == transform[4] == 0
        rising = level and (transform[5] > 0) != (transform[1] < 0)
        triangles = []
        for r in range(z.shape[0] - 1):
            for c in range(z.shape[1] - 1):
                square = [(r, c), (r, c + 1), (r + 1, c + 1), (r + 1, c)]
                whole = [corner for corner in square if np.isfinite(z[corner])]
                if len(whole) == 3:
                    triangles.append(whole)
                elif len(whole) == 4:
                    a, b, c_, d = square[1:] + square[:1] if rising else square
                    triangles += [[a, b, c_], [a, c_, d]]
        self.triangles = triangles
        edges = {tuple(sorted((t[i], t[i - 1]))) for t in triangles for i in range(3)}
        pairs = np.array(sorted(edges)).reshape(-1, 2, 2)
        self.ends = self.at[pairs[..., 0], pairs[..., 1]]
        self.heights = z[pairs[..., 0], pairs[..., 1]]

    def crossings(self, eye, towards):
        """Distances ahead, in lengths of `towards`, and heights of edges that a line of sight crosses in plan."""
        a, along = self.ends[:, 0] - eye, self.ends[:, 1] - self.ends[:, 0]
        det = towards[0] * along[:, 1] - towards[1] * along[:, 0]
        with np.errstate(all="ignore"):
            t = (a[:, 0] * along[:, 1] - a[:, 1] * along[:, 0]) / det
            u = (a[:, 0] * towards[1] - a[:, 1] * towards[0]) / det
        kept = (np.abs(det) > 1e-9) & (u > -1e-9) & (u < 1 + 1e-9) & (t > 1e-9)
        low, high = self.heights[kept].T
        return t[kept], low + u[kept] * (high - low)

    def horizon(self, cell, azimuth, rise=0.0):
        turn = np.radians(azimuth)
        t, z = self.crossings(self.at[cell], np.array([np.sin(turn), np.cos(turn)]))
        return np.degrees(np.arctan(((z - self.z[cell] - rise) / t).max())) if len(t) else -90.0

    def normal(self, cell):
        """Mean of the triangles around a cell, all of which have one area in plan."""
        normals = []
        for triangle in self.triangles:
            if cell in triangle:
                a, b, c = (np.append(self.at[corner], self.z[corner]) for corner in triangle)
                n = np.cross(b - a, c - a)
                normals.append(n / n[2])
        return np.mean(normals, 0) if normals else None

    def slack(self, cell, place, height, target):
        """Slope of the line to a target minus the largest slope before it: below 0 if it is hidden."""
        way = self.at[cell] - place
        t, z = self.crossings(place, way)
        before = t < 1 - 1e-9
        slopes = (z[before] - height) / t[before]
        return self.z[cell] + target - height - slopes.max() if before.any() else np.inf


def cells(z):
    return [tuple(cell) for cell in np.argwhere(np.isfinite(z))]


@pytest.mark.parametrize("transform", TRANSFORMS.values(), ids=TRANSFORMS)
@pytest.mark.parametrize("holes", [0.0, 0.2])
def test_horizons_equal_brute_force(transform, holes):
    z = rough(holes=holes)
    field, brute = am.HeightField(z, transform), Brute(z, transform)
    for azimuths, rise in [("lattice:16", 0.0), ([0.0, 37.0, 90.0, 200.0, 725.0, -15.0], 0.4)]:
        found = field.horizons(azimuths, rise=rise)
        assert found.angles.dtype == np.float32 and found.azimuths.dtype == np.float64
        assert found.angles.shape == (len(found.azimuths), *z.shape) and np.isnan(found.angles[:, np.isnan(z)]).all()
        for azimuth, angles in zip(found.azimuths, found.angles):
            wanted = [brute.horizon(cell, azimuth, rise) for cell in cells(z)]
            np.testing.assert_allclose([angles[cell] for cell in cells(z)], wanted, atol=1e-4)


def test_sky_is_what_horizons_leave():
    z = rough(holes=0.1)
    field = am.HeightField(z, 2.0)
    azimuths, angles = field.horizons()
    gaps = np.diff(np.append(azimuths, 360.0))
    weights = (gaps + np.roll(gaps, 1)) / 720
    level = np.where(angles == -90, 0, angles)
    wanted = np.einsum("a,aij->ij", weights, 90 - level)
    found = field.sky("openness")
    np.testing.assert_allclose(found.values, wanted, atol=1e-4)
    assert found.values.dtype == np.float32 and 0 < found.quadrature_error[0] < found.quadrature_error[1]
    assert field.sky("openness", [90.0]).quadrature_error is None
    # A slope sees (1 + cos s) / 2 of the light of the sky, and 1 - s / 180 of the sky.
    for slope in [0.0, 30.0, 60.0]:
        plane = np.tan(np.radians(slope)) * np.mgrid[0:9, 0:9][0]
        for order in [slice(None), slice(None, None, -1)]:
            tilted = am.HeightField(plane[order])
            np.testing.assert_allclose(tilted.sky(azimuths="lattice:48").values, (1 + np.cos(np.radians(slope))) / 2, atol=2e-3)
            np.testing.assert_allclose(tilted.sky("sky-open", np.arange(0, 360, 5)).values, 1 - slope / 180, atol=2e-3)
    with pytest.raises(ValueError, match="show: found 'view', wanted 'sky-view'"):
        field.sky("view")
    with pytest.raises(ValueError, match="directions: found 0, wanted at least 1"):
        field.sky(azimuths=[])


@pytest.mark.parametrize("transform", TRANSFORMS.values(), ids=TRANSFORMS)
@pytest.mark.parametrize("holes", [0.0, 0.2])
def test_light_and_hours_equal_brute_force(transform, holes):
    z = rough(holes=holes)
    field, brute = am.HeightField(z, transform), Brute(z, transform)
    suns = [(12.0, 30.0), (100.0, 5.0), (255.5, 48.0), (0.0, 90.0), (333.0, -3.0)]
    lit = field.lit(*np.transpose(suns), rise=0.1)
    assert lit.dtype == bool and lit.shape == (5, *z.shape) and not lit[:, np.isnan(z)].any()
    for (azimuth, elevation), plane in zip(suns, lit):
        for cell in cells(z):
            horizon = brute.horizon(cell, azimuth, 0.1)
            assert abs(horizon - elevation) < 1e-6 or plane[cell] == (elevation > horizon)
    angles = np.radians(suns[:3])
    directions = np.stack([np.sin(angles[:, 0]) * np.cos(angles[:, 1]), np.cos(angles[:, 0]) * np.cos(angles[:, 1]), np.sin(angles[:, 1])], -1)
    hours = field.sun_hours(directions, weights=[1.0, 2.0, 4.0], rise=0.1)
    assert hours.dtype == np.float64 and np.isnan(hours[np.isnan(z)]).all()
    for cell in cells(z):
        normal = brute.normal(cell)
        if normal is None:
            assert np.isnan(hours[cell])
            continue
        faces = directions @ normal > 0
        assert hours[cell] == (lit[:3, cell[0], cell[1]] & faces) @ [1.0, 2.0, 4.0]


@pytest.mark.parametrize("transform", TRANSFORMS.values(), ids=TRANSFORMS)
@pytest.mark.parametrize("holes", [0.0, 0.2])
def test_viewsheds_equal_brute_force(transform, holes):
    z = rough(holes=holes)
    z[4:6, 5:7] = z[1:3, 2:4] = 7.0
    field, brute = am.HeightField(z, transform), Brute(z, transform)
    at = brute.at[[4, 1], [5, 2]]
    seen = field.viewshed(at, eye=1.6, target=0.5)
    assert seen.dtype == bool and seen.shape == (2, *z.shape) and not seen[:, np.isnan(z)].any()
    compared = 0
    for plane, place, ground in zip(seen, at, [7.0, 7.0]):
        for cell in cells(z):
            slack = brute.slack(cell, place, ground + 1.6, 0.5)
            # Places on the map are rounded to a millionth of a cell.
            if abs(slack) > 1e-4:
                compared += 1
                assert plane[cell] == (slack > 0), (cell, slack)
    assert compared > z.size
    np.testing.assert_array_equal(seen, field.viewshed(np.column_stack([at, [7.0, 7.0]]), eye=1.6, target=0.5))
    np.testing.assert_array_equal(seen[:, None], field.viewshed(at[:, None], eye=1.6, target=0.5))
    # From this height on, one of them sees a cell.
    heights = field.target_heights(at, eye=1.6)
    assert heights.dtype == np.float32 and np.isnan(heights[np.isnan(z)]).all()
    for cell in cells(z):
        if np.isfinite(heights[cell]):
            assert field.viewshed(at, eye=1.6, target=1.001 * float(heights[cell]) + 1e-5)[:, cell[0], cell[1]].any()
        if 0 < heights[cell] < np.inf:
            assert not field.viewshed(at, eye=1.6, target=0.999 * float(heights[cell]))[:, cell[0], cell[1]].any()
    near = field.viewshed(at[0], eye=1.6, radius=5.0)
    far = np.hypot(*np.moveaxis(brute.at - at[0], -1, 0)) > 5.001
    assert near.any() and not near[far].any() and np.isinf(field.target_heights(at[0], eye=1.6, radius=5.0)[far & np.isfinite(z)]).all()


def test_the_shadow_of_a_wall_is_as_long_as_its_tangent_says():
    z = np.zeros((3, 200))
    z[:, 150] = 20.0
    field = am.HeightField(z, 0.5)
    for elevation in (15.0, 30.0, 55.0):
        shadow = 20.0 / np.tan(np.radians(elevation))
        away = 0.5 * (150 - np.arange(200))
        np.testing.assert_array_equal(field.lit(90, elevation)[1], (away > shadow) | (away <= 0))
        np.testing.assert_array_equal(field.lit(270, elevation)[1], (-away > shadow) | (away >= 0))
    angles = field.horizons([90.0]).angles[0, 1]
    np.testing.assert_allclose(angles[:150], np.degrees(np.arctan(20 / (0.5 * (150 - np.arange(150))))), rtol=1e-6)


def test_a_round_earth_hides_what_is_far():
    field = am.HeightField(np.zeros((2, 400)), 1000.0)
    place, radius = (500.0, -500.0), 6_371_008.8
    seen = field.viewshed(place, eye=100.0, curvature=True)[0]
    sea = np.sqrt(2 * radius * 100.0 / (1 - 0.13)) / 1000
    assert abs(seen.sum() - 1 - sea) < 1 and field.viewshed(place, eye=100.0).all()
    assert field.viewshed(place, eye=100.0, curvature=True, refraction=0.0).sum() < 2 * seen.sum()
    assert field.viewshed(place, eye=100.0, curvature=True, earth_radius=1e5).sum() < 2 * 7
    z = np.zeros((2, 100))
    z[:, 90] = 2000.0
    field = am.HeightField(z, 1000.0)
    away = 90e3
    wanted = np.degrees(np.arctan((2000.0 - 0.87 * away**2 / (2 * radius)) / away))
    assert abs(field.horizons([90.0], curvature=True).angles[0, 0, 0] - wanted) < 1e-3


def test_arrays_of_any_kind():
    z = np.round(RNG.uniform(0, 50, (12, 13)))
    wanted = am.HeightField(z).horizons("lattice:8").angles
    big = np.zeros((24, 39))
    big[::2, ::3] = z
    read_only = z.copy()
    read_only.flags.writeable = False
    odd = np.zeros(z.nbytes + 1, np.uint8)[1:].view(np.float64).reshape(z.shape)
    odd[...] = z
    kinds = [z.astype(kind) for kind in ("f4", "i2", "u1", ">f8", ">i4", "f2")]
    for other in [*kinds, np.asfortranarray(z), big[::2, ::3], z[::-1][::-1], read_only, odd, z.tolist(), np.ma.array(z)]:
        np.testing.assert_array_equal(am.HeightField(other).horizons("lattice:8").angles, wanted)
    masked = np.ma.masked_greater(z, 40)
    holes = np.where(z > 40, np.nan, z)
    np.testing.assert_array_equal(am.HeightField(masked).lit(30, 20), am.HeightField(holes).lit(30, 20))
    np.testing.assert_array_equal(am.HeightField(masked.astype("i2")).lit(30, 20), am.HeightField(holes).lit(30, 20))


def test_heights_are_not_copied():
    z = np.zeros((2, 4))
    field = am.HeightField(z)
    assert not field.horizons([90.0]).angles[0, 0, 0] > 0
    z[:, 3] = 3.0
    assert field.horizons([90.0]).angles[0, 0, 0] == 45.0
    z[0, 0] = np.inf
    with pytest.raises(ValueError, match="height: found inf, wanted finite heights, or NaN"):
        field.horizons()


def test_transforms():
    class Affine(tuple):
        def to_gdal(self):
            return tuple(self)

    z = rough(holes=0.0)
    six = (100.0, 2.0, 0.0, 50.0, 0.0, -2.0)
    wanted = am.HeightField(z, six)
    assert wanted.transform == six and wanted.shape == (9, 11) and repr(wanted) == "<antumbra.HeightField: 9 x 11 cells>"
    assert am.HeightField(z).transform == (0.0, 1.0, 0.0, 0.0, 0.0, -1.0)
    for same in (Affine(six), list(six), np.array(six), 2.0, 2):
        np.testing.assert_array_equal(am.HeightField(z, same).horizons().angles, wanted.horizons().angles)
    south = am.HeightField(z[::-1], (100.0, 2.0, 0.0, 50.0 - 18.0, 0.0, 2.0))
    np.testing.assert_array_equal(south.horizons([33.0]).angles[:, ::-1], wanted.horizons([33.0]).angles)
    place = (105.0, 43.0)
    np.testing.assert_array_equal(south.viewshed(place, eye=2)[::-1], wanted.viewshed(place, eye=2))
    suns = am.sun_positions(48, 11, ["2025-03-20T08:00", "2025-03-20T16:00"], "UTC")
    np.testing.assert_array_equal(south.sun_hours(suns)[::-1], wanted.sun_hours(suns))


def test_a_field_goes_through_pickle():
    z = rough()
    for field in (am.HeightField(z, 3.0), am.HeightField(z, TRANSFORMS["from the south"])):
        again = pickle.loads(pickle.dumps(field))
        assert again.transform == field.transform
        np.testing.assert_array_equal(again.horizons().angles, field.horizons().angles)


def test_suns_of_north_and_of_directions():
    z = rough(30, 30, holes=0.0)
    field = am.HeightField(z, 2.0)
    times = [f"2025-06-21T{hour:02}:30" for hour in range(24)]
    sun = am.sun_positions(48.2, 16.4, times, "Europe/Vienna")
    hours = field.sun_hours(sun)
    assert 0 < np.nanmax(hours) <= 16 and len(np.unique(hours)) > 3
    np.testing.assert_array_equal(field.sun_hours(sun, 0.5), 0.5 * hours)
    np.testing.assert_array_equal(field.sun_hours(sun.direction[sun.up], 1.0), hours)
    turned = am.sun_positions(48.2, 16.4, times, "Europe/Vienna", north=30.0)
    np.testing.assert_array_equal(field.sun_hours(turned, north=30.0), field.sun_hours(turned.direction[turned.up], 1.0))
    for suns, options in [(turned, {}), (sun, {"north": 30.0}), (am.sun_positions(48.2, 16.4, times, "UTC", up="y"), {})]:
        with pytest.raises(ValueError, match="wanted the north that sun_positions was called with"):
            field.sun_hours(suns, **options)
    with pytest.raises(ValueError, match="wanted 0 beside directions"):
        field.sun_hours([[0, 0, 1]], 1.0, north=3.0)
    with pytest.raises(ValueError, match="wanted the length of each step in hours"):
        field.sun_hours([[0, 0, 1]])
    with pytest.raises(ValueError, match="wanted directions with a length"):
        field.sun_hours([[0, 0, 0]], 1.0)
    with pytest.warns(UserWarning, match="1 of 2 directions are below the horizon"):
        field.sun_hours([[0, 0, 1], [0, 1, -0.1]], 1.0)
    assert (field.sun_hours(np.zeros((0, 3)), 1.0) == 0).all()


def test_fields_of_few_cells():
    for shape in [(1, 1), (1, 5), (5, 1)]:
        field = am.HeightField(np.ones(shape))
        assert (field.horizons().angles == -90).all() and field.lit(10, 1).all() and np.isnan(field.sun_hours([[0, 0, 1]], 1)).all()
    field = am.HeightField(np.full((4, 4), np.nan))
    assert np.isnan(field.horizons().angles).all() and not field.lit(0, 90).any() and np.isnan(field.sun_hours([[0, 0, 1]], 1)).all()
    assert not field.viewshed((1, -1, 5)).any() and np.isnan(field.target_heights((1, -1, 5))).all()
    field = am.HeightField(np.zeros((3, 3)))
    assert field.horizons([]).angles.shape == (0, 3, 3) and field.lit([], []).shape == (0, 3, 3)
    assert field.viewshed(np.zeros((0, 2))).shape == (0, 3, 3) and np.isinf(field.target_heights(np.zeros((0, 2)))).all()
    assert field.lit(np.zeros((2, 1)), np.full(3, 5.0)).shape == (2, 3, 3, 3)
    with pytest.warns(UserWarning, match="1 of 2 eyes are below the surface and see nothing"):
        assert not field.viewshed([(1, -1, -3), (1, -1, 3)])[0].any()


@pytest.mark.parametrize(
    "call, kind, text",
    [
        (lambda f: am.HeightField(np.zeros(5)), ValueError, r"heights: found shape \(5,\), wanted \(rows, columns\)"),
        (lambda f: am.HeightField(np.zeros((0, 5))), ValueError, "number of cells: found 0, wanted at least 1"),
        (lambda f: am.HeightField([["a"]]), TypeError, "heights: found dtype"),
        (lambda f: am.HeightField(np.zeros((2, 2), bool)), TypeError, "wanted real numbers"),
        (lambda f: am.HeightField(np.zeros((2, 2), complex)), TypeError, "wanted real numbers"),
        (lambda f: am.HeightField([[np.inf, 0]]), ValueError, "height: found inf"),
        (lambda f: am.HeightField(np.zeros((2, 2)), (1, 2)), ValueError, r"transform: found shape \(2,\), wanted six numbers"),
        (lambda f: am.HeightField(np.zeros((2, 2)), 0), ValueError, "cells with an area"),
        (lambda f: am.HeightField(np.zeros((2, 2)), (0, 1, 0, np.nan, 0, -1)), ValueError, "wanted finite numbers"),
        (lambda f: am.HeightField(np.zeros((2, 2)), (2, 0, 500, 0, -2, 900)), ValueError, "in the order of rasterio"),
        (lambda f: f.horizons("lattice:12"), ValueError, "azimuths of a lattice: found 12, wanted 8, 16"),
        (lambda f: f.horizons("lattice:"), ValueError, "azimuths: found 'lattice:', wanted 'lattice:8'"),
        (lambda f: f.horizons("36"), ValueError, "azimuths: found '36'"),
        (lambda f: f.horizons(36), ValueError, r"azimuths: found shape \(\), wanted \(n,\)"),
        (lambda f: f.horizons([0, np.nan]), ValueError, "azimuths: found nan, wanted finite numbers"),
        (lambda f: f.horizons(["north"]), TypeError, "azimuths: found dtype"),
        (lambda f: f.horizons(rise=-1), ValueError, "rise: found -1, wanted a length from 0"),
        (lambda f: f.horizons(curvature=True, earth_radius=0), ValueError, "earth_radius, refraction: found 0 and 0.13"),
        (lambda f: f.horizons(curvature=True, refraction=1), ValueError, "and 1, wanted a length above 0, and a number from -10 to below 1"),
        (lambda f: f.lit(0, 91), ValueError, "elevation: found 91.0, wanted -90 to 90"),
        (lambda f: f.lit([0, 1], [1, 2, 3]), ValueError, r"shapes do not fit: found azimuth \(2,\), elevation \(3,\)"),
        (lambda f: f.lit(np.inf, 3), ValueError, "azimuth: found inf"),
        (lambda f: f.viewshed([1]), ValueError, r"places: found shape \(1,\), wanted \(..., 2\) or \(..., 3\)"),
        (lambda f: f.viewshed([99, 0]), ValueError, "no surface is above or below point 1"),
        (lambda f: f.viewshed([np.nan, 0]), ValueError, "places: found nan"),
        (lambda f: f.viewshed([0, 0], eye=-1), ValueError, "eye: found -1"),
        (lambda f: f.viewshed([0, 0], radius=0), ValueError, "radius: found 0, wanted a length above 0"),
        (lambda f: f.target_heights([0, 0], radius=-2), ValueError, "radius: found -2"),
        (lambda f: f.lit(0, 1, threads=0), ValueError, "threads: found 0"),
        (lambda f: f.lit(0, 1, progress=3), TypeError, "progress: found int"),
    ],
)
def test_errors(call, kind, text):
    with pytest.raises(kind, match=text):
        call(am.HeightField(np.zeros((4, 5))))


def test_progress_threads_and_interruptions():
    field = am.HeightField(RNG.uniform(0, 90, (300, 300)), 5.0)
    calls = {
        "horizons": lambda **options: field.horizons([0, 33.0, 100.0], **options).angles,
        "lit": lambda **options: field.lit(np.arange(40.0), 10.0, **options),
        "sun_hours": lambda **options: field.sun_hours(RNG_SUNS, 1.0, **options),
        "viewshed": lambda **options: field.viewshed([(50, -50), (700, -700)], eye=9, **options),
        "target_heights": lambda **options: field.target_heights([(50, -50), (700, -700)], eye=9, **options),
    }
    for name, call in calls.items():
        told = []
        alone = call(threads=1, progress=lambda done, total: told.append((done, total)))
        np.testing.assert_array_equal(alone, call(threads=3), err_msg=name)
        assert told[-1][0] == told[-1][1] > 0 and told == sorted(told), name

    class Enough(Exception):
        pass

    def stop(done, total):
        raise Enough

    with pytest.raises(Enough):
        field.lit(np.linspace(0, 360, 20000), 3.0, threads=1, progress=stop)


RNG_SUNS = RNG.uniform(0.1, 1, (70, 3))


def test_the_lock_is_released():
    field, done, ticks = am.HeightField(RNG.uniform(0, 90, (400, 400))), threading.Event(), 0

    def work():
        field.horizons(np.linspace(1, 350, 6), threads=1)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.is_set():
        ticks += 1
        time.sleep(0.001)
    thread.join()
    assert ticks > 3


def test_the_program_has_the_same_bits(tmp_path):
    program = os.environ.get("ANTUMBRA", "")
    if not pathlib.Path(program).is_file():
        pytest.skip("no program: ANTUMBRA names none")
    z = rough(40, 50, holes=0.05)
    np.save(tmp_path / "z.npy", z)
    (tmp_path / "z.wld").write_text("2\n0\n0\n-2\n1001\n4999\n")

    def run(*arguments):
        subprocess.run([program, *map(str, arguments)], check=True, cwd=tmp_path, capture_output=True)

    field = am.HeightField(z, (1000.0, 2.0, 0.0, 5000.0, 0.0, -2.0))
    day = ("--lat", 48, "--lon", 11, "--north", 7, "--timezone", 1, "--from", "2025-04-01", "--to", "2025-04-01", "--step", 20)
    run("sun", "z.npy", "--cells", "--height", 0.2, *day, "-o", "hours.npz")
    minutes = np.datetime64("2025-04-01T00:10") + 20 * np.arange(72)
    sun = am.sun_positions(48, 11, minutes, 1.0, north=7.0)
    wanted = np.load(tmp_path / "hours.npz")["hours"]
    np.testing.assert_array_equal(field.sun_hours(sun, rise=0.2, north=7.0)[np.isfinite(z)], wanted)
    run("horizon", "z.npy", "--cells", "--height", 0.2, "-o", "horizon.npz")
    found, wanted = field.horizons(rise=0.2), np.load(tmp_path / "horizon.npz")
    np.testing.assert_array_equal(found.azimuths, wanted["azimuths"])
    np.testing.assert_array_equal(found.angles[:, np.isfinite(z)].T, wanted["horizon"])
    row, column = cells(z)[len(cells(z)) // 2]
    x, y = 1000 + 2 * (column + 0.5), 5000 - 2 * (row + 0.5)
    (tmp_path / "eyes.csv").write_text(f"x,y\n{x},{y}\n1090,4990\n")
    sight = ("visible", "z.npy", "eyes.csv", "--viewshed", "--eye", 9, "--curvature")
    run(*sight, "--target", 1, "-o", "seen.npy")
    seen = field.viewshed([(x, y), (1090, 4990)], eye=9, target=1, curvature=True).sum(0)
    np.testing.assert_array_equal(np.where(np.isnan(z), np.nan, seen), np.load(tmp_path / "seen.npy"))
    run(*sight, "--show", "height", "--radius", 60, "-o", "height.npy")
    heights = field.target_heights([(x, y), (1090, 4990)], eye=9, radius=60, curvature=True)
    np.testing.assert_array_equal(heights, np.load(tmp_path / "height.npy"))
