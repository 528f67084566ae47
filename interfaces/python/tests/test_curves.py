"""Curves: hits against their definition in numpy, and against the formulas of cubic curves."""

import pickle

import antumbra as am
import numpy as np
import pytest
from brute import box
from hypothesis import given, settings
from hypothesis import strategies as st


def segment_hits(points, radii, origins, directions):
    """Distance, share and side of every ray at every segment of one linear curve, inf where it misses; and whether each is clear of
    rounding. The nearest point to the ray is on the axis as seen along the ray, where it is within the radius."""
    a, axis = points[:-1][None], np.diff(points, axis=0)[None]
    o, d = origins[:, None], directions[:, None]
    along = lambda way: (way * d).sum(-1) / (d * d).sum(-1)
    seen = lambda way: way - along(way)[..., None] * d
    first, way = seen(a - o), seen(axis)
    foot = -(first * way).sum(-1) / (way * way).sum(-1)
    is_inner = np.arange(len(points) - 1)
    cut = ((foot < 0) & (is_inner == 0)) | ((foot > 1) & (is_inner == len(points) - 2))
    share = np.clip(foot, 0, 1)
    apart = np.linalg.norm(first + share[..., None] * way, axis=-1)
    radius = (1 - share) * radii[:-1] + share * radii[1:]
    t = along(a - o) + share * along(np.broadcast_to(axis, np.broadcast_shapes(a.shape, o.shape)))
    is_hit = ~cut & (apart <= radius) & (t > 0)
    clear = (np.abs(apart - radius) > 1e-5) & (np.minimum(np.abs(foot), np.abs(foot - 1)) > 1e-5) & (np.abs(t) > 1e-5)
    return np.where(is_hit, t, np.inf), share, clear


@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(2, 9))
@settings(max_examples=30, deadline=None)
def test_linear_curves_are_hit_as_defined(seed, curves, count):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (curves, count, 3)).astype(np.float32)
    radii = rng.uniform(0.02, 0.3, (curves, count)).astype(np.float32)
    scene = am.Scene(am.Curves(points, radii))
    assert scene.report["triangles"] == curves * (count - 1)
    origins = rng.uniform(-2, 2, (300, 3)).astype(np.float32)
    directions = rng.uniform(-1, 1, (300, 3)).astype(np.float32) - origins
    found = [segment_hits(*(x.astype(float) for x in (p, r, origins, directions))) for p, r in zip(points, radii)]
    t, share, clear = (np.concatenate([curve[k] for curve in found], 1) for k in range(3))
    sure = clear.all(1)
    assert sure.mean() > 0.8
    hits, first = scene.intersect(origins, directions), t.argmin(1)
    rows = np.arange(300)
    is_hit = np.isfinite(t[rows, first])
    np.testing.assert_array_equal(hits.hit[sure], is_hit[sure])
    np.testing.assert_array_equal(scene.occluded(origins, directions)[sure], is_hit[sure])
    np.testing.assert_array_equal(scene.count(origins, directions)[sure], np.isfinite(t).sum(1)[sure])
    # Neighbours share the point between them, and hits there are ties.
    second = np.partition(t, 1, 1)[:, 1] if t.shape[1] > 1 else np.full(300, np.inf)
    sure &= is_hit & ~(second - np.where(is_hit, t[rows, first], 0) < 1e-5)
    np.testing.assert_array_equal(hits.triangle[sure], first[sure])
    np.testing.assert_allclose(hits.t[sure], t[rows, first][sure], rtol=1e-5)
    np.testing.assert_allclose(hits.uv[sure, 0], share[rows, first][sure], atol=1e-5)
    np.testing.assert_array_equal(hits.curve[sure], first[sure] // (count - 1))
    np.testing.assert_allclose(hits.along[sure], (first % (count - 1) + share[rows, first])[sure], atol=1e-5)
    assert np.isnan(hits.along[~hits.hit]).all() and (hits.curve[~hits.hit] == -1).all()
    # Where the ray passes the axis, and towards the ray.
    np.testing.assert_allclose(hits.point[sure], (origins + hits.t[:, None] * directions)[sure], atol=1e-5)
    axis = np.diff(points, axis=1).reshape(-1, 3)[hits.triangle[sure]]
    normal = hits.normal[sure].astype(float)
    assert np.abs((normal * axis).sum(1)).max(initial=0) < 1e-5
    assert ((normal * directions[sure]).sum(1) < 0).all()
    excluded = scene.intersect(origins, directions, exclude=hits)
    assert not (hits.hit & (excluded.triangle == hits.triangle)).any()


BASES = {
    "bezier": [[1, -3, 3, -1], [0, 3, -6, 3], [0, 0, 3, -3], [0, 0, 0, 1]],
    "bspline": np.divide([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]], 6),
    "catmull-rom": np.divide([[0, -1, 2, -1], [2, 0, -5, 3], [0, 1, 4, -3], [0, 0, -1, 1]], 2),
}
"""For each control point the factors of 1, u, u^2 and u^3."""


@pytest.mark.parametrize("kind, count", [("bezier", 4), ("bezier", 10), ("bspline", 4), ("bspline", 7), ("catmull-rom", 6)])
def test_cubic_curves_run_where_their_formulas_say(kind, count):
    rng = np.random.default_rng(count)
    points = np.cumsum(rng.normal(size=(3, count, 3)), 1).astype(np.float32)
    scene = am.Scene(am.Curves(points, 0.01, kind))
    step = 3 if kind == "bezier" else 1
    pieces = (count - 1) // 3 if kind == "bezier" else count - 3
    curve, along = np.repeat(np.arange(3), 200), rng.uniform(0.02, pieces - 0.02, 600)
    piece = along.astype(int)
    control = points[curve[:, None], step * piece[:, None] + np.arange(4)].astype(float)
    powers = (along - piece)[:, None] ** np.arange(4)
    axis = np.einsum("ij,nj,nik->nk", np.asarray(BASES[kind], float), powers, control)
    slope = np.einsum("ij,nj,nik->nk", np.asarray(BASES[kind], float)[:, 1:], powers[:, :3] * [1, 2, 3], control)
    # From beside the curve through it: within a tenth of the radius of its axis.
    way = np.cross(slope, rng.normal(size=(600, 3)))
    way /= np.linalg.norm(way, axis=1)[:, None]
    hits = scene.intersect(axis - 0.02 * way, way, 0.04)
    assert hits.hit.all()
    is_own = hits.curve == curve
    assert is_own.mean() > 0.99
    speed = np.linalg.norm(slope, axis=1)
    # Near a joint the segment beside it may be hit first, at the joint. Few rays hit another part of the same curve.
    off = (np.abs(hits.along - along) * speed)[is_own]
    assert np.median(off) < 0.001 and np.mean(off < 0.012) > 0.98
    assert np.mean(np.abs(hits.t - 0.02)[is_own] < 0.003) > 0.98
    # Beside the curve there is nothing.
    side = np.cross(slope, way) / speed[:, None]
    assert scene.occluded(axis - 0.02 * way + 0.0125 * side, way, 0.04).mean() < 0.05


def test_curves_of_different_lengths_stand_one_after_the_other():
    rng = np.random.default_rng(3)
    parts = [rng.uniform(-1, 1, (n, 3)) for n in (2, 5, 3)]
    one = am.Scene(am.Curves(np.concatenate(parts), 0.1, counts=[2, 5, 3]))
    several = am.Scene([am.Curves(part, 0.1) for part in parts])
    o, d = rng.uniform(-2, 2, (2000, 3)), rng.normal(size=(2000, 3))
    a, b = one.intersect(o, d), several.intersect(o, d)
    assert a.hit.sum() > 50
    np.testing.assert_array_equal(a.t, b.t)
    np.testing.assert_array_equal(a.along, b.along)
    np.testing.assert_array_equal(a.curve, np.where(b.hit, b.mesh, -1))


def test_curves_stand_beside_meshes_in_scenes_and_worlds(tmp_path):
    rng = np.random.default_rng(8)
    hair = am.Curves(rng.uniform(-1, 1, (20, 5, 3)), np.linspace(0.1, 0, 5), "bspline")
    move = np.eye(4)
    move[:3, 3] = 3, 0, 0
    scene = am.Scene([box(), hair], instances=[(1, move), (1, np.eye(4))], masks=[1, 2])
    world = am.World([hair], [move, np.eye(4)], ground=[box()])
    o, d = rng.uniform(-4, 4, (4000, 3)), rng.normal(size=(4000, 3))
    hits, moved = scene.intersect(o, d), world.intersect(o, d)
    assert set(hits.mesh) == {-1, 0, 1} and ((hits.curve >= 0) == (hits.mesh == 1)).all()
    np.testing.assert_array_equal(hits.t, moved.t)
    np.testing.assert_array_equal(hits.curve, moved.curve)
    np.testing.assert_array_equal(hits.along, moved.along)
    assert len(scene.vertices) == 8 and repr(scene).startswith("<antumbra.Scene: 2 meshes, ")
    assert "primitives" in scene._repr_html_()
    assert set(scene.intersect(o, d, mask=2).mesh) == {-1, 1}
    scene.save(tmp_path / "hair")
    for other in (am.Scene.load(tmp_path / "hair"), pickle.loads(pickle.dumps(scene)), scene.learn(o[:500], d[:500])):
        again = other.intersect(o, d)
        for name in ("t", "triangle", "mesh", "instance", "uv", "curve", "along", "point", "normal"):
            np.testing.assert_array_equal(getattr(again, name), getattr(hits, name))
    with pytest.raises(RuntimeError, match="hits that were pickled"):
        pickle.loads(pickle.dumps(hits)).along
    with pytest.raises(ValueError, match="found mesh 0, which is curves"):
        world.refit({0: np.zeros((5, 3))})
    # The nearest point of an axis.
    near = am.Scene(am.Curves([[0, 0, 0], [2, 0, 0]], 0.1)).closest([0.5, 3, 0])
    assert near.distance == 3 and near.along == 0.25 and near.point.tolist() == [0.5, 0, 0]
    # On maps.
    far = am.Scene([am.Curves(np.asarray([[0, 0, 0], [2, 0, 0]]) + [4e6, 5e6, 100], 0.01)])
    assert far.occluded([4e6 + 1, 5e6 + 0.009, 90], [0, 0, 1]) and not far.occluded([4e6 + 1, 5e6 + 0.011, 90], [0, 0, 1])


def test_curves_that_are_none_are_refused():
    line = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
    for curves, text in [
        (am.Curves(line, 0.1, "cubic"), 'kind: found "cubic", wanted "linear", "bezier"'),
        (am.Curves(line, 0.1, "bezier"), "points: found 3 of curve 0, wanted 4, 7, 10, ... for the kind bezier"),
        (am.Curves(line, 0.1, "bspline"), "points: found 3 of curve 0, wanted at least 4"),
        (am.Curves(line[:1], 0.1), "points: found 1 of curve 0, wanted at least 2"),
        (am.Curves(line[0], 0.1), r"points: found shape \(3,\), wanted \(..., n, 3\)"),
        (am.Curves(line, [0.1, -0.1, 0]), "radii: found -0.1, wanted numbers of at least 0"),
        (am.Curves(line, [0.1, 0.1]), "shapes do not fit"),
        (am.Curves(line, [[0.1]] * 2), "radii|shapes do not fit"),
        (am.Curves(line, 0.1, counts=[2, 2]), "counts: found a sum of 4, wanted 3"),
        (am.Curves(line, 0.1, counts=[1, 2]), "points: found 1 of curve 0"),
        (am.Curves(line, 0.1, counts=[-1, 4]), "counts: found -1, wanted"),
        (am.Curves([line], 0.1, counts=[3]), "points: found shape"),
    ]:
        with pytest.raises(ValueError, match=text):
            am.Scene(curves)
    with pytest.raises(TypeError, match="kind: found int, wanted a string"):
        am.Scene(am.Curves(line, 0.1, 3))
    with pytest.raises(ValueError, match=r"meshes\[1\]: radii"):
        am.Scene([box(), am.Curves(line, -1)])
    with pytest.warns(am.DegenerateWarning, match="1 of 2"):
        am.Scene(am.Curves([[0, 0, 0], [1, 0, 0], [np.nan, 0, 0]], 0.1))
    assert not am.Scene(am.Curves(np.zeros((0, 4, 3)), 0.1)).occluded([0, 0, 0], [0, 0, 1])
