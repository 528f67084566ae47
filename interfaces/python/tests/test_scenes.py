"""Meshes, instances, points, files and pickles."""

import pickle

import antumbra as am
import numpy as np
import pytest
from brute import box, closest, soup
from hypothesis import given, settings
from hypothesis import strategies as st


def turn(angle, at):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, at[0]], [s, c, 0, at[1]], [0, 0, 1, at[2]], [0, 0, 0, 1]])


def down(points):
    """First hits of rays from high above."""
    above = np.asarray(points, float) + [0, 0, 50]
    return above, np.array([0, 0, -1.0])


def test_meshes_are_numbered_in_the_order_given():
    meshes = [box((x, 0, 0), (x + 1, 1, 1)) for x in (0, 2, 4)]
    for scene in (am.Scene(meshes), am.Scene([am.Mesh(*mesh) for mesh in meshes])):
        hits = scene.intersect([[4.5, 0.4, 9], [0.5, 0.4, 9], [2.5, 0.4, 9], [1.5, 0.4, 9]], [0, 0, -1])
        np.testing.assert_array_equal(hits.mesh, [2, 0, 1, -1])
        np.testing.assert_array_equal(hits.instance, [-1] * 4)


def test_objects_with_vertices_and_faces_are_meshes():
    class Body:
        vertices, faces = box()

    for scene in (am.Scene(Body), am.Scene([Body, box((5, 0, 0), (6, 1, 1))])):
        assert scene.contains([0, 0, 0])


def test_instances_stand_where_their_transforms_say():
    rng = np.random.default_rng(5)
    roof = (np.array([[0, 0, 2.0], [1, 0, 2], [0, 1, 2]]), [[0, 1, 2]])
    ground = (np.array([[-9, -9, 0.0], [9, -9, 0], [0, 9, 0]]), [[0, 1, 2]])
    places = [turn(angle, at) for angle, at in zip(rng.uniform(0, 6, 5), rng.uniform(-5, 5, (5, 3)))]
    instances = [am.Instance(1, places[0]), (1, places[1][:3]), *((1, place) for place in places[2:])]
    scene = am.Scene([ground, roof], instances=instances)
    placed = [np.column_stack([roof[0], np.ones(3)]) @ place[:3].T for place in places]
    flat = am.Scene([ground, *((corners, [[0, 1, 2]]) for corners in placed)])
    origins, up = down(rng.uniform(-6, 6, (4000, 3)))
    a, b = scene.intersect(origins, up), flat.intersect(origins, up)
    same = (a.hit == b.hit) & (np.abs(np.where(a.hit, a.t, 0) - np.where(b.hit, b.t, 0)) < 1e-3)
    assert same.mean() > 0.999, "only rays at edges differ"
    np.testing.assert_array_equal(a.mesh[same], np.minimum(b.mesh, 1)[same])
    np.testing.assert_array_equal(np.where(a.hit, a.instance, -9)[same], np.where(b.hit, b.mesh - 1, -9)[same])
    hit = same & a.hit
    np.testing.assert_allclose(a.point[hit], b.point[hit], atol=2e-4)
    np.testing.assert_allclose(a.normal[hit], b.normal[hit], atol=1e-5)
    assert scene.report["instances"] == 5 and scene.report["triangles"] == 2


def test_instances_far_away_keep_their_centimetres():
    far = np.array([4_500_000.0, 5_400_000.0, 120.0])
    vertices, faces = box(far, far + 0.01)
    # Twice: as it is, and by two metres farther on.
    move = np.eye(4)
    move[0, 3] = 2
    scene = am.Scene([(vertices, faces)], instances=[(0, np.eye(4)), (0, move)])
    points = far + [[0.005, 0.004, -1], [2.005, 0.004, -1], [1.0, 0.004, -1], [2.0101, 0.004, -1]]
    hits = scene.intersect(points, [0, 0, 1])
    np.testing.assert_array_equal(hits.instance, [0, 1, -1, -1])
    np.testing.assert_allclose(hits.point[:2, 2], far[2], atol=1e-6)


@pytest.mark.parametrize(
    "instances, kind, text",
    [
        ([(1, np.eye(4))], IndexError, "item 0 names mesh 1, but there are 1 meshes"),
        ([(-1, np.eye(4))], IndexError, "names mesh -1"),
        ([(0, np.eye(3))], ValueError, r"transform: found shape \(3, 3\)"),
        ([(0, np.ones((4, 4)))], ValueError, r"last row of instance 0"),
        ([0], TypeError, "instances: item 0 is neither"),
    ],
)
def test_errors_about_instances(instances, kind, text):
    with pytest.raises(kind, match=text):
        am.Scene([box()], instances=instances)


def test_an_instance_without_an_inverse_is_left_out():
    with pytest.warns(am.DegenerateWarning):
        scene = am.Scene([box()], instances=[(0, np.diag([1, 1, 0, 1]))])
    assert scene.report["instances"] == 0


def test_points_in_boxes_are_inside():
    rng = np.random.default_rng(6)
    scene = am.Scene([box(), box((0.5, 0.5, 0.5), (3, 2, 2))])
    points = rng.uniform(-3, 4, (10, 200, 3))
    one = (np.abs(points) < 1).all(-1)
    other = ((points > 0.5) & (points < [3, 2, 2])).all(-1)
    for threads in (1, 2):
        np.testing.assert_array_equal(scene.contains(points, threads=threads), one | other)
    assert not scene.contains([np.nan, 0, 0])


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
@settings(max_examples=30, deadline=None)
def test_nearest_points_are_those_of_brute_force(seed, triangles):
    rng = np.random.default_rng(seed)
    vertices, faces = soup(rng, triangles)
    points = rng.uniform(-2, 2, (50, 3)).astype(np.float32)
    found = am.Scene(vertices, faces).closest(points)
    expected = closest(vertices, faces, points)
    np.testing.assert_allclose(found.distance, expected, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(found.point - points, axis=1), expected, rtol=1e-4, atol=1e-5)
    u, v = found.uv.astype(float).T
    a, b, c = (vertices[faces[found.triangle, k]].astype(float) for k in range(3))
    at = (1 - u - v)[:, None] * a + u[:, None] * b + v[:, None] * c
    np.testing.assert_allclose(at, found.point, atol=1e-5)
    limited = am.Scene(vertices, faces).closest(points, np.float32(expected.min() + 1e-3))
    assert np.isfinite(limited.distance).any() and limited.mesh.max() == 0
    none = np.isinf(limited.distance)
    assert (limited.triangle[none] == -1).all() and np.isnan(limited.point[none]).all()


def same_answers(a, b, seed=7):
    rng = np.random.default_rng(seed)
    low, high = a.bounds
    origins, directions = rng.uniform(low - 1, high + 1, (2000, 3)), rng.normal(size=(2000, 3))
    x, y = a.intersect(origins, directions), b.intersect(origins, directions)
    assert x.hit.any()
    for name in ("t", "triangle", "mesh", "instance", "uv", "point", "normal"):
        np.testing.assert_array_equal(getattr(x, name), getattr(y, name), name)


def scenes():
    rng = np.random.default_rng(8)
    yield am.Scene(*soup(rng, 300))
    yield am.Scene(*soup(rng, 300), quality="fast")
    far = soup(rng, 50)
    yield am.Scene(far[0].astype(float) + [1e6, 2e6, 0], far[1])
    yield am.Scene([box(), box((3, 0, 0), (4, 1, 1))], instances=[(1, turn(1, (0, 3, 0))), (1, turn(2, (5, 3, 0)))])


def test_scenes_are_saved_and_pickled_whole(tmp_path):
    for scene in scenes():
        path = tmp_path / "scene.antumbra"
        scene.save(path)
        for other in (am.Scene.load(path), *(pickle.loads(pickle.dumps(scene, p)) for p in range(2, 6))):
            same_answers(scene, other)
            assert other.origin == scene.origin and repr(other) == repr(scene)
            assert other.report == scene.report
            learned = other.learn(np.zeros((100, 3)), np.random.default_rng(9).normal(size=(100, 3)))
            same_answers(scene, learned)


def test_the_bytes_of_a_pickle_may_travel_apart():
    scene = am.Scene(*box())
    buffers = []
    small = pickle.dumps(scene, 5, buffer_callback=buffers.append)
    assert len(small) < 500 and len(buffers) == 1
    same_answers(scene, pickle.loads(small, buffers=buffers))


def test_results_are_pickled():
    scene = am.Scene(*box())
    hits = scene.intersect([[0, 0, 5], [9, 9, 9]], [0, 0, -1])
    hits.point
    for copy in (pickle.loads(pickle.dumps(hits)),):
        np.testing.assert_array_equal(copy.triangle, hits.triangle)
        np.testing.assert_array_equal(copy.point, hits.point)
        with pytest.raises(RuntimeError, match="have no scene"):
            copy.normal
    listed = pickle.loads(pickle.dumps(scene.intersect_all([[0, 0, 5], [9, 9, 9]], [0, 0, -1])))
    np.testing.assert_array_equal(listed.ray, np.repeat([0], len(listed.t)))
    near = pickle.loads(pickle.dumps(scene.closest([0, 0, 5])))
    assert near.distance == 4


def test_damaged_files_are_refused(tmp_path):
    path = tmp_path / "scene"
    am.Scene(*box()).save(path)
    whole = path.read_bytes()
    with pytest.raises(FileNotFoundError):
        am.Scene.load(tmp_path / "none")
    for damaged in (b"", b"AntumPy", whole[:-1], whole[:100], b"x" + whole, whole + b"x", whole[:7] + b"\x63" + whole[8:]):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="cannot read"):
            am.Scene.load(path)
    rng = np.random.default_rng(10)
    for place in rng.integers(0, len(whole), 200):
        bad = bytearray(whole)
        bad[place] ^= 1 << rng.integers(8)
        path.write_bytes(bad)
        with pytest.raises(ValueError, match="cannot read"):
            am.Scene.load(path)


def test_scenes_come_from_files(tmp_path):
    path = tmp_path / "box.obj"
    vertices, faces = box()
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    path.write_text("\n".join(lines))
    same_answers(am.Scene.from_file(path), am.Scene(vertices, faces))
    city = am.Scene.from_file("builtin:city:2000")
    assert city.report["triangles"] >= 2000
    with pytest.raises(FileNotFoundError):
        am.Scene.from_file(tmp_path / "none.ply")
    unknown = tmp_path / "mesh.xyz"
    unknown.write_text("0 0 0")
    with pytest.raises(ValueError, match="xyz"):
        am.Scene.from_file(unknown)


def test_what_is_missing_is_a_warning(tmp_path):
    path = tmp_path / "box.obj"
    path.write_text("mtllib no.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.warns(UserWarning, match=r"box\.obj:1:8: cannot read `no\.mtl`"):
        assert am.Scene.from_file(path).report["triangles"] == 1
    with pytest.warns(UserWarning, match=r"box\.obj:1:8"):
        am.render(path, size=(8, 8), spp=1)


def test_pbrt_files_have_spheres_and_instances(tmp_path):
    path = tmp_path / "scene.pbrt"
    path.write_text(
        """
        Camera "perspective"
        WorldBegin
        Shape "sphere" "float radius" 1
        ObjectBegin "roof"
        Shape "trianglemesh" "point P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2]
        ObjectEnd
        AttributeBegin Translate 5 0 0 ObjectInstance "roof" AttributeEnd
        AttributeBegin Translate 9 0 0 ObjectInstance "roof" AttributeEnd
        WorldEnd
        """
    )
    scene = am.Scene.from_file(path)
    hits = scene.intersect([[0, 0, 5], [5.2, 0.2, 5], [9.2, 0.2, 5], [7, 0, 5]], [0, 0, -1])
    np.testing.assert_allclose(hits.t, [4, 5, 5, np.inf])
    np.testing.assert_array_equal(hits.mesh, [0, 1, 1, -1])
    np.testing.assert_array_equal(hits.instance, [-1, 0, 1, -1])
    np.testing.assert_allclose(hits.point[:3], [[0, 0, 1], [5.2, 0.2, 0], [9.2, 0.2, 0]], atol=1e-6)
    np.testing.assert_allclose(hits.normal[:3], [[0, 0, 1]] * 3, atol=1e-6)
    # Behind the roof stands the sphere. A sphere is told of once.
    both = scene.intersect_all([10, 0.6, 0.1], [-1, 0, 0])
    np.testing.assert_allclose(both.point, [[(1 - 0.36 - 0.01) ** 0.5, 0.6, 0.1]], atol=1e-6)
    np.testing.assert_allclose(both.normal, both.point, atol=1e-6)
    scene.save(tmp_path / "saved")
    same_answers(scene, am.Scene.load(tmp_path / "saved"))


def test_assemblies_are_instances_of_instances():
    rng = np.random.default_rng(5)
    leaf, other = soup(rng, 40), box((-0.1,) * 3, (0.1,) * 3)

    def anywhere(reach):
        matrix = np.eye(4)
        matrix[:3] = np.concatenate([np.eye(3) + 0.3 * rng.normal(size=(3, 3)), reach * rng.normal(size=(3, 1))], 1)
        return matrix

    twig = [(0, anywhere(1)), (1, anywhere(1)), (0, anywhere(1))]
    bough = [(3, anywhere(3)), (0, anywhere(3)), (2, anywhere(3))]
    tree = [(4, anywhere(9)), (2, anywhere(9)), (1, anywhere(9))]
    # An empty assembly has no paths.
    meshes = [leaf, other, am.Assembly(twig), am.Assembly([]), am.Assembly(bough), box((-90, -90, -30), (90, 90, -29))]
    scene = am.Scene(meshes, instances=tree)
    lists = {2: twig, 3: [], 4: bough}

    def flat(placements, outer, path):
        for place, (mesh, matrix) in enumerate(placements):
            here = outer @ matrix
            yield from flat(lists[mesh], here, [*path, place]) if mesh in lists else [(mesh, here, [*path, place])]

    expected = list(flat(tree, np.eye(4), []))
    plain = am.Scene([leaf, other, meshes[5]], instances=[(mesh, matrix) for mesh, matrix, _ in expected])
    assert [[place for place in path if place >= 0] for path in scene.paths.tolist()] == [path for *_, path in expected]
    assert scene.paths.shape == (8, 3)
    origins = rng.uniform(-20, 20, (4000, 3))
    directions = np.stack([matrix[:3, 3] for _, matrix, _ in expected])[rng.integers(0, 8, 4000)] + rng.normal(size=(4000, 3)) - origins
    hits, same = scene.intersect(origins, directions), plain.intersect(origins, directions)
    assert set(hits.instance) == set(range(-1, 8))
    for name in ("t", "triangle", "instance", "point"):
        np.testing.assert_array_equal(getattr(hits, name), getattr(same, name))
    np.testing.assert_array_equal(hits.mesh, np.where(same.mesh == 2, 5, same.mesh))
    again = pickle.loads(pickle.dumps(scene.learn(origins[:500], directions[:500])))
    np.testing.assert_array_equal(again.paths, scene.paths)
    np.testing.assert_array_equal(again.intersect(origins, directions).t, hits.t)
    assert plain.paths.tolist() == [[place] for place in range(8)] and am.Scene([leaf]).paths.shape == (0, 1)


def test_assemblies_on_maps_keep_their_centimetres():
    def at(x, y):
        return np.array([[1, 0, 0, x], [0, 1, 0, y], [0, 0, 1, 0]])

    post = box((0, 0, 0), (0.02, 0.02, 1))
    row = am.Assembly([(0, at(x, 0)) for x in range(3)])
    scene = am.Scene([post, row], instances=[(1, at(4_500_000, 5_400_000)), (1, at(4_500_000, 5_400_010.25))])
    x = 4_500_000 + np.arange(-0.02, 2.1, 0.01)
    found = scene.occluded(np.stack([x, np.full_like(x, 5_400_010.26), np.full_like(x, 9.0)], -1), [0, 0, -1])
    inside = (x - 4_500_000) % 1
    sure = (np.abs(inside) > 0.002) & (np.abs(inside - 0.02) > 0.002) & (inside < 0.998)
    np.testing.assert_array_equal(found[sure], (inside < 0.02)[sure])


def test_assemblies_that_cannot_be_are_refused():
    move = np.eye(4)
    mesh = box()
    with pytest.raises(ValueError, match="object 1 holds an instance of itself"):
        am.Scene([mesh, am.Assembly([(2, move)]), am.Assembly([(1, move)])], instances=[(1, move)])
    with pytest.raises(ValueError, match=r"meshes\[1\]: found an Assembly that nothing places"):
        am.Scene([mesh, am.Assembly([(0, move)])])
    with pytest.raises(ValueError, match=r"meshes\[1\]: found an Assembly that nothing places"):
        am.Scene([mesh, am.Assembly([(0, move), (2, move)]), am.Assembly([(1, move)])])
    with pytest.raises(IndexError, match=r"meshes\[1\]: instances: item 0 names mesh 7, but there are 2 meshes"):
        am.Scene([mesh, am.Assembly([(7, move)])], instances=[(1, move)])
    with pytest.raises(ValueError, match="found a scene or an Assembly that places its meshes itself"):
        am.World([mesh, am.Assembly([(0, move)])], [move], [0])
