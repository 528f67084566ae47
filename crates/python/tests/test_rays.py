"""Questions about rays: answers against brute force in numpy."""

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
