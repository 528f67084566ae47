"""What arguments may be: shapes, strides, types, far coordinates; and what is said of wrong ones."""

import antumbra as am
import numpy as np
import pytest
from brute import box, soup
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

SCENE = am.Scene(*soup(np.random.default_rng(0), 100))


def variants(array):
    """The same numbers in other memory."""
    yield array.tolist()
    yield np.asfortranarray(array)
    spaced = np.zeros((*array.shape[:-1], 7), array.dtype)
    spaced[..., 1:7:2] = array
    yield spaced[..., 1:7:2]
    yield array[::-1].copy()[::-1]
    yield array.astype(array.dtype.newbyteorder())
    frozen = array.copy()
    frozen.setflags(write=False)
    yield frozen
    unaligned = np.frombuffer(b"x" + array.tobytes(), np.uint8)[1:].view(array.dtype)
    yield unaligned.reshape(array.shape)
    yield array.astype(np.float64)
    yield array.astype(np.longdouble)


def test_any_memory_will_do():
    rng = np.random.default_rng(3)
    origins = rng.uniform(-1.5, 1.5, (60, 3)).astype(np.float32)
    directions = rng.normal(size=(60, 3)).astype(np.float32)
    expected = SCENE.intersect(origins, directions)
    assert expected.hit.any() and not expected.hit.all()
    for kind, (o, d) in enumerate(zip(variants(origins), variants(directions))):
        for found in (SCENE.intersect(o, directions), SCENE.intersect(origins, d), SCENE.intersect(o, d)):
            np.testing.assert_array_equal(found.t, expected.t, f"variant {kind}")
    vertices, faces = soup(np.random.default_rng(0), 100)
    for v in variants(vertices):
        for f in (faces.tolist(), faces.astype(np.uint16), faces.astype(np.uint64), faces.astype(">i4"), np.asfortranarray(faces)):
            np.testing.assert_array_equal(am.Scene(v, f).intersect(origins, directions).t, expected.t)


@given(hnp.mutually_broadcastable_shapes(num_shapes=4, max_dims=4, max_side=4), st.integers(0, 2**32 - 1), st.booleans())
@settings(max_examples=150, deadline=None)
def test_leading_shapes_are_broadcast_as_numpy_does(shapes, seed, single):
    rng = np.random.default_rng(seed)
    kind = np.float32 if single else np.float64
    a, b, c, d = shapes.input_shapes
    origins = rng.uniform(-1.5, 1.5, (*a, 3)).astype(kind)
    directions = rng.normal(size=(*b, 3)).astype(kind)
    distance, near = rng.uniform(0.5, 3, c).astype(kind), rng.uniform(0, 0.5, d).astype(kind)
    hits = SCENE.intersect(origins, directions, distance, near=near)
    shape = shapes.result_shape
    assert hits.t.shape == shape and hits.uv.shape == (*shape, 2) and hits.point.shape == (*shape, 3)
    flat = [np.ascontiguousarray(np.broadcast_to(x, (*shape, 3))).reshape(-1, 3) for x in (origins, directions)]
    ends = [np.ascontiguousarray(np.broadcast_to(x, shape)).reshape(-1) for x in (distance, near)]
    expected = SCENE.intersect(*flat, ends[0], near=ends[1])
    np.testing.assert_array_equal(hits.t.reshape(-1), expected.t)
    np.testing.assert_array_equal(SCENE.occluded(origins, directions, distance, near=near), hits.hit)


def test_broadcast_views_are_read_once():
    origins = np.broadcast_to(np.float32([0, 0, 5]), (1000, 3))
    directions = np.broadcast_to(np.float32([0, 0, -1]), (10, 100, 3))
    np.testing.assert_array_equal(
        SCENE.occluded(origins.reshape(10, 100, 3), directions), np.full((10, 100), SCENE.occluded([0, 0, 5], [0, 0, -1]))
    )


@pytest.mark.parametrize("kind", [np.int8, np.int32, np.uint16, np.int64, np.float16, bool])
def test_other_numbers_are_converted(kind):
    scene = am.Scene(np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1]], kind), [[0, 1, 2]])
    assert scene.occluded(np.zeros(3, kind), np.array([0, 0, 1], kind), np.array(1, kind))
    np.testing.assert_array_equal(scene.bounds, [[0, 0, 1], [1, 1, 1]])


@pytest.mark.parametrize(
    "call, kind, text",
    [
        (lambda s: s.occluded(np.zeros((5, 2)), [0, 0, 1]), ValueError, r"origins: found shape \(5, 2\), wanted \(\.\.\., 3\)"),
        (lambda s: s.occluded([0, 0, 0], 1.0), ValueError, r"directions: found shape \(\), wanted \(\.\.\., 3\)"),
        (lambda s: s.occluded(np.zeros((5, 3)), np.zeros((4, 3))), ValueError, r"origins \(5, 3\), directions \(4, 3\)"),
        (lambda s: s.occluded(np.zeros((5, 3)), [0, 0, 1], np.ones(4)), ValueError, r"distance \(4,\)"),
        (lambda s: s.intersect(np.zeros((5, 3)), [0, 0, 1], near=np.ones((2, 1, 7))), ValueError, r"near \(2, 1, 7\)"),
        (lambda s: s.occluded([["a", "b", "c"]], [0, 0, 1]), TypeError, "origins: found dtype <U1, wanted real numbers"),
        (lambda s: s.occluded(np.zeros((1, 3), complex), [0, 0, 1]), TypeError, "origins: found dtype complex128"),
        (lambda s: s.occluded([[1, 2, 3], [4, 5]], [0, 0, 1]), TypeError, "origins: no array can be made of it"),
        (lambda s: s.occluded(None, [0, 0, 1]), (TypeError, ValueError), "origins"),
        (lambda s: s.contains(np.zeros((5, 4))), ValueError, r"points: found shape \(5, 4\)"),
        (lambda s: s.closest([0, 0, 0], -1), ValueError, "max_distance: found -1"),
        (lambda s: s.occluded([0, 0, 0], [0, 0, 1], threads=0), ValueError, "threads: found 0"),
        (lambda s: s.occluded([0, 0, 0], [0, 0, 1], progress=3), TypeError, "progress: found int"),
    ],
)
def test_errors_name_argument_found_and_wanted(call, kind, text):
    with pytest.raises(kind, match=text):
        call(SCENE)


@pytest.mark.parametrize(
    "arguments, kind, text",
    [
        (([[0, 0], [1, 1]], [[0, 1, 1]]), ValueError, r"vertices: found shape \(2, 2\)"),
        ((np.zeros((2, 4, 3)), [[0, 1, 1]]), ValueError, r"vertices: found shape \(2, 4, 3\), wanted \(n, 3\)"),
        ((np.zeros((3, 3)), [[0, 1]]), ValueError, r"faces: found shape \(1, 2\), wanted \(m, 3\)"),
        ((np.zeros((3, 3)), [[0.0, 1, 2]]), TypeError, "faces: found dtype float64, wanted integers"),
        ((np.eye(3), [[0, 1, 2], [0, 1, 3]]), IndexError, "faces: row 1 names vertex 3, but there are 3 vertices"),
        ((np.eye(3), [[0, -1, 2]]), IndexError, "faces: row 0 names vertex -1"),
        ((np.eye(3), np.array([[2**63, 1, 2]], np.uint64)), IndexError, "names vertex 9223372036854775808"),
        ((7,), TypeError, "meshes: found int, wanted vertices and faces"),
        (([7],), TypeError, "meshes: item 0 is neither a pair"),
        (([(np.eye(3), [[0, 1, 2]]), (np.eye(3), [[0, 1, 9]])],), IndexError, r"meshes\[1\]: faces: row 0 names vertex 9"),
    ],
)
def test_errors_about_meshes(arguments, kind, text):
    with pytest.raises(kind, match=text):
        am.Scene(*arguments)


def test_triangles_that_cannot_be_hit_are_left_out_with_a_warning():
    vertices = [[0, 0, 1], [1, 0, 1], [0, 1, 1], [np.nan, 0, 0]]
    with pytest.warns(am.DegenerateWarning, match="2 of 3 triangles"):
        scene = am.Scene(vertices, [[0, 1, 2], [0, 0, 1], [0, 1, 3]])
    assert scene.report["dropped"] == 2 and scene.report["triangles"] == 1
    assert scene.occluded([0.2, 0.2, 0], [0, 0, 1])


def test_far_coordinates_keep_their_centimetres():
    far = np.array([4_500_000.0, 5_400_000.0, 120.0])
    vertices, faces = box(far, far + 0.01)
    scene = am.Scene(vertices, faces)
    np.testing.assert_allclose(scene.origin, far + 0.005)
    x = far[0] + np.linspace(-0.0093, 0.0191, 13)
    points = np.stack([x, np.full(13, far[1] + 0.004), np.full(13, far[2] - 1)], -1)
    inside = (x > far[0]) & (x < far[0] + 0.01)
    np.testing.assert_array_equal(scene.occluded(points, [0, 0, 1]), inside)
    hits = scene.intersect(points, [0, 0, 1])
    np.testing.assert_allclose(hits.point[inside, 2], far[2], atol=1e-8)
    np.testing.assert_allclose(scene.bounds, [far, far + 0.01], atol=1e-8)
    assert scene.contains(far + 0.003) and not scene.contains(far - 0.003)
    near = scene.closest(far - [0, 0, 0.02])
    np.testing.assert_allclose(near.distance, 0.02, rtol=1e-5)
    # An origin of one's own, and vertices that are rounded already: all of the box is one point then.
    assert am.Scene(vertices, faces, origin=far).occluded(points[6], [0, 0, 1])
    with pytest.warns(am.DegenerateWarning):
        assert am.Scene(np.float32(vertices), faces).origin == (0, 0, 0)
    with pytest.raises(ValueError, match="origin: found"):
        am.Scene(vertices, faces, origin="middle")
    with pytest.raises(ValueError, match="origin: found shape"):
        am.Scene(vertices, faces, origin=[0, 0])


def test_near_coordinates_stay_as_they_are():
    vertices, faces = soup(np.random.default_rng(0), 10)
    assert am.Scene(vertices.astype(float), faces).origin == (0, 0, 0)
