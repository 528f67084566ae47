"""Questions about rays: answers against brute force in numpy."""

import tracemalloc

import antumbra as am
import numpy as np
import pytest
from brute import all_hits, box, first_hits, soup
from hypothesis import given, settings
from hypothesis import strategies as st


def rays(rng, n):
    return rng.uniform(-1.5, 1.5, (n, 3)).astype(np.float32), rng.normal(size=(n, 3)).astype(np.float32)


@given(st.integers(0, 2**32 - 1), st.integers(1, 60))
@settings(max_examples=40, deadline=None)
def test_answers_are_those_of_brute_force(seed, triangles):
    rng = np.random.default_rng(seed)
    vertices, faces = soup(rng, triangles)
    origins, directions = rays(rng, 200)
    scene = am.Scene(vertices, faces)
    t, triangle, sure = first_hits(vertices, faces, origins, directions)
    assert sure.mean() > 0.9
    hits = scene.intersect(origins, directions)
    np.testing.assert_array_equal(hits.triangle[sure], triangle[sure])
    # Corners are rounded to single precision, which shows where a ray begins beside a triangle.
    np.testing.assert_allclose(hits.t[sure], t[sure], rtol=2e-4, atol=1e-6)
    np.testing.assert_array_equal(scene.occluded(origins, directions)[sure], np.isfinite(t[sure]))
    everything, clear = all_hits(vertices, faces, origins, directions)
    sure = clear.all(1)
    counts = np.isfinite(everything).sum(1)
    np.testing.assert_array_equal(scene.count(origins, directions)[sure], counts[sure])
    listed = scene.intersect_all(origins, directions)
    for ray in np.flatnonzero(sure):
        found = slice(*listed.splits[ray : ray + 2])
        np.testing.assert_allclose(
            listed.t[found], np.sort(everything[ray][np.isfinite(everything[ray])]), rtol=2e-4, atol=1e-6
        )
        assert set(listed.triangle[found]) == set(np.flatnonzero(np.isfinite(everything[ray])))


def test_distance_cuts_rays_off_and_both_ends_count():
    vertices = [[0, 0, 1], [1, 0, 1], [0, 1, 1]]
    scene = am.Scene(vertices, [[0, 1, 2]])
    at, up = [0.25, 0.25, 0], [0, 0, 2]
    for far, near, expected in [
        (0.5, 0, True), (0.49, 0, False), (np.inf, 0.5, True), (np.inf, 0.51, False), (0.5, 0.5, True),
    ]:
        assert scene.occluded(at, up, far, near=near) == expected
        assert scene.intersect(at, up, far, near=near).hit == expected
        assert scene.count(at, up, far, near=near) == expected
        assert len(scene.intersect_all(at, up, far, near=near).t) == expected
    # A ray that begins on the surface hits it, and one that ends there.
    assert scene.occluded([0.25, 0.25, 1], up)
    assert scene.intersect([0.25, 0.25, 1], up).t == 0
    # Segments between points are open.
    assert scene.visible(at, [0.25, 0.25, 1])
    assert not scene.visible(at, [0.25, 0.25, 1.01])


def test_a_margin_is_left_out_at_both_ends():
    scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    low, high = [0.25, 0.25, 0], [0.25, 0.25, 1.125]
    assert not scene.visible(low, high) and not scene.visible(high, low)
    assert not scene.visible(low, high, margin=0.1)
    assert scene.visible(low, high, margin=0.15) and scene.visible(high, low, margin=0.15)
    assert scene.visible(low, low) and scene.visible(low, low, margin=1) and scene.visible(low, low, margin=0)
    for margin in (-1, np.nan, np.inf):
        with pytest.raises(ValueError, match="margin: found"):
            scene.visible(low, high, margin=margin)


def test_rays_that_are_none_hit_nothing():
    vertices, faces = box()
    scene = am.Scene(vertices, faces)
    nan, inf = np.nan, np.inf
    origins = [[nan, 0, 0], [0, 0, 0], [0, 0, 0], [inf, 0, 0], [0, 0, 0]]
    directions = [[0, 0, 1], [nan, 0, 1], [0, 0, 0], [-1, 0, 0], [0, 0, inf]]
    assert not scene.occluded(origins, directions).any()
    assert not scene.occluded([0, 0, 0], [0, 0, 1], nan).any()
    hits = scene.intersect(origins, directions)
    assert np.isinf(hits.t).all() and (hits.triangle == -1).all() and (hits.mesh == -1).all()
    assert (hits.instance == -1).all() and (hits.uv == 0).all() and not hits.hit.any()
    assert np.isnan(hits.point).all() and np.isnan(hits.normal).all()
    assert not scene.visible([nan, 0, 0], [5, 5, 5]) and not scene.visible([5, 5, 5], [inf, 0, 0])


def test_an_empty_scene_is_fine():
    for scene in (am.Scene([], []), am.Scene(np.zeros((0, 3)), np.zeros((0, 3), int)), am.Scene([])):
        assert not scene.occluded(np.zeros((4, 3)), [0, 0, 1]).any()
        assert len(scene.intersect_all(np.zeros((4, 3)), [0, 0, 1]).t) == 0
        assert np.isnan(scene.bounds).all()
        assert np.isinf(scene.closest([0, 0, 0]).distance)
        assert scene.visible([0, 0, 0], [1, 1, 1]) and not scene.contains([0, 0, 0])


def test_points_and_normals_lie_where_triangles_do():
    rng = np.random.default_rng(4)
    vertices, faces = soup(rng, 50)
    origins, directions = rays(rng, 500)
    hits = am.Scene(vertices, faces).intersect(origins, directions)
    hit = hits.hit
    along = origins + hits.t[:, None].astype(float) * directions
    np.testing.assert_allclose(hits.point[hit], along[hit], atol=2e-4)
    a, b, c = (vertices[faces[hits.triangle[hit], k]].astype(float) for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    np.testing.assert_allclose(hits.normal[hit], normal, atol=1e-6)
    assert np.abs(((hits.point[hit] - a) * normal).sum(1)).max() < 1e-7
    assert hits.point is hits.point, "made once"


def test_max_hits_keeps_the_nearest():
    vertices = np.concatenate([[[0, 0, z], [1, 0, z], [0, 1, z]] for z in (3, 1, 2)])
    scene = am.Scene(vertices, np.arange(9).reshape(3, 3))
    listed = scene.intersect_all([[0.2, 0.2, 0], [9, 9, 9], [0.2, 0.2, 0]], [0, 0, 1], max_hits=2)
    np.testing.assert_array_equal(listed.splits, [0, 2, 2, 4])
    np.testing.assert_array_equal(listed.t, [1, 2, 1, 2])
    np.testing.assert_array_equal(listed.triangle, [1, 2, 1, 2])
    np.testing.assert_array_equal(listed.ray, [0, 0, 2, 2])
    np.testing.assert_array_equal(listed.point[:, 2], [1, 2, 1, 2])
    assert isinstance(listed, am.Hits) and listed.shape == (4,)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_many_rays_have_the_answers_of_few(threads):
    rng = np.random.default_rng(1)
    vertices, faces = soup(rng, 3000, 0.3)
    scene = am.Scene(vertices, faces)
    n = 600_000
    origins, directions = rays(rng, n)
    whole = scene.intersect(origins, directions, threads=threads)
    occluded = scene.occluded(origins, directions, threads=threads)
    # By another path: double precision is gathered, and a few rays stay on this thread.
    doubled = scene.intersect(origins.astype(float), directions.astype(float), threads=threads)
    np.testing.assert_array_equal(whole.t, doubled.t)
    np.testing.assert_array_equal(whole.triangle, doubled.triangle)
    for first in (0, 123_456, n - 1000):
        some = slice(first, first + 1000)
        few = scene.intersect(origins[some], directions[some], threads=1)
        np.testing.assert_array_equal(whole.t[some], few.t)
        np.testing.assert_array_equal(whole.triangle[some], few.triangle)
        np.testing.assert_array_equal(whole.uv[some], few.uv)
        np.testing.assert_array_equal(occluded[some], few.hit)
    some = slice(0, 100_000)
    counts = scene.count(origins[some], directions[some], threads=threads)
    listed = scene.intersect_all(origins[some], directions[some], threads=threads)
    np.testing.assert_array_equal(np.diff(listed.splits), counts)


def test_a_learned_scene_has_the_same_answers():
    rng = np.random.default_rng(2)
    vertices, faces = soup(rng, 2000, 0.4)
    origins, directions = rays(rng, 5000)
    plain = am.Scene(vertices, faces)
    learned = plain.learn(origins[:1000], directions[:1000])
    assert learned.report["training_rays"] > 0
    np.testing.assert_array_equal(plain.intersect(origins, directions).t, learned.intersect(origins, directions).t)
    fast = am.Scene(vertices, faces, quality="fast")
    np.testing.assert_array_equal(plain.occluded(origins, directions), fast.occluded(origins, directions))


def one_by_one(scene, origins, directions, **rest):
    """The same question with an array of all rays."""
    shape = np.broadcast_shapes(np.shape(origins), np.shape(directions))
    return scene.occluded(*(np.broadcast_to(rows, shape).copy() for rows in (origins, directions)), **rest)


def flat_and_soup():
    """A plane of triangles, on which points are exactly, and triangles around it."""
    rng = np.random.default_rng(11)
    vertices, faces = soup(rng, 300, 0.4)
    x, y = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9))
    corner = np.arange(81).reshape(9, 9)[:-1, :-1].reshape(-1)
    plane = np.stack([x, y, 0 * x], -1).reshape(-1, 3)
    cells = np.concatenate([corner[:, None] + [0, 1, 10], corner[:, None] + [0, 10, 9]])
    return [(plane, cells), (vertices, faces)], vertices, faces


def group_of_rays(rng, vertices, faces, points, directions):
    """Points in free space, on planes, edges and corners, and some that are none; directions of all kinds and lengths."""
    at = rng.uniform(-1.2, 1.2, (points, 3))
    at[: points // 4, 2] = 0
    at[: points // 8] = np.round(at[: points // 8] * 4) / 4
    corners = vertices[faces[rng.integers(0, len(faces), points // 8)]]
    at[points // 4 : points // 4 + points // 8] = corners.mean(1)
    at[points // 2 : points // 2 + points // 8] = corners[:, 0]
    at[-3:] = [[np.nan, 0, 0], [0, np.inf, 0], [1e30, 0, 0]]
    to = rng.normal(size=(directions, 3)) * 10 ** rng.uniform(-3, 3, (directions, 1))
    to[:3] = [[0, 0, 1], [0, -1, 0], [1, 0, 0]]
    to[3:9] = [[0, 0, 0], [np.nan, 0, 1], [0, np.inf, 1], [1e-30, 0, 2e-30], [1e30, 1e30, 0], [1e-45, 0, 0]]
    to[9:12, 2] *= 1e-9
    return at.astype(np.float32), to.astype(np.float32)


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("points, directions", [(160, 130), (500, 40), (40, 700)])
def test_rays_from_every_point_in_every_direction_are_those_one_by_one(points, directions, threads):
    meshes, vertices, faces = flat_and_soup()
    move = np.eye(4)
    move[:3, 3] = 0.5, -0.25, 0.125
    scenes = [am.Scene(meshes), am.Scene(meshes, instances=[(1, move)]), am.World(meshes, np.stack([np.eye(4), move]), [0, 1])]
    o, d = group_of_rays(np.random.default_rng(points), vertices, faces, points, directions)
    o, d = o[:, None], d[None]
    ends = [(None, None), (1, None), (0, None), (-1, None), (np.nan, None), (0.75, 0.125), (None, 1e-40), (2, -0.5), (0.5, 1e-3)]
    found = set()
    for scene in scenes:
        for distance, near in ends:
            expected = one_by_one(scene, o, d, distance=distance, near=near, threads=threads)
            for p, q in ((o, d), (o.swapaxes(0, 1), d.swapaxes(0, 1))):
                answers = scene.occluded(p, q, distance, near=near, threads=threads)
                np.testing.assert_array_equal(answers, expected if p is o else expected.T)
            found.add(expected.mean())
    assert len(found) > 10
    # Where a closed ray begins on a triangle.
    assert scenes[0].occluded(o, d, 0, threads=threads).any()


def test_groups_of_rays_have_any_shape_and_need_no_copies():
    meshes, vertices, faces = flat_and_soup()
    o, d = group_of_rays(np.random.default_rng(4), vertices, faces, 180, 120)
    far = am.Scene([(v + [4e6, 5e6, 0], f) for v, f in meshes])
    assert far.origin != (0, 0, 0)
    places = o.astype(float).reshape(12, 15, 1, 3) + [4e6, 5e6, 0]
    ways = d.astype(float).reshape(8, 15, 3)[:, :, None, None]
    expected = one_by_one(far, places[..., 0, :], ways)
    assert expected.shape == (8, 15, 12, 15) and 0.05 < expected.mean() < 0.95
    np.testing.assert_array_equal(far.occluded(places[..., 0, :], ways), expected)
    np.testing.assert_array_equal(far.occluded(places, ways[:, :, 0, 0].reshape(120, 3)).reshape(180, 120), expected.reshape(120, 180).T)
    out = np.zeros(expected.shape, bool)
    assert far.occluded(places[..., 0, :], ways, out=out) is out
    np.testing.assert_array_equal(out, expected)
    # Arrays that numpy has broadcast already.
    scene = am.Scene(meshes)
    shape = (180, 120, 3)
    views = np.broadcast_to(o[:, None], shape), np.broadcast_to(d, shape)
    out = np.zeros(shape[:2], bool)
    tracemalloc.start()
    scene.occluded(*views, out=out)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < out.size
    np.testing.assert_array_equal(out, scene.occluded(*(view.copy() for view in views)))
    # Rays with conditions, or an end of their own, are asked about one by one.
    assert not scene.occluded(*views, mask=0).any()
    ends = np.linspace(0, 2, 180)[:, None]
    np.testing.assert_array_equal(scene.occluded(*views, ends), one_by_one(scene, *views, distance=ends))


def test_what_numpy_repeats_is_read_once():
    scene = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])
    up = np.broadcast_to(np.float32([0, 0, 1]), (4, 5, 3))
    at = np.broadcast_to(np.linspace(0, 1, 5)[:, None] * [1, 1, 0], (4, 5, 3))
    assert scene.occluded(at, up).tolist() == [[True, True, True, False, False]] * 4
    assert scene.intersect(at, up, np.broadcast_to([[0.5], [1], [2], [3]], (4, 5))).hit.sum(1).tolist() == [0, 3, 3, 3]
    assert scene.visible(at, np.broadcast_to([0.2, 0.2, 2], (4, 5, 3))).shape == (4, 5)
    matrix = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (4, 4))
    with pytest.warns(am.DegenerateWarning):
        am.Scene([([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]])], instances=[(0, matrix)])
    stripes = np.broadcast_to(np.linspace(0, 1, 4)[:, None, None], (4, 6, 3))
    assert np.asarray(am.Picture(stripes))[:, 5, 1].tolist() == pytest.approx(np.linspace(0, 1, 4).tolist())
