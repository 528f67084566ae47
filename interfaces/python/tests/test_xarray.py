"""The accessor of xarray: coordinates in, coordinates out, and what it refuses."""

import subprocess
import sys

import antumbra as am
import numpy as np
import pytest

xarray = pytest.importorskip("xarray", reason="no xarray: its accessor is not tested")

import antumbra.xarray  # noqa: E402

RNG = np.random.default_rng(23)
Z = RNG.uniform(0, 9, (6, 8))
X, Y = 500_001.0 + 2 * np.arange(8), 5_399_999.0 - 2 * np.arange(6)
SIX = (500_000.0, 2.0, 0.0, 5_400_000.0, 0.0, -2.0)


def labelled(z=Z, dims=("y", "x"), x=X, y=Y, **attrs):
    return xarray.DataArray(z, dims=dims, coords={dims[0]: y, dims[1]: x}, attrs=attrs)


FIELD = am.HeightField(Z, SIX)


def test_answers_are_those_of_the_field():
    heights = labelled(units="m", grid_mapping="spatial_ref", source="a survey").assign_coords(spatial_ref=0)
    assert heights.antumbra.field.transform == SIX
    horizons = heights.antumbra.horizons(rise=0.5)
    np.testing.assert_array_equal(horizons.values, FIELD.horizons(rise=0.5).angles)
    np.testing.assert_array_equal(horizons.azimuth.values, FIELD.horizons().azimuths)
    assert horizons.dims == ("azimuth", "y", "x") and horizons.name == "horizon"
    assert horizons.attrs["units"] == "degrees" and horizons.azimuth.attrs["units"] == "degrees"
    assert (horizons.sel(azimuth=90.0, x=500_003, y=Y[2]) == FIELD.horizons([90], rise=0.5).angles[0, 2, 1]).all()
    sun = am.sun_positions(48, 11, ["2025-03-20T08:00", "2025-03-20T16:00"], "UTC")
    hours = heights.antumbra.sun_hours(sun)
    np.testing.assert_array_equal(hours.values, FIELD.sun_hours(sun))
    seen = heights.antumbra.viewshed((X[3], Y[2]), eye=2)
    np.testing.assert_array_equal(seen.values, FIELD.viewshed((X[3], Y[2]), eye=2))
    assert heights.antumbra.viewshed([(X[3], Y[2]), (X[4], Y[4])]).dims == ("observer", "y", "x")
    raised = heights.antumbra.target_heights([(X[3], Y[2]), (X[7], Y[5])], eye=2)
    np.testing.assert_array_equal(raised.values, FIELD.target_heights([(X[3], Y[2]), (X[7], Y[5])], eye=2))
    assert (hours.attrs["units"], raised.attrs["units"], seen.dtype) == ("h", "m", bool)
    for made in (horizons, hours, seen, raised):
        assert made.dims[-2:] == ("y", "x") and made.attrs["long_name"] and made.attrs["grid_mapping"] == "spatial_ref"
        assert "source" not in made.attrs and made.spatial_ref == 0
        np.testing.assert_array_equal(made.x, X)
        np.testing.assert_array_equal(made.y, Y)
    np.testing.assert_array_equal(am.HeightField(heights).horizons().angles, FIELD.horizons().angles)


def test_lights_keep_their_dimensions():
    heights = labelled()
    assert heights.antumbra.lit(100, 20).dims == ("y", "x") and heights.antumbra.lit(100, 20).azimuth == 100
    lit = heights.antumbra.lit(100, [10, 20])
    assert lit.dims == ("sun", "y", "x") and lit.elevation.values.tolist() == [10, 20]
    times = np.array(["2025-03-20T08:00", "2025-03-20T16:00"], "datetime64[ns]")
    sun = am.sun_positions(48, 11, times, "UTC")
    azimuth, elevation = (xarray.DataArray(each, dims="time", coords={"time": times}) for each in (sun.azimuth, sun.elevation))
    lit = heights.antumbra.lit(azimuth, elevation)
    assert lit.dims == ("time", "y", "x") and (lit.time.values == times).all()
    np.testing.assert_array_equal(lit.values, FIELD.lit(sun.azimuth, sun.elevation))
    turned = heights.antumbra.lit(azimuth, xarray.DataArray([5.0, 10.0, 15.0], dims="height"))
    np.testing.assert_array_equal(turned.transpose("time", "height", "y", "x").values, FIELD.lit(sun.azimuth[:, None], [5, 10, 15]))


def test_rows_may_run_either_way_and_be_called_otherwise():
    wanted = labelled().antumbra.horizons([33.0])
    for other in (
        labelled()[::-1],
        labelled()[:, ::-1],
        labelled().transpose("x", "y"),
        labelled().expand_dims("band"),
        labelled(x=X.astype(np.float32), y=Y.astype(np.float32)),
    ):
        made = other.antumbra.horizons([33.0])
        assert made.dims == ("azimuth", "y", "x")
        np.testing.assert_array_equal(made.sortby("y", ascending=False).sortby("x").values, wanted.values)
    for dims in (("northing", "easting"), ("Y", "X")):
        made = labelled(dims=dims).antumbra.horizons([33.0])
        assert made.dims == ("azimuth", *dims)
        np.testing.assert_array_equal(made.values, wanted.values)
    place = (X[3], Y[2])
    np.testing.assert_array_equal(labelled()[::-1].antumbra.viewshed(place, eye=1)[::-1].values, FIELD.viewshed(place, eye=1))


def test_marks_of_missing_data_and_scales_count():
    stored = np.round(Z * 10).astype(np.int16)
    stored[2, 3] = -9999
    z = np.where(stored == -9999, np.nan, stored * 0.1 + 5.0)
    found = labelled(stored, _FillValue=-9999, scale_factor=0.1, add_offset=5.0).antumbra.horizons()
    np.testing.assert_array_equal(found.values, am.HeightField(z, SIX).horizons().angles)
    assert np.isnan(found.values[:, 2, 3]).all()


@pytest.mark.parametrize(
    "heights, text",
    [
        (labelled(dims=("lat", "lon")), "coordinates are degrees, .* project it to metres first, as with rioxarray"),
        (labelled(dims=("latitude", "longitude")), "coordinates are degrees"),
        (labelled().assign_coords(x=("x", X, {"units": "degrees_east"})), "coordinates are degrees"),
        (labelled(dims=("row", "x")), r"found dimensions \('row', 'x'\), wanted y and x, or northing and easting.*rename\({...: 'y'}\)"),
        (labelled().drop_vars("x"), "no coordinates along 'x'"),
        (labelled().isel(x=[0, 1, 3, 4]), "coordinate 1 along 'x' is 500003.0, which is 0.25 cells off even steps"),
        (labelled().isel(y=[0]), "wanted at least two finite ones that differ"),
        (labelled().assign_coords(x=[np.nan] * 8), "wanted at least two finite ones that differ"),
        (xarray.concat([labelled(), labelled()], "band"), "select one along 'band'"),
        (labelled()[0], "wanted y and x"),
    ],
)
def test_errors(heights, text):
    with pytest.raises(ValueError, match=text):
        heights.antumbra.horizons()


def test_errors_of_arguments():
    with pytest.raises(ValueError, match="transform: found one beside a DataArray"):
        am.HeightField(labelled(), 2.0)
    with pytest.warns(UserWarning, match="cells of 0.01 on coordinates that are on the globe look like degrees"):
        assert labelled(x=11 + 0.01 * np.arange(8), y=48 - 0.01 * np.arange(6)).antumbra.field


def test_rioxarray():
    pytest.importorskip("rioxarray", reason="no rioxarray")
    affine = pytest.importorskip("affine")
    heights = labelled().rio.write_crs("EPSG:25832")
    made = heights.antumbra.horizons([33.0])
    assert made.rio.crs == heights.rio.crs and made.rio.transform() == heights.rio.transform()
    np.testing.assert_array_equal(made.values, FIELD.horizons([33.0]).angles)
    with pytest.raises(ValueError, match="coordinates are degrees"):
        labelled().rio.write_crs("EPSG:4326").antumbra.field
    with pytest.raises(ValueError, match="no coordinates along 'x'"):
        xarray.DataArray(Z, dims=("y", "x")).antumbra.field
    # The file's own numbers, where coordinates are the same but for rounding; coordinates where they are not.
    step = 1 / 3
    transform = affine.Affine(step, 0, 7e5, 0, -step, 5e6)
    bare = xarray.DataArray(Z, dims=("y", "x")).rio.write_crs("EPSG:25832").rio.write_transform(transform)
    assert bare.antumbra.field.transform == transform.to_gdal()
    at = 7e5 + step * (np.arange(8) + 0.5), 5e6 - step * (np.arange(6) + 0.5)
    assert labelled(x=at[0], y=at[1]).rio.write_transform(transform).antumbra.field.transform == transform.to_gdal()
    part = labelled(x=at[0], y=at[1]).rio.write_transform(transform).isel(x=slice(2, None))
    assert abs(part.antumbra.field.transform[0] - (7e5 + 2 * step)) < 1e-6


def test_the_accessor_comes_with_its_module():
    program = "import xarray, antumbra; assert not hasattr(xarray.DataArray, 'antumbra'); import antumbra.xarray; print(hasattr(xarray.DataArray, 'antumbra'))"
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout == "True\n"
