"""The drop-ins: conventions of trimesh, Open3D and embreex one by one, and all as oracles where they are installed."""

import copy
import pickle
import subprocess
import sys

import antumbra as am
import numpy as np
import pytest
from antumbra.open3d import RaycastingScene
from brute import all_hits, box, closest, first_hits, soup

RNG = np.random.default_rng(13)


@pytest.fixture
def trimesh():
    return pytest.importorskip("trimesh")


def mesh_of(trimesh, vertices, faces):
    return trimesh.Trimesh(vertices, faces, process=False)


def rays(n):
    return RNG.uniform(-1.5, 1.5, (n, 3)), RNG.normal(size=(n, 3))


def test_trimesh_results_have_the_types_and_shapes_of_trimesh(trimesh):
    from antumbra.trimesh import RayMeshIntersector

    mesh = mesh_of(trimesh, *soup(RNG, 100))
    ours = RayMeshIntersector(mesh)
    origins, directions = rays(50)
    locations, index_ray, index_tri = ours.intersects_location(origins, directions)
    assert locations.dtype == np.float64 and locations.shape == (len(index_ray), 3)
    assert index_ray.dtype == index_tri.dtype == np.int64 and index_ray.shape == index_tri.shape
    assert ours.intersects_any(origins, directions).dtype == bool
    first = ours.intersects_first(ray_origins=origins, ray_directions=directions)
    assert first.dtype == np.int64 and first.shape == (50,) and first.min() == -1
    only, of = ours.intersects_id(origins, directions, multiple_hits=False)
    np.testing.assert_array_equal(only, first[first >= 0])
    np.testing.assert_array_equal(of, np.flatnonzero(first >= 0))
    np.testing.assert_array_equal(first >= 0, ours.intersects_any(origins, directions))
    *_, located = ours.intersects_id(origins, directions, multiple_hits=True, max_hits=2, return_locations=True)
    assert np.bincount(ours.intersects_id(origins, directions, max_hits=2)[1]).max() == 2
    assert located.shape[1] == 3
    assert len(ours.intersects_id(origins, directions, max_hits=0)[0]) == 0
    # No rays, and lists instead of arrays.
    assert len(ours.intersects_location(np.zeros((0, 3)), np.zeros((0, 3)))[0]) == 0
    assert ours.intersects_any(origins.tolist(), directions.tolist()).shape == (50,)
    for call in (ours.intersects_any, ours.intersects_first, ours.intersects_id, ours.intersects_location):
        with pytest.raises(ValueError, match="Ray origin and direction don't match!"):
            call(origins, directions[:-1])


def test_trimesh_hits_are_those_of_brute_force(trimesh):
    from antumbra.trimesh import RayMeshIntersector

    vertices, faces = soup(RNG, 60)
    ours = RayMeshIntersector(mesh_of(trimesh, vertices, faces))
    origins, directions = rays(400)
    t, clear = all_hits(vertices, faces, origins, directions)
    index_tri, index_ray, locations = ours.intersects_id(origins, 3 * directions, return_locations=True)
    for ray in np.flatnonzero(clear.all(1)):
        hit = np.flatnonzero(np.isfinite(t[ray]))
        hit = hit[t[ray][hit].argsort()]
        np.testing.assert_array_equal(index_tri[index_ray == ray], hit)
        expected = origins[ray] + t[ray][hit, None] * directions[ray]
        np.testing.assert_allclose(locations[index_ray == ray], expected, atol=1e-9)


def test_hits_are_told_once_where_triangles_meet(trimesh):
    from antumbra.trimesh import RayMeshIntersector

    mesh = trimesh.creation.box().subdivide()
    ours = RayMeshIntersector(mesh)
    # Through vertices and edges of both sides, from outside and from the surface.
    for start in (5, 0.5):
        for x in (0, 0.25):
            triangles, _ = ours.intersects_id([[x, 0, start]], [[0, 0, -1.0]])
            assert len(triangles) == 2


def test_trimesh_contains_is_exact(trimesh):
    from antumbra.trimesh import RayMeshIntersector

    mesh = trimesh.creation.icosphere(3)
    ours = RayMeshIntersector(mesh)
    points = RNG.uniform(-1.2, 1.2, (2000, 3))
    radius = np.linalg.norm(points, axis=1)
    inside = ours.contains_points(points)
    assert inside[radius < 0.98].all() and not inside[radius > 1].any()
    # With a hole, by the heuristic of trimesh.
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    assert not mesh.is_watertight
    assert (ours.contains_points(points) == inside).mean() > 0.9


def test_a_changed_mesh_is_built_again(trimesh):
    from antumbra.trimesh import RayMeshIntersector

    mesh = trimesh.creation.box()
    ours = RayMeshIntersector(mesh)
    assert ours.intersects_any([[0, 0, 5]], [[0, 0, -1]]).all()
    before = ours.scene
    assert ours.scene is before
    mesh.apply_translation([9, 0, 0])
    assert not ours.intersects_any([[0, 0, 5]], [[0, 0, -1]]).any()
    for other in (copy.copy(ours), copy.deepcopy(ours), pickle.loads(pickle.dumps(ours))):
        assert other.intersects_any([[9, 0, 5]], [[0, 0, -1]]).all()


def test_install_takes_over_new_meshes(trimesh, monkeypatch):
    import antumbra.trimesh

    if trimesh.ray.has_embree:
        pyembree = trimesh.ray.ray_pyembree
        monkeypatch.setattr(pyembree, "RayMeshIntersector", pyembree.RayMeshIntersector)
    else:
        monkeypatch.setattr(trimesh.ray, "ray_pyembree", trimesh.ray.ray_pyembree)
        monkeypatch.setattr(trimesh.ray, "has_embree", False)
    antumbra.trimesh.install()
    mesh = trimesh.creation.box()
    assert isinstance(mesh.ray, antumbra.trimesh.RayMeshIntersector)
    assert mesh.contains([[0, 0, 0], [2, 0, 0]]).tolist() == [True, False]
    locations, _, _ = mesh.ray.intersects_location([[0.1, 0.2, 5]], [[0, 0, -1]])
    np.testing.assert_allclose(locations, [[0.1, 0.2, 0.5], [0.1, 0.2, -0.5]])


def test_embreex_agrees_but_for_edges(trimesh):
    pytest.importorskip("embreex")
    from antumbra.trimesh import RayMeshIntersector
    from trimesh.ray.ray_pyembree import RayMeshIntersector as Embree

    vertices, faces = soup(RNG, 2000, 0.3)
    mesh = mesh_of(trimesh, vertices, faces)
    origins, directions = rays(20_000)
    ours, theirs = (kind(mesh).intersects_first(origins, directions) for kind in (RayMeshIntersector, Embree))
    differ = np.flatnonzero(ours != theirs)
    assert len(differ) < 20
    # Each is a ray past an edge, or one that meets two triangles at nearly the same distance.
    t, clear = all_hits(vertices, faces, origins[differ], directions[differ])
    gaps = np.diff(np.sort(t, 1)[:, :2])[:, 0]
    edge = ~_clear_of_edges(vertices, faces, origins[differ], directions[differ])
    assert (edge | ~clear.all(1) | (gaps < 1e-4)).all()


def _clear_of_edges(vertices, faces, origins, directions):
    """Whether the answer stays the same when rays move by what single precision leaves open."""
    moved = [
        first_hits(vertices, faces, origins + 1e-6 * shift, directions)[1]
        for shift in RNG.normal(size=(30, 3))
    ]
    return (np.array(moved) == moved[0]).all(0)


def six(origins, directions, kind=np.float32):
    return np.concatenate([origins, directions], -1).astype(kind)


def test_open3d_conventions():
    vertices, faces = soup(RNG, 80)
    scene = RaycastingScene()
    assert scene.add_triangles(np.float32(vertices), faces.astype(np.uint32)) == 0
    assert scene.add_triangles(*box((5, 0, 0), (6, 1, 1))) == 1
    origins, directions = rays(300)
    batch = six(origins, directions).reshape(3, 100, 6)
    batch[0, 0] = [5.5, 0.5, 9, 0, 0, -2]
    batch[0, 1] = [50, 0, 0, 1, 0, 0]
    found = scene.cast_rays(batch)
    plain = am.Scene([(vertices, faces), box((5, 0, 0), (6, 1, 1))]).intersect(batch[..., :3], batch[..., 3:])
    np.testing.assert_array_equal(found["t_hit"], plain.t)
    assert found["t_hit"].shape == (3, 100) and found["t_hit"].dtype == np.float32
    assert found["geometry_ids"].dtype == found["primitive_ids"].dtype == np.uint32
    assert found["geometry_ids"][0, 0] == 1 and found["t_hit"][0, 0] == 4
    assert found["primitive_normals"].shape == (3, 100, 3) and found["primitive_uvs"].shape == (3, 100, 2)
    np.testing.assert_allclose(found["primitive_normals"][0, 0], [0, 0, 1])
    missed = np.isinf(found["t_hit"])
    assert missed[0, 1] and (found["geometry_ids"][missed] == scene.INVALID_ID).all()
    assert (found["primitive_ids"][missed] == RaycastingScene.INVALID_ID).all()
    assert (found["primitive_normals"][missed] == 0).all() and (found["primitive_uvs"][missed] == 0).all()
    np.testing.assert_array_equal(scene.test_occlusions(batch), ~missed)
    between = scene.scene.occluded(batch[..., :3], batch[..., 3:], 0.5, near=0.1)
    np.testing.assert_array_equal(scene.test_occlusions(batch, tnear=0.1, tfar=0.5), between)
    counts = scene.count_intersections(batch, nthreads=2)
    assert counts.dtype == np.int32 and counts.shape == (3, 100)
    listed = scene.list_intersections(batch)
    np.testing.assert_array_equal(np.diff(listed["ray_splits"]), counts.reshape(-1))
    np.testing.assert_array_equal(listed["ray_ids"], np.repeat(np.arange(300), counts.reshape(-1)))
    assert {*listed} == {"ray_splits", "ray_ids", "t_hit", "geometry_ids", "primitive_ids", "primitive_uvs"}
    # Rays may be float64, and are then those of the rounded ones here.
    np.testing.assert_array_equal(scene.cast_rays(batch.astype(float))["t_hit"], found["t_hit"])
    with pytest.raises(ValueError, match=r"origins: found shape \(4, 5\), wanted \(\.\.\., 6\)"):
        scene.cast_rays(np.zeros((4, 5)))
    with pytest.raises(ValueError, match="device"):
        RaycastingScene(device="CUDA:0")


def test_open3d_points():
    vertices, faces = box()
    scene = RaycastingScene()
    scene.add_triangles(vertices, faces)
    points = RNG.uniform(-2, 2, (5, 40, 3))
    inside = (np.abs(points) < 1).all(-1)
    distance = closest(vertices, faces, points.reshape(-1, 3)).reshape(5, 40)
    np.testing.assert_allclose(scene.compute_distance(points), distance, atol=1e-5)
    np.testing.assert_allclose(scene.compute_signed_distance(points, nsamples=3), np.where(inside, -distance, distance), atol=1e-5)
    np.testing.assert_array_equal(scene.compute_occupancy(points), inside.astype(np.float32))
    near = scene.compute_closest_points(points)
    np.testing.assert_allclose(np.linalg.norm(near["points"] - points, axis=-1), distance, atol=1e-5)
    assert near["primitive_normals"].shape == (5, 40, 3) and near["primitive_ids"].max() < 12
    np.testing.assert_allclose(np.abs(near["primitive_normals"]).sum(-1), 1, atol=1e-6)
    with pytest.raises(ValueError, match="nsamples: found 2"):
        scene.compute_occupancy(points, nsamples=2)


def test_cameras_of_open3d():
    matrix = RaycastingScene.create_rays_pinhole([[5, 0, 2], [0, 5, 1.5], [0, 0, 1]], np.eye(4), 4, 3)
    assert matrix.shape == (3, 4, 6) and matrix.dtype == np.float32
    np.testing.assert_allclose(matrix[0, 0], [0, 0, 0, (0.5 - 2) / 5, (0.5 - 1.5) / 5, 1], atol=1e-6)
    view = RaycastingScene.create_rays_pinhole(fov_deg=60, center=[0, 0, 0], eye=[1, 2, 3], up=[0, 1, 0], width_px=4, height_px=3)
    # What Open3D 0.20 gives.
    np.testing.assert_allclose(view[0, 0], [1, 2, 3, 0.19232568, -0.7784975, -0.7923293], atol=1e-6)
    np.testing.assert_allclose(view[2, 3], [1, 2, 3, -0.7268482, -0.2905475, -0.81123805], atol=1e-6)


def test_open3d_agrees_where_it_is_installed():
    try:
        import open3d
    except Exception:
        pytest.skip("no Open3D")
    tensor = open3d.core.Tensor
    vertices, faces = soup(RNG, 500, 0.5)
    theirs, ours = open3d.t.geometry.RaycastingScene(), RaycastingScene()
    for scene, kind in ((theirs, tensor), (ours, np.asarray)):
        scene.add_triangles(kind(np.float32(vertices)), kind(faces.astype(np.uint32)))
        v, f = box((-0.3, -0.3, -0.3), (0.4, 0.4, 0.4))
        scene.add_triangles(kind(np.float32(v)), kind(f.astype(np.uint32)))
    batch = six(*rays(5000))
    a, b = theirs.cast_rays(tensor(batch)), ours.cast_rays(batch)
    same = a["primitive_ids"].numpy() == b["primitive_ids"]
    assert same.mean() > 0.999
    for name in a:
        x, y = a[name].numpy(), b[name]
        assert x.dtype == y.dtype and x.shape == y.shape, name
        np.testing.assert_allclose(x[same], y[same], rtol=1e-3, atol=2e-4, err_msg=name)
    for call in ("test_occlusions", "count_intersections"):
        x, y = getattr(theirs, call)(tensor(batch)).numpy(), getattr(ours, call)(batch)
        assert x.dtype == y.dtype and (x == y).mean() > 0.995, call
    points = np.float32(RNG.uniform(-1, 1, (500, 3)))
    np.testing.assert_allclose(theirs.compute_distance(tensor(points)).numpy(), ours.compute_distance(points), atol=1e-5)
    x, y = theirs.list_intersections(tensor(batch)), ours.list_intersections(batch)
    assert {*x} == {*y}
    eye = dict(fov_deg=70, center=[0, 0, 0], eye=[3, 2, 1], up=[0, 0, 1], width_px=16, height_px=9)
    np.testing.assert_allclose(
        open3d.t.geometry.RaycastingScene.create_rays_pinhole(**eye).numpy(), RaycastingScene.create_rays_pinhole(**eye), atol=1e-6
    )


def test_open3d_counts_hits_on_edges_once():
    scene = RaycastingScene()
    scene.add_triangles(*box((0, 0, 0), (1, 1, 1)))
    # Through the diagonals of sides, from outside and from the middle; along an edge of the box; past it.
    batch = np.float32([[0.5, 0.5, -1, 0, 0, 1], [0.5, 0.5, 0.5, 0, 0, 1], [0.25, 0.25, -1, 0, 0, 1], [10, 10, 10, 1, 0, 0]])
    np.testing.assert_array_equal(scene.count_intersections(batch), [2, 1, 2, 0])
    listed = scene.list_intersections(batch)
    np.testing.assert_allclose(listed["t_hit"], [1, 2, 0.5, 1, 2])
    np.testing.assert_array_equal(listed["ray_splits"], [0, 2, 3, 5, 5])


def test_open3d_gets_tensors_where_it_gives_them():
    try:
        import open3d
    except Exception:
        pytest.skip("no Open3D")
    tensor = open3d.core.Tensor
    cube = open3d.t.geometry.TriangleMesh.create_box()
    batch, points = np.float32([[0.5, 0.5, -1, 0, 0, 1]]), np.float32([[0.5, 0.5, 0.5]])

    def results(scene, batch, points):
        for name in ("cast_rays", "test_occlusions", "count_intersections", "list_intersections"):
            yield getattr(scene, name)(batch)
        for name in ("compute_closest_points", "compute_distance", "compute_signed_distance", "compute_occupancy"):
            yield getattr(scene, name)(points)

    theirs, mixed, plain = RaycastingScene(), RaycastingScene(), RaycastingScene()
    assert theirs.add_triangles(cube) == 0 and theirs.add_triangles(cube.to_legacy()) == 1
    plain.add_triangles(cube.vertex.positions.numpy(), cube.triangle.indices.numpy())
    mixed.add_triangles(cube.vertex.positions.numpy(), cube.triangle.indices.numpy())
    for scene, kind, wanted in ((theirs, tensor, tensor), (theirs, np.asarray, tensor), (mixed, tensor, tensor), (plain, np.asarray, np.ndarray)):
        for found in results(scene, kind(batch), kind(points)):
            for value in found.values() if isinstance(found, dict) else [found]:
                assert isinstance(value, wanted)
    one = mixed.cast_rays(tensor(batch[0]))
    assert one["t_hit"].shape == () and one["t_hit"].item() == 1
    for a, b in zip(results(mixed, tensor(batch), tensor(points)), results(plain, batch, points)):
        for x, y in zip(a.values(), b.values()) if isinstance(a, dict) else [(a, b)]:
            np.testing.assert_array_equal(x.numpy(), y)
            assert x.numpy().dtype == y.dtype
    rays = RaycastingScene.create_rays_pinhole(tensor(np.eye(3)), tensor(np.eye(4)), 4, 3)
    assert isinstance(rays, tensor) and list(rays.shape) == [3, 4, 6]


def embree_scenes(module, vertices, faces):
    scene = module.rtcore_scene.EmbreeScene()
    module.mesh_construction.TriangleMesh(scene, vertices[faces])
    module.mesh_construction.TriangleMesh(scene, vertices + np.float32(3), faces.astype(np.int32))
    corners = np.float32(box((5, 5, 5), (6, 6, 6))[0][[0, 1, 3, 2, 4, 5, 7, 6]])
    module.mesh_construction.ElementMesh(scene, corners, np.arange(8, dtype=np.int32)[None])
    module.mesh_construction.ElementMesh(scene, corners - np.float32(10), np.int32([[0, 1, 3, 4]]))
    return scene


def test_embreex_conventions():
    import antumbra.embreex

    vertices, faces = soup(RNG, 60)
    scene = embree_scenes(antumbra.embreex, vertices, faces)
    origins, directions = (array.astype(np.float32) for array in rays(500))
    plain = am.Scene(vertices, faces).intersect(origins, directions, 1e37)
    plain_hit = plain.mesh == 0
    first = scene.run(origins, directions)
    assert first.dtype == np.int32 and first.shape == (500,)
    np.testing.assert_array_equal(first[plain_hit], plain.triangle[plain_hit])
    far = scene.run(origins, directions, query="DISTANCE")
    assert far.dtype == np.float32 and (far[first < 0] == np.float32(1e37)).all()
    np.testing.assert_array_equal(far[plain_hit], plain.t[plain_hit])
    np.testing.assert_array_equal(scene.run(origins, directions, query="OCCLUDED"), np.where(first >= 0, 0, -1))
    limits = np.full(500, 0.25, np.float32)
    everything = scene.run(origins, directions, dists=limits, output=1)
    assert {*everything} == {"u", "v", "Ng", "tfar", "primID", "geomID"}
    assert (limits == 0.25).all(), "arrays of the caller are not written to"
    near = everything["geomID"] >= 0
    assert near.any() and not near.all() and (everything["tfar"][~near] == 0.25).all() and (everything["primID"][~near] == -1).all()
    np.testing.assert_array_equal(scene.run(origins, directions, dists=0.25, output=1)["tfar"], everything["tfar"])
    a, b, c = (vertices[faces[everything["primID"][near], k]] for k in range(3))
    np.testing.assert_allclose(everything["Ng"][near], np.cross(b - a, c - a), rtol=1e-5)
    # One direction for all.
    np.testing.assert_array_equal(scene.run(origins, directions[:1]), scene.run(origins, np.repeat(directions[:1], 500, 0)))
    through = scene.run(np.float32([[5.9, 5.2, 0]]), np.float32([[0, 0, 1]]), output=True)
    assert through["geomID"] == 2 and through["primID"] in range(12) and through["tfar"] == 5
    for arguments, text in [
        ((origins, directions, None, "ANY"), "query: found 'ANY', wanted \"INTERSECT\""),
        ((origins, directions, None, "OCCLUDED", 1), "output: found 1 with OCCLUDED"),
        ((origins, directions[:7]), r"vec_directions: found shape \(7, 3\), wanted \(500, 3\) or \(1, 3\)"),
        ((origins[0], directions), r"vec_origins: found shape \(3,\)"),
        ((origins, directions, limits[:4]), r"dists: found shape \(4,\), wanted \(\) or \(500,\)"),
    ]:
        with pytest.raises(ValueError, match=text):
            scene.run(*arguments)
    mesh = antumbra.embreex.mesh_construction
    for call, kind, text in [
        (lambda: mesh.TriangleMesh(scene, vertices), ValueError, "without indices, wanted"),
        (lambda: mesh.TriangleMesh(scene, vertices, [[0, 1, 999]]), IndexError, "indices: found 0 to 999"),
        (lambda: mesh.ElementMesh(scene, vertices, [[0, 1, 2]]), ValueError, r"wanted \(m, 4\) or \(m, 8\)"),
        (lambda: antumbra.embreex.rtcore_scene.EmbreeScene("CPU"), TypeError, "device: found str"),
    ]:
        with pytest.raises(kind, match=text):
            call()


def test_embreex_itself_answers_the_same():
    pytest.importorskip("embreex")
    import antumbra.embreex
    import embreex.mesh_construction
    import embreex.rtcore_scene

    vertices, faces = soup(RNG, 300, 0.8)
    theirs, ours = (embree_scenes(module, vertices, faces) for module in (embreex, antumbra.embreex))
    origins, directions = RNG.uniform(-6, 8, (20_000, 3)).astype(np.float32), RNG.normal(size=(20_000, 3)).astype(np.float32)
    a, b = (scene.run(origins, directions, output=1) for scene in (theirs, ours))
    same = (a["primID"] == b["primID"]) & (a["geomID"] == b["geomID"])
    assert same.mean() > 0.999
    hit = same & (a["geomID"] >= 0)
    assert {*a["geomID"][hit]} == {0, 1, 2, 3}
    for name in a:
        assert a[name].dtype == b[name].dtype and a[name].shape == b[name].shape
        np.testing.assert_allclose(a[name][hit], b[name][hit], rtol=1e-4, atol=1e-4, err_msg=name)
    for options in ({"query": "OCCLUDED"}, {"query": "DISTANCE"}, {"dists": 0.5}):
        x, y = (scene.run(origins, directions, **options) for scene in (theirs, ours))
        assert x.dtype == y.dtype and np.isclose(x, y, rtol=1e-4, atol=1e-4).mean() > 0.999


def test_embreex_is_taken_over():
    program = """
import antumbra.embreex
antumbra.embreex.install()
from embreex import rtcore as rtc, rtcore_scene as rtcs
from embreex.mesh_construction import ElementMesh, TriangleMesh
assert rtcs is antumbra.embreex.rtcore_scene
import numpy as np
scene = rtcs.EmbreeScene(rtc.EmbreeDevice())
TriangleMesh(scene, np.float32([[[0, 0, 1], [1, 0, 1], [0, 1, 1]]]))
assert scene.run(np.float32([[0.2, 0.2, 0]]), np.float32([[0, 0, 1]])) == [0]
"""
    subprocess.run([sys.executable, "-c", program], check=True)
