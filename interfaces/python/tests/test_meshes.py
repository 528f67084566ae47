"""Meshes of other packages, grids of heights, and the geometry of a scene given back."""

import subprocess
import sys
import warnings

import antumbra as am
import numpy as np
import pytest
from brute import box, soup

RNG = np.random.default_rng(41)


def turn(angle, at):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, at[0]], [s, c, 0, at[1]], [0, 0, 1, at[2]], [0, 0, 0, 1]])


def same(a, b, size=2.0):
    origins, directions = RNG.uniform(-size, size, (3000, 3)), RNG.normal(size=(3000, 3))
    x, y = a.intersect(origins, directions), b.intersect(origins, directions)
    np.testing.assert_array_equal(x.t, y.t)
    np.testing.assert_array_equal(x.triangle, y.triangle)
    np.testing.assert_array_equal(x.mesh, y.mesh)
    assert x.hit.sum() > 20


def install(name):
    try:
        return __import__(name)
    except Exception:
        pytest.skip(f"no {name}")


def test_the_import_is_light():
    program = "import sys, antumbra; print([m for m in ('trimesh', 'open3d', 'pyvista', 'meshio', 'xarray', 'dask') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_meshes_of_trimesh():
    trimesh = install("trimesh")
    mesh = trimesh.creation.icosphere(2)
    same(am.Scene(mesh), am.Scene(mesh.vertices, mesh.faces))
    same(am.Scene([mesh, box()]), am.Scene([(mesh.vertices, mesh.faces), box()]))


def test_scenes_of_trimesh_keep_their_graph():
    trimesh = install("trimesh")
    ball, cube = trimesh.creation.icosphere(2, 0.5), trimesh.creation.box()
    scene = trimesh.Scene()
    places = [turn(0.3, (1, 0, 0)), turn(1.0, (-1, 0.5, 0)), turn(0, (0, -1, 1))]
    scene.add_geometry(ball, node_name="a", geom_name="ball", transform=places[0])
    scene.add_geometry(cube, node_name="b", geom_name="cube", transform=places[1])
    scene.graph.update("c", matrix=places[2], geometry="ball")
    scene.geometry["nowhere"] = trimesh.creation.box(extents=[50, 50, 50])
    ours = am.Scene(scene)
    assert ours.report["instances"] == 3
    origins, directions = RNG.uniform(-2, 2, (3000, 3)), RNG.normal(size=(3000, 3))
    hits = ours.intersect(origins, directions)
    flat = am.Scene([ball.copy().apply_transform(places[0]), cube.copy().apply_transform(places[1]), ball.copy().apply_transform(places[2])])
    expected = flat.intersect(origins, directions)
    assert expected.hit.sum() > 100
    np.testing.assert_allclose(hits.t, expected.t, rtol=1e-4, atol=1e-5)
    nodes = list(scene.graph.nodes_geometry)
    order = {"a": 0, "b": 1, "c": 2}
    expected_nodes = expected.mesh[expected.hit]
    np.testing.assert_array_equal([order[nodes[instance]] for instance in hits.instance[hits.hit]], expected_nodes)
    # Among other meshes, and with something that has no faces.
    scene.add_geometry(trimesh.points.PointCloud(np.zeros((3, 3))), geom_name="dust")
    with pytest.warns(UserWarning, match="without faces, and left out: dust"):
        mixed = am.Scene([box((5, 0, 0), (6, 1, 1)), scene])
    found = mixed.intersect([[5.5, 0.4, 9], [0, -1, 9]], [0, 0, -1])
    assert found.instance[0] == -1 and found.mesh[0] == 0 and found.hit.all() and found.instance[1] >= 0
    with pytest.raises(ValueError, match="instances: found beside a scene"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        am.Scene(scene, instances=[(0, np.eye(4))])


def test_meshes_of_open3d():
    o3d = install("open3d")
    legacy = o3d.geometry.TriangleMesh.create_torus(1, 0.3)
    tensors = o3d.t.geometry.TriangleMesh.from_legacy(legacy)
    expected = am.Scene(np.asarray(legacy.vertices), np.asarray(legacy.triangles))
    same(am.Scene(legacy), expected)
    single = am.Scene(np.asarray(legacy.vertices, np.float32), np.asarray(legacy.triangles))
    same(am.Scene(tensors), single)
    # Tensors are arrays here, and rays as well.
    same(am.Scene(tensors.vertex.positions, tensors.triangle.indices), single)
    rays = RNG.normal(size=(50, 6)).astype(np.float32)
    np.testing.assert_array_equal(single.occluded(o3d.core.Tensor(rays)), single.occluded(rays))
    assert len(am.Scene([legacy, tensors]).faces) == 2 * len(legacy.triangles)
    with pytest.raises(TypeError, match="found open3d.*PointCloud, wanted a TriangleMesh"):
        am.Scene(o3d.geometry.PointCloud())


def test_meshes_of_pyvista():
    pyvista = install("pyvista")
    ball = pyvista.Sphere(theta_resolution=12, phi_resolution=9)
    same(am.Scene(ball), am.Scene(ball.points, ball.regular_faces))
    cube = pyvista.Cube()
    assert not cube.is_all_triangles
    scene = am.Scene(cube)
    assert scene.report["triangles"] == 12 and scene.contains([0, 0, 0]) and not scene.contains([0.6, 0, 0])
    assert am.Scene([cube, ball]).report["triangles"] == 12 + ball.n_cells
    assert am.Scene(ball.strip()).report["triangles"] == ball.n_cells
    with pytest.raises(TypeError, match=r"extract_surface"):
        am.Scene(pyvista.ImageData(dimensions=(3, 3, 3)))
    with pytest.raises(ValueError, match="without polygons"):
        am.Scene(pyvista.PolyData(np.zeros((3, 3))))


def test_meshes_of_meshio():
    meshio = install("meshio")
    points, faces = box()
    same(am.Scene(meshio.Mesh(points, [("triangle", faces)])), am.Scene(points, faces))
    quads = [[0, 2, 3, 1], [4, 5, 7, 6]]
    mixed = meshio.Mesh(points, [("line", [[0, 1]]), ("quad", quads), ("triangle", faces[4:])])
    assert am.Scene(mixed).contains([0.1, 0.2, 0.3])
    np.testing.assert_array_equal(am.Scene(mixed).faces[:4], [[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6]])
    polygon = meshio.Mesh([[0, 0, 1], [2, 0, 1], [3, 1, 1], [2, 2, 1], [0, 2, 1.0]], [("polygon", [[0, 1, 2, 3, 4]])])
    assert am.Scene(polygon).report["triangles"] == 3
    with pytest.raises(ValueError, match="found cells of type 'tetra'"):
        am.Scene(meshio.Mesh(points, [("tetra", [[0, 1, 2, 4]])]))


def test_objects_of_dlpack_are_arrays():
    class Tensor:
        """What only speaks this protocol."""

        def __init__(self, array):
            self.array = array

        def __dlpack__(self, **options):
            return self.array.__dlpack__(**options)

        def __dlpack_device__(self):
            return self.array.__dlpack_device__()

    vertices, faces = box()
    same(am.Scene(Tensor(vertices), Tensor(faces)), am.Scene(vertices, faces))
    assert am.Scene(vertices, faces).contains(Tensor(np.zeros((4, 3)))).all()
    assert am.Scene.from_heights(Tensor(np.zeros((3, 4)))).report["triangles"] == 12


@pytest.mark.parametrize(
    "given, kind, text",
    [
        ("x.ply", TypeError, "meshes: found the path 'x.ply', wanted .*use Scene.from_file to read a file"),
        (["x.ply"], TypeError, "item 0 is neither a pair .*found the path 'x.ply'"),
        (np.eye(3), TypeError, r"faces: found none beside an array of shape \(3, 3\), wanted integers of shape \(m, 3\)"),
        (np.zeros((20, 30)), TypeError, r"found an array of shape \(20, 30\).*Scene.from_heights"),
        (object(), TypeError, "meshes: found object, wanted vertices and faces"),
        ([object()], TypeError, "item 0 is neither a pair .*found object"),
    ],
)
def test_errors_say_what_was_found(given, kind, text):
    with pytest.raises(kind, match=text):
        am.Scene(given)


def down(scene, x, y):
    points = np.stack(np.broadcast_arrays(x, y, 1000.0), -1)
    return scene.intersect(points, [0, 0, -1])


def test_heights_are_a_grid():
    z = RNG.uniform(0, 3, (8, 11))
    scene = am.Scene.from_heights(z)
    assert scene.report["triangles"] == 2 * 7 * 10
    rows, columns = np.mgrid[0:8, 0:11]
    inner = (slice(1, -1), slice(1, -1))
    np.testing.assert_allclose(down(scene, columns[inner], rows[inner]).point[..., 2], z[inner], atol=1e-5)
    # The diagonal runs from the north-western corner of a cell, which is in the row after, to the south-eastern one.
    middle = down(scene, columns[:-1, :-1] + 0.5, rows[:-1, :-1] + 0.5).point[..., 2]
    np.testing.assert_allclose(middle, (z[1:, :-1] + z[:-1, 1:]) / 2, atol=1e-5)
    assert (down(scene, 3.3, 4.4).normal[2] > 0) and (scene.normals[:, 2] > 0).all()
    np.testing.assert_allclose(scene.vertices.reshape(8, 11, 3), np.stack([columns, rows, z], -1), atol=1e-6)


@pytest.mark.parametrize("transform", [(0.5, 2.0), (0.5, -2.0), (-0.5, 2.0)])
def test_heights_have_a_spacing(transform):
    z = RNG.uniform(0, 3, (8, 11))
    scene = am.Scene.from_heights(z, transform)
    dx, dy = transform
    np.testing.assert_allclose(down(scene, 4 * dx, 3 * dy).point[2], z[3, 4], atol=1e-5)
    assert (scene.normals[:, 2] > 0).all(), "normals point up, whichever way rows and columns run"


def test_heights_are_where_the_transform_of_a_raster_says():
    z = RNG.uniform(100, 110, (20, 30)).astype(np.float32)
    # In metres, far away, north up, and turned by 30 degrees.
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    for numbers in ((2.0, 0, 4_500_000.25, 0, -2.0, 5_400_000.5), (2 * c, 2 * s, 4_500_000, 2 * s, -2 * c, 5_400_000)):
        a, b, c_, d, e, f = numbers
        for transform in (numbers, (*numbers, 0, 0, 1), np.array(numbers)):
            scene = am.Scene.from_heights(z, transform)
            column, row = 12 + 0.5, 7 + 0.5
            hit = down(scene, a * column + b * row + c_, d * column + e * row + f)
            np.testing.assert_allclose(hit.point[2], z[7, 12], atol=1e-3)
            assert (scene.normals[:, 2] > 0).all()
    rasterio = pytest.importorskip("rasterio")
    np.testing.assert_array_equal(am.Scene.from_heights(z, rasterio.Affine(*numbers)).vertices, scene.vertices)
    x, y = rasterio.transform.xy(rasterio.Affine(*numbers), 7, 12)
    np.testing.assert_allclose(scene.vertices.reshape(20, 30, 3)[7, 12, :2], [x, y], atol=1e-3)


def test_heights_that_are_not_there_are_holes():
    z = np.zeros((6, 6))
    z[2, 3] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = am.Scene.from_heights(z)
        masked = am.Scene.from_heights(np.ma.masked_equal(np.where(np.isnan(z), -9999, 0).astype(np.int16), -9999))
    # Each of four cells has one triangle left.
    assert scene.report["triangles"] == masked.report["triangles"] == 2 * 25 - 4
    assert not down(scene, 3.0, 2.0).hit and not down(scene, 2.6, 1.8).hit and not down(scene, 2.6, 2.2).hit
    assert down(scene, 2.3, 1.4).hit and down(scene, 2.3, 2.6).hit and down(scene, 1.5, 4.3).hit
    assert am.Scene.from_heights(np.full((3, 3), np.nan)).report["triangles"] == 0


def test_a_raster_has_the_same_triangles_from_a_file_and_from_an_array(tmp_path):
    z = RNG.uniform(0, 3, (30, 40)).round(2)
    z[RNG.uniform(size=z.shape) < 0.1] = np.nan
    rows = "\n".join(" ".join("-9" if np.isnan(x) else str(x) for x in row) for row in z)
    path = tmp_path / "z.asc"
    path.write_text(f"ncols 40\nnrows 30\nxllcorner 100\nyllcorner 50\ncellsize 2\nNODATA_value -9\n{rows}\n")
    loaded = am.Scene.from_file(path)

    def corners(scene):
        return sorted(map(sorted, scene.vertices[scene.faces].round(3).tolist()))

    wanted = corners(loaded)
    assert len(wanted) == loaded.report["triangles"] > 1000
    # From the north, from the south, and mirrored.
    for part, transform in [
        (z, (2, 0, 100, 0, -2, 110)),
        (z[::-1], (2, 0, 100, 0, 2, 50)),
        (z[:, ::-1], (-2, 0, 180, 0, -2, 110)),
    ]:
        assert corners(am.Scene.from_heights(part, transform)) == wanted


def test_heights_of_xarray():
    xarray = install("xarray")
    z = RNG.uniform(0, 3, (5, 7))
    x, y = np.linspace(100, 112, 7), np.linspace(50, 42, 5)
    labelled = xarray.DataArray(z, dims=("y", "x"), coords={"x": x, "y": y})
    scene = am.Scene.from_heights(labelled)
    np.testing.assert_allclose(down(scene, x[3], y[2]).point, [x[3], y[2], z[2, 3]], atol=1e-4)
    for other in (labelled.T, labelled.expand_dims("band")):
        np.testing.assert_array_equal(am.Scene.from_heights(other).vertices, scene.vertices)
    uneven = labelled.isel(x=[0, 1, 4, 6])
    np.testing.assert_allclose(down(am.Scene.from_heights(uneven), x[4], y[2]).point[2], z[2, 4], atol=1e-4)
    for wrong, text in [
        (labelled.rename(x="lon"), "wanted y and x"),
        (labelled.drop_vars("x"), "with coordinates"),
        (xarray.concat([labelled, labelled], "band"), "select one along 'band'"),
    ]:
        with pytest.raises(ValueError, match=text):
            am.Scene.from_heights(wrong)
    with pytest.raises(ValueError, match="transform: found one beside a DataArray"):
        am.Scene.from_heights(labelled, (1, 1))


@pytest.mark.parametrize(
    "heights, transform, kind, text",
    [
        (np.zeros(5), None, ValueError, r"heights: found shape \(5,\), wanted \(rows, columns\)"),
        (np.zeros((1, 5)), None, ValueError, "wanted at least 2 rows and 2 columns"),
        ([["a", "b"], ["c", "d"]], None, TypeError, "heights: found dtype"),
        (np.zeros((4, 5)), (1, 2, 3), ValueError, r"transform: found 3 numbers, wanted \(dx, dy\) or \(a, b, c, d, e, f\)"),
        (np.zeros((4, 5)), (np.nan, 1), ValueError, "wanted finite numbers"),
        (np.zeros((4, 5)), (0, 1), ValueError, "wanted a grid with an area"),
        # In the order of GDAL: it is no area, fortunately.
        (np.zeros((4, 5)), (500.0, 0.0, 0, 900.0, 0, 0), ValueError, "wanted a grid with an area"),
    ],
)
def test_errors_about_heights(heights, transform, kind, text):
    with pytest.raises(kind, match=text):
        am.Scene.from_heights(heights, transform)


def test_a_scene_gives_its_geometry_back(tmp_path):
    meshes = [soup(RNG, 30), box((1, 1, 1), (2, 2, 2))]
    scene = am.Scene(meshes)
    vertices, faces, normals = scene.vertices, scene.faces, scene.normals
    assert vertices.dtype == np.float64 and faces.dtype == np.int64 and normals.dtype == np.float32
    np.testing.assert_allclose(vertices, np.concatenate([mesh[0] for mesh in meshes]), atol=1e-6)
    np.testing.assert_array_equal(faces, np.concatenate([meshes[0][1], meshes[1][1] + 90]))
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    corner = normals[90 + 7]
    assert (corner > 0).all(), "the corner of the box that is farthest out"
    open_sky = scene.ambient_occlusion(vertices, normals, 16)
    assert np.isfinite(open_sky).all()
    # From a file, and at a place far away.
    path = tmp_path / "box.obj"
    v, f = box((4e6, 5e6, 100), (4e6 + 2, 5e6 + 1, 103))
    path.write_text("\n".join([f"v {x} {y} {z}" for x, y, z in v] + [f"f {a} {b} {c}" for a, b, c in f + 1]))
    loaded = am.Scene.from_file(path)
    np.testing.assert_allclose(loaded.vertices, v, atol=1e-3)
    np.testing.assert_array_equal(loaded.faces, f)
    assert len(am.Scene([]).vertices) == len(am.Scene([]).faces) == len(am.Scene([]).normals) == 0


def test_instances_are_given_back_where_they_stand():
    places = [turn(0.5, (3, 0, 0)), np.diag([-1.0, 2, 1, 1])]
    scene = am.Scene([box(), soup(RNG, 5)], instances=[(0, place) for place in places])
    stands = [np.column_stack([box()[0], np.ones(8)]) @ place[:3].T for place in places]
    np.testing.assert_allclose(scene.vertices[15:], np.concatenate(stands), atol=1e-5)
    assert scene.faces.max() == 15 + 16 - 1 and len(scene.faces) == 5 + 24
    flat = am.Scene(scene.vertices, scene.faces)
    origins, directions = RNG.uniform(-4, 4, (2000, 3)), RNG.normal(size=(2000, 3))
    a, b = scene.intersect(origins, directions), flat.intersect(origins, directions)
    assert (np.abs(np.where(a.hit, a.t, 0) - np.where(b.hit, b.t, 0)) < 1e-3).mean() > 0.998
    np.testing.assert_allclose(np.linalg.norm(scene.normals, axis=1), 1, atol=1e-5)
