"""Ambient occlusion, sky, sun, visibility between points, and pictures."""

import datetime
import pickle
import warnings
import zoneinfo

import antumbra as am
import numpy as np
import pytest
from brute import box, soup

RNG = np.random.default_rng(12)
WALL = am.Scene([[0, -1e4, 0], [0, 1e4, 0], [0, 1e4, 1e5], [0, -1e4, 1e5]], [[0, 1, 2], [0, 2, 3]])
"""A wall that hides half of the sky from the ground before it."""


def test_half_of_the_sky_is_open_before_a_wall():
    points, up = np.zeros((3, 4, 3)), np.broadcast_to([0, 0, 2.0], (3, 4, 3))
    # Nearer to the wall than the origin offset, points would begin to see behind it.
    points[..., 0] = 1
    for found in (
        WALL.ambient_occlusion(points, up, 1024),
        WALL.ambient_occlusion(points, up, 1024, weighting="uniform"),
        WALL.sky_view(points, up, 5000, uniform=True),
        WALL.sky_view(points, None, 5000, uniform=True, weighting="uniform"),
    ):
        assert found.shape == (3, 4) and found.dtype == np.float32
        np.testing.assert_allclose(found, 0.5, atol=0.02)
    open_part, bent = WALL.ambient_occlusion(points, up, 1024, bent=True)
    np.testing.assert_array_equal(open_part, WALL.ambient_occlusion(points, up, 1024))
    assert bent.shape == (3, 4, 3) and (bent[..., 0] > 0.3).all()
    np.testing.assert_allclose(WALL.ambient_occlusion(points, up, 64, 1e-3), 1)
    # By brute force: the patches that the wall hides.
    directions, angles = am.sky_patches(577)
    seen = directions[:, 0] > -1e-9
    expected = (angles * directions[:, 2])[seen].sum() / (angles * directions[:, 2]).sum()
    np.testing.assert_allclose(WALL.sky_view(points, up, 577), expected, rtol=1e-6)


def test_answers_do_not_depend_on_threads_or_parts():
    scene = am.Scene(*soup(RNG, 500))
    points, normals = RNG.uniform(-1, 1, (300, 3)), RNG.normal(size=(300, 3))
    suns = RNG.normal(size=(70, 3))
    for ask in (
        lambda p, n, threads: scene.ambient_occlusion(p, n, 64, threads=threads),
        lambda p, n, threads: scene.sky_view(p, n, threads=threads),
        lambda p, n, threads: scene.sun_hours(p, n, suns, 0.25, threads=threads),
        lambda p, n, threads: scene.sees(p, n, suns, threads=threads).words,
        lambda p, n, threads: scene.visibility(p, normals, threads=threads).words,
    ):
        whole = ask(points, normals, 2)
        np.testing.assert_array_equal(whole, ask(points, normals, 1))
        np.testing.assert_array_equal(whole[100:150], ask(points[100:150], normals[100:150], 3))


def test_sun_hours_are_those_of_brute_force_in_numpy():
    from brute import all_hits

    vertices, faces = soup(RNG, 60)
    scene = am.Scene(vertices, faces)
    points = RNG.uniform(-1, 1, (40, 3)).astype(np.float32)
    normals, suns = RNG.normal(size=(40, 3)), RNG.normal(size=(30, 3)).astype(np.float32)
    weights = RNG.uniform(0, 1, 30)
    hours, expected = scene.sun_hours(points, None, suns, weights), np.zeros(40)
    facing, above = scene.sun_hours(points, normals, suns, weights), np.zeros(40)
    sure = np.ones(40, bool)
    for sun, weight in zip(suns, weights):
        t, clear = all_hits(vertices, faces, points, np.broadcast_to(sun, points.shape))
        sure &= clear.all(1)
        free = np.isinf(t).all(1)
        expected += weight * free
        above += weight * (free & (normals @ sun > 0))
    assert sure.sum() > 30
    np.testing.assert_allclose(hours[sure], expected[sure], rtol=1e-12)
    np.testing.assert_allclose(facing[sure], above[sure], rtol=1e-12)
    np.testing.assert_allclose(scene.sun_hours(points, None, suns, 1)[sure] % 1, 0)


def test_positions_leave_out_the_night_and_know_their_steps():
    field = am.Scene([[9, 9, -9], [9, 8, -9], [8, 9, -9]], [[0, 1, 2]])
    times = np.datetime64("2025-06-21T00:05") + np.arange(144) * np.timedelta64(10, "m")
    sun = am.sun_positions(48.2, 16.4, times, 1)
    np.testing.assert_allclose(sun.hours, 1 / 6)
    by_day = sun.up.sum() / 6
    assert 15.5 < by_day < 16.5
    for normals in (None, [0, 0, 1]):
        np.testing.assert_allclose(field.sun_hours([0, 0, 0], normals, sun), by_day)
        np.testing.assert_allclose(field.sun_hours([0, 0, 0], normals, sun, 1), sun.up.sum())
    with pytest.warns(UserWarning, match=f"suns: {(~sun.up).sum()} of 144 directions are below the horizon"):
        assert field.sun_hours([0, 0, 0], None, sun.direction, 1 / 6) > 23
    upright = am.sun_positions(48.2, 16.4, times, 1, up="y")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        hours = field.sun_hours([0, 0, 0], None, upright.direction[upright.up], upright.hours[upright.up], up="y")
        np.testing.assert_allclose(hours, by_day)
    # Some hours of each of two days: the night between them is no step.
    morning = np.datetime64("2025-06-21T08:00") + np.array([0, 1, 2, 24, 25]) * np.timedelta64(1, "h")
    np.testing.assert_allclose(am.sun_positions(48.2, 16.4, morning, 1).hours, 1)
    assert np.isnan(am.sun_positions(48.2, 16.4, morning[:1], 1).hours).all()


def test_times_without_a_zone_warn_once(monkeypatch):
    monkeypatch.setattr("antumbra._sun._is_warned", False)
    with pytest.warns(UserWarning, match="taken as UTC"):
        am.sun_positions(0, 0, "2024-03-20T12:00")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        am.sun_positions(0, 0, "2024-03-20T12:00")
        monkeypatch.setattr("antumbra._sun._is_warned", False)
        am.sun_positions(0, 0, "2024-03-20T12:00", "UTC")
        am.sun_positions(0, 0, "2024-03-20T12:00Z")
        am.sun_positions(0, 0, 1.7e9)


def test_visibility_is_what_visible_says():
    scene = am.Scene(*soup(RNG, 200))
    a, b = (RNG.uniform(-1.5, 1.5, (n, 3)).astype(np.float32) for n in (70, 130))
    a[3] = np.nan
    seen = scene.visibility(a, b)
    expected = scene.visible(a[:, None], b)
    assert seen.shape == (70, 130) == expected.shape and len(seen) == 70
    np.testing.assert_array_equal(seen.to_numpy(), expected)
    assert not expected[3].any() and 0.05 < expected.mean() < 0.95
    for axis in (0, 1, -1, -2):
        np.testing.assert_array_equal(seen.count(axis), expected.sum(axis))
    assert seen.count() == expected.sum()
    for index in (0, -1, 69, slice(2, 9), slice(None, None, -7)):
        np.testing.assert_array_equal(seen[index], expected[index])
    assert seen[-1, -1] == expected[-1, -1] and seen[5, 128] is bool(expected[5, 128])
    bits = np.unpackbits(seen.words.view(np.uint8), axis=1, count=130, bitorder="little")
    np.testing.assert_array_equal(bits, expected)
    weights = RNG.uniform(0, 1, 130)
    np.testing.assert_allclose(seen.sums(weights), expected @ weights)
    assert seen == am.BitMatrix(seen.words, 130) == pickle.loads(pickle.dumps(seen))
    assert seen != scene.visibility(b, a) and seen != 3
    each = scene.visibility(b)
    np.testing.assert_array_equal(each.to_numpy(), each.to_numpy().T)
    assert not np.diag(each.to_numpy()).any()
    apart = ~np.eye(130, dtype=bool)
    np.testing.assert_array_equal(each.to_numpy()[apart], scene.visible(b[:, None], b)[apart])
    for margin in (0, 0.05):
        np.testing.assert_array_equal(scene.visibility(a, b, margin=margin).to_numpy(), scene.visible(a[:, None], b, margin=margin))
    assert (scene.visibility(b, margin=0.1).to_numpy() >= each.to_numpy()).all()
    for wrong in (70, (0, 130), -71):
        with pytest.raises(IndexError):
            seen[wrong]
    with pytest.raises(ValueError, match=r"words: found shape \(70, 3\), wanted \(n, 4\)"):
        am.BitMatrix(seen.words, 200)


def test_points_on_the_ground_see_all_of_the_sky():
    corners = np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0.0]])
    points, sky = np.c_[RNG.uniform(1, 9, (1000, 2)), np.zeros(1000)], am.sky_patches()[0]
    # Level, and tilted and far away, where nothing is exact.
    turn, far = np.array([[0.8, -0.6, 0], [0.168, 0.224, -0.96], [0.576, 0.768, 0.28]]), np.array([5e5, 5e6, 200])
    for scene, points, sky in (
        (am.Scene(corners, [[0, 1, 2], [0, 2, 3]]), points, sky),
        (am.Scene(corners @ turn.T + far, [[0, 1, 2], [0, 2, 3]]), points @ turn.T + far, sky @ turn.T),
    ):
        assert scene.visible(points[:, None], points[:, None] + 5 * sky).all()
        assert scene.visible(points[:, None] + 5e5 * sky, points[:, None]).all()
        assert scene.visibility(points, points[0] + 5 * sky).to_numpy().all()
        assert scene.sees(points, None, sky).to_numpy().all()
        np.testing.assert_array_equal(scene.sun_hours(points, None, sky, 1), len(sky))
        bare = scene.visible(points[:, None], points[:, None] + 5 * sky, margin=0)
        assert 0.1 < bare.mean() < 0.9, "the surface hides its own points"
    level = am.Scene(corners, [[0, 1, 2], [0, 2, 3]])
    ground = np.c_[RNG.uniform(1, 9, (1000, 2)), np.zeros(1000)]
    np.testing.assert_array_equal(level.sky_view(ground), 1)
    # The ground is one sheet: what is below it is seen from its lower side.
    assert level.visible(ground, ground - [0, 0, 5]).all()
    assert not level.visible(ground + [0, 0, 1], ground - [0, 0, 5]).any()


def test_irradiation_is_the_sum_over_suns_and_patches():
    scene = am.Scene(*soup(RNG, 60))
    points, normals = RNG.uniform(-1, 1, (40, 3)).astype(np.float32), RNG.normal(size=(40, 3)).astype(np.float32)
    times = np.datetime64("2024-06-21T00:30") + np.arange(24) * np.timedelta64(60, "m")
    beam, sky = RNG.uniform(0, 900, 24), RNG.uniform(1, 300, 24)
    found = am.irradiation(scene, points, normals, 48.2, 16.4, times, beam, sky, 1)
    sun = am.sun_positions(48.2, 16.4, times, 1)
    unit = normals / np.linalg.norm(normals.astype(float), axis=1, keepdims=True)
    towards = sun.direction[sun.up]
    seen = scene.sees(points, normals, towards).to_numpy()
    expected = (seen * np.maximum(unit @ towards.T, 0)) @ beam[sun.up] / 1000
    np.testing.assert_allclose(found.direct, expected, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(found.direct * 2, am.irradiation(scene, points, normals, 48.2, 16.4, times, beam, 0, 1, hours=2).direct)
    # Open level ground receives what was measured, half of the sky at most goes to a wall, and free points count as level.
    clear = am.Scene([[9, 9, -9], [9, 8, -9], [8, 9, -9]], [[0, 1, 2]])
    for ground in (clear, am.Scene(np.zeros((0, 3)), np.zeros((0, 3), int))):
        level = am.irradiation(ground, [0, 0, 0], [0, 0, 2], 48.2, 16.4, times, 0, sky, 1)
        np.testing.assert_allclose(level.diffuse, sky.sum() / 1000)
        assert level.direct == 0 and level.diffuse.shape == ()
        free = am.irradiation(ground, [[0, 0, 0]], None, 48.2, 16.4, times, 0, sky, 1)
        np.testing.assert_array_equal(free.diffuse, [level.diffuse])
    y = am.irradiation(clear, [0, 0, 0], [0, 1, 0], 48.2, 16.4, times, beam, sky, 1, up="y")
    z = am.irradiation(clear, [0, 0, 0], [0, 0, 1], 48.2, 16.4, times, beam, sky, 1)
    np.testing.assert_allclose(y, z)
    assert np.isnan(am.irradiation(clear, [0, 0, 0], [0, 0, 0], 0, 0, times, 1, 1)).all()


def test_grids_lie_on_what_is_seen_from_above():
    city = am.Scene.from_file("builtin:city:2000")
    points, normals, cells = city.sensor_grid(12.0)
    assert points.dtype == np.float64 and normals.dtype == np.float32 and cells.dtype == np.int64
    assert points.shape == normals.shape and (normals[:, 2] >= 0).all()
    np.testing.assert_array_equal(cells[cells >= 0], np.arange(len(points)))
    rows, columns = np.nonzero(cells >= 0)
    low, high = city.bounds
    np.testing.assert_allclose(points[:, 0], low[0] + 12 * (columns + 0.5), rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(points[:, 1], high[1] - 12 * (rows + 0.5), rtol=1e-5, atol=1e-3)
    far = am.Scene([[5e6, 5e6, 1], [5e6 + 4, 5e6, 1], [5e6 + 4, 5e6 + 4, 1], [5e6, 5e6 + 4, 1]], [[0, 1, 2], [0, 2, 3]])
    np.testing.assert_array_equal(far.sensor_grid(4.0)[0], [[5e6 + 2, 5e6 + 2, 1]])


def test_texels_lie_where_their_coordinates_are():
    corners = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]]) + [1e6, 2e6, 0]
    faces, uvs = [[0, 1, 2], [0, 2, 3]], [[0, 0], [0.5, 0], [0.5, 0.5], [0, 0.5]]
    points, normals, texels = am.texel_atlas(corners, faces, uvs, 8)
    assert texels.shape == (8, 8) and len(points) == 16
    np.testing.assert_array_equal(points[texels[7, 0]], [1e6 + 0.5, 2e6 + 0.5, 0])
    np.testing.assert_array_equal(points[texels[4, 3]], [1e6 + 3.5, 2e6 + 3.5, 0])
    assert (texels[:4] == -1).all() and (texels[:, 4:] == -1).all()
    np.testing.assert_array_equal(normals, np.broadcast_to([0, 0, 1], normals.shape))
    down = am.texel_atlas(corners, faces, uvs, 8, np.broadcast_to([0, 0, -2], (4, 3)))
    np.testing.assert_array_equal(down[1], -2 * normals)


@pytest.mark.parametrize(
    "call, text",
    [
        (lambda: WALL.ambient_occlusion([0, 0, 0], [0, 0, 1], 0), "samples: found 0"),
        (lambda: WALL.ambient_occlusion([0, 0, 0], [0, 0, 1], 8, -1), "distance: found -1"),
        (lambda: WALL.ambient_occlusion([0, 0, 0], [0, 0, 1], weighting="even"), "weighting: found"),
        (lambda: WALL.ambient_occlusion([0, 0, 0], [[0, 0, 1]] * 2), r"normals: found shape \(2, 3\), wanted \(3,\)"),
        (lambda: WALL.sky_view([0, 0, 0], patches=146), "patches: found 146"),
        (lambda: WALL.sky_view([0, 0, 0], up="x"), "up: found"),
        (lambda: WALL.sky_view([0, 0, 0], north=np.inf), "north: found inf"),
        (lambda: WALL.sun_hours([0, 0, 0], None, [0, 0, 1]), r"suns: found shape \(3,\), wanted \(k, 3\)"),
        (lambda: WALL.sun_hours([0, 0, 0], None, np.eye(3)), "weights: wanted the length of each step in hours"),
        (lambda: WALL.sun_hours([0, 0, 0], None, am.sun_positions(0, 0, "2024-03-20T12:00", 0)), "which a single time does not say"),
        (lambda: WALL.sun_hours(np.ma.array([[0, 0, 0]], mask=[[0, 1, 0]]), None, np.eye(3), 1), "points: 1 numbers are masked"),
        (lambda: WALL.sun_hours([0, 0, 0], None, np.eye(3), [1, 2]), r"weights: found shape \(2,\), wanted \(\) or \(3,\)"),
        (lambda: WALL.sensor_grid(0), "spacing: found 0"),
        (lambda: WALL.sensor_grid(1e-9), "100 million are the most"),
        (lambda: am.texel_atlas(np.eye(3), [[0, 1, 2]], np.full((3, 2), np.nan), 4), "no triangle has texture coordinates"),
        (lambda: am.texel_atlas(np.eye(3), [[0, 1, 2]], np.eye(2), 4), r"uvs: found shape \(2, 2\), wanted \(3, 2\)"),
        (lambda: am.texel_atlas(np.eye(3), [[0, 1, 2]], np.zeros((3, 2)), 0), "size: found 0"),
        (lambda: am.irradiation(WALL, [0, 0, 0], None, 0, 0, [0.0], -1, 0), "direct_normal: found -1"),
        (lambda: am.irradiation(WALL, [0, 0, 0], None, 91, 0, [0.0], 1, 0), "latitude: found 91"),
        (lambda: am.irradiation(WALL, [0, 0, 0], None, 0, 0, [np.inf], 1, 0), "time: found inf"),
        (lambda: am.irradiation(WALL, [0, 0, 0], None, 0, 0, [0.0], [1, 2], 0), r"direct_normal: found shape \(2,\)"),
        (lambda: WALL.visibility([0, 0, 0]), r"a: found shape \(3,\), wanted \(n, 3\)"),
        (lambda: am.sun_positions(91, 0, 0), "latitude: found 91"),
        (lambda: am.sun_positions(0, 0, np.datetime64("NaT")), "NaT"),
        (lambda: am.sun_positions(0, 0, np.zeros((2, 2))), r"times: found shape \(2, 2\)"),
    ],
)
def test_errors_name_argument_found_and_wanted(call, text):
    with pytest.raises(ValueError, match=text):
        call()


def test_the_sun_stands_where_tables_say():
    # Reda and Andreas 2004, appendix A.5: Golden, Colorado, at 12:30:30 on clocks seven hours behind UTC.
    sun = am.sun_positions(39.742476, -105.1786, np.datetime64("2003-10-17T12:30:30"), -7, height=1830.14)
    np.testing.assert_allclose(sun.azimuth, 194.34024, atol=0.01)
    np.testing.assert_allclose(sun.elevation, 90 - 50.11162, atol=0.01)
    np.testing.assert_allclose(sun.direction[0, 2], np.sin(np.radians(sun.elevation[0])))
    assert sun.up.all() and sun.direction[0, 1] < 0, "in the south"


def test_times_are_given_in_many_ways():
    rome = zoneinfo.ZoneInfo("Europe/Rome")
    utc = datetime.timezone.utc
    summer = datetime.datetime(2024, 6, 21, 12, 0)
    expected = am.sun_positions(41.9, 12.5, [datetime.datetime(2024, 6, 21, 10, 0, tzinfo=utc)])
    for times, zone in [
        (summer, rome), ([summer], rome), (np.datetime64(summer), rome), (summer, 2), (np.array([summer], "M8[s]"), 2.0),
        (summer.replace(tzinfo=rome), None), (summer.replace(tzinfo=rome), 5), ([1718964000], 3),
        (summer, "Europe/Rome"), ([summer], "Europe/Rome"), (np.datetime64(summer), "Europe/Rome"), ("2024-06-21T12:00", rome),
        (["2024-06-21 12:00:00"], "Europe/Rome"), (np.array(["2024-06-21T12:00"]), 2), ("2024-06-21T10:00Z", rome),
        ("2024-06-21T13:00+03:00", None), (np.datetime64("2024-06-21T10:00"), None),
    ]:
        found = am.sun_positions(41.9, 12.5, times, zone)
        np.testing.assert_array_equal(found.direction, expected.direction)
    assert am.sun_positions(0, 0, []).direction.shape == (0, 3)
    with pytest.raises(TypeError, match="times: found dtype"):
        am.sun_positions(0, 0, [1j])
    with pytest.raises(ValueError, match=r"times\[1\]: found 'noon', wanted a time in ISO 8601"):
        am.sun_positions(0, 0, ["2024-06-21", "noon"])
    for wrong, kind in (("Europe/Atlantis", ValueError), ("/etc/passwd", ValueError), (25, ValueError), ([1, 2], TypeError)):
        with pytest.raises(kind, match="timezone: found"):
            am.sun_positions(0, 0, summer, wrong)
    # Where y is up, north is -z, and turned by 90 degrees it is x.
    y = am.sun_positions(41.9, 12.5, summer, 2, up="y")
    np.testing.assert_allclose(y.direction[0], expected.direction[0][[0, 2, 1]] * [1, 1, -1], atol=1e-12)
    turned = am.sun_positions(41.9, 12.5, summer, 2, north=90)
    np.testing.assert_allclose(turned.direction[0], expected.direction[0][[1, 0, 2]] * [1, -1, 1], atol=1e-12)


def test_patches_cover_the_sky():
    for count, uniform in ((145, False), (577, False), (2305, False), (300, True)):
        directions, angles = am.sky_patches(count, uniform=uniform)
        assert directions.shape == (count, 3) and angles.shape == (count,)
        np.testing.assert_allclose(angles.sum(), 2 * np.pi)
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)


def test_long_bakes_tell_progress_and_can_be_stopped():
    scene = am.Scene(*soup(RNG, 2000, 0.3))
    points, told = RNG.uniform(-1, 1, (20_000, 3)), []
    scene.ambient_occlusion(points, points, 128, progress=lambda *done: told.append(done))
    assert told[-1] == (20_000, 20_000)

    def stop(done, total):
        raise KeyError(done)

    with pytest.raises(KeyError):
        scene.ambient_occlusion(points, points, 100_000, progress=stop)


def test_pictures_are_rendered_and_saved(tmp_path):
    picture = am.render("builtin:city:2000", spp=2, size=(32, 18), standard_error=True)
    assert picture.pixels.shape == (18, 32, 3) and picture.pixels.dtype == np.float32
    assert picture.aov["standard_error"].shape == (18, 32, 3)
    again = am.render("builtin:city:2000", spp=2, size=(32, 18), threads=1)
    np.testing.assert_array_equal(picture.pixels, again.pixels)
    for name in ("a.png", "a.exr"):
        picture.save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 100
    heat = am.heat_map(np.arange(6.0).reshape(2, 3), 0, 5, legend=False)
    assert heat.pixels.shape == (2, 3, 3) and heat.pixels.dtype == np.uint8
    red, green, blue = heat.pixels.reshape(-1, 3).astype(int).T
    assert blue[1] > red[1] and red[-1] > blue[-1] and len(set(zip(red, green, blue))) == 6
    heat.save(tmp_path / "heat.png")
    am.Picture(np.zeros((4, 5))).save(tmp_path / "grey.png")
    am.Picture(np.zeros((4, 5, 3), np.uint8)).save(tmp_path / "display.png")
    for bad, text in (("a.exr", "uint8"), ("a.jpg", "uint8")):
        with pytest.raises(ValueError, match=text):
            heat.save(tmp_path / bad)
    with pytest.raises(ValueError, match="pixels: found shape"):
        am.Picture(np.zeros(3))
    with pytest.raises(OSError):
        picture.save(tmp_path / "none" / "a.png")
    with pytest.raises(FileNotFoundError):
        am.render(tmp_path / "none.pbrt")
