"""Masks, primitives that are left out, occluders, bounds of points, and worlds whose instances move."""

import pickle
import threading
from concurrent.futures import ThreadPoolExecutor

import antumbra as am
import numpy as np
import pytest
from brute import box, closest, soup

RNG = np.random.default_rng(31)
ROOF = (np.array([[0, 0, 0.0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))


def move(x=0.0, y=0.0, z=0.0):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def panes(*heights):
    return [(ROOF[0] + [0, 0, z], ROOF[1]) for z in heights]


UP = ([0.2, 0.2, 0.0], [0, 0, 1.0])


def test_rays_with_a_mask_see_what_has_a_bit_of_it():
    scene = am.Scene(panes(1, 2, 3), masks=[0b01, 0b11, 0b10])
    first = scene.intersect(*UP, mask=[0b01, 0b10, 0b100, 0b11]).mesh
    np.testing.assert_array_equal(first, [0, 1, -1, 0])
    np.testing.assert_array_equal(scene.occluded(*UP, mask=[1, 4]), [True, False])
    np.testing.assert_array_equal(scene.count(*UP, mask=[[1], [2], [3], [4]]), [[2], [2], [3], [0]])
    np.testing.assert_array_equal(scene.intersect_all(*UP, mask=2).mesh, [1, 2])
    np.testing.assert_array_equal(scene.occluder(*UP, mask=[4, 1]).hit, [False, True])
    assert scene.intersect(*UP).mesh == 0, "a ray without a mask sees all"
    scene.set_masks([4, 2, 1])
    np.testing.assert_array_equal(scene.intersect(*UP, mask=[1, 2, 4]).mesh, [2, 1, 0])
    scene.set_masks(None)
    assert scene.intersect(*UP, mask=8).mesh == 0


def test_masks_of_many_rays_are_those_of_each():
    vertices, faces = soup(RNG, 300)
    scene = am.Scene([(vertices, faces[:150]), (vertices, faces[150:])], masks=np.uint32([1, 2]))
    alone = [am.Scene([(vertices, faces[:150]), (vertices[:0], faces[:0])]), am.Scene([(vertices[:0], faces[:0]), (vertices, faces[150:])])]
    n = 40_000
    origins, directions = RNG.uniform(-1.5, 1.5, (n, 3)), RNG.normal(size=(n, 3))
    mask = RNG.integers(1, 3, n)
    expected = np.where(mask == 1, *(each.intersect(origins, directions).t for each in alone))
    for kind in (np.float32, np.float64):
        o, d = origins.astype(kind), directions.astype(kind)
        for threads in (1, 2):
            found = scene.intersect(o, d, mask=mask, threads=threads)
            if kind is np.float64:
                np.testing.assert_array_equal(found.t, expected)
            np.testing.assert_array_equal(scene.occluded(o, d, mask=mask, threads=threads), found.hit)
    np.testing.assert_array_equal(scene.count(origins, directions, mask=3), scene.count(origins, directions))


def test_masks_go_along():
    scene = am.Scene(panes(1, 2), masks=[1, 2], instances=[(1, move(z=3)), (1, move(z=4))])
    scene.set_masks([1, 6], instances=[2, 4])
    expected = [-1, 0, 1]
    for other in (scene, pickle.loads(pickle.dumps(scene)), scene.learn(np.zeros((50, 3)), [0, 0, 1])):
        np.testing.assert_array_equal(other.intersect(*UP, mask=[1, 2, 4]).instance, expected)


def test_wrong_masks_are_errors():
    scene = am.Scene(panes(1, 2))
    for masks, kind, text in [
        ([1, 2, 3], ValueError, r"masks: found shape \(3,\), wanted \(\) or \(2,\)"),
        ([1.0, 2.0], TypeError, "masks: found dtype float64, wanted integers"),
        ([1, -1], ValueError, "mask: found -1, wanted 0 to 4294967295"),
        ([1, 2**32], ValueError, "wanted 0 to 4294967295"),
    ]:
        with pytest.raises(kind, match=text):
            scene.set_masks(masks)
        with pytest.raises(kind, match=text):
            am.Scene(panes(1, 2), masks=masks)
    for mask in (-1, 2**32, [1, -7]):
        with pytest.raises(ValueError, match="mask: found"):
            scene.occluded(*UP, mask=mask)
    with pytest.raises(TypeError, match="mask: found dtype"):
        scene.occluded(*UP, mask=0.5)
    with pytest.raises(ValueError, match="shapes do not fit: .*mask"):
        scene.occluded(np.zeros((3, 3)), [0, 0, 1], mask=[1, 2])


def test_a_ray_leaves_out_the_triangle_it_starts_on():
    vertices, faces = soup(RNG, 500)
    scene = am.Scene(vertices, faces)
    origins, directions = RNG.uniform(-1.5, 1.5, (20_000, 3)), RNG.normal(size=(20_000, 3))
    first, every = scene.intersect(origins, directions), scene.intersect_all(origins, directions)
    second = np.full(20_000, np.inf, np.float32)
    several = np.diff(every.splits) > 1
    second[several] = every.t[every.splits[:-1][several] + 1]
    forms = [first, first.triangle, (first.triangle, first.mesh), (first.triangle, first.mesh, first.instance), (first.triangle, 0)]
    for exclude in forms:
        np.testing.assert_array_equal(scene.intersect(origins, directions, exclude=exclude).t, second)
    np.testing.assert_array_equal(scene.occluded(origins, directions, exclude=first), several)
    np.testing.assert_array_equal(scene.count(origins, directions, exclude=first), np.maximum(np.diff(every.splits) - 1, 0))
    assert several.any() and not several.all()


def test_what_is_left_out_is_named_by_mesh_and_instance():
    scene = am.Scene([*panes(1), ROOF], instances=[(1, move(z=2)), (1, move(z=3))])
    first = scene.intersect(*UP)
    assert (first.mesh, first.instance) == (0, -1)
    second = scene.intersect(*UP, exclude=first)
    assert (second.mesh, second.instance) == (1, 0)
    assert scene.intersect(*UP, near=1.5, exclude=second).instance == 1
    for exclude, kind, text in [
        ((0, 1), ValueError, "exclude: found mesh 1 with instance -1, wanted an instance of the mesh"),
        ((0, 0, 1), ValueError, "exclude: found mesh 0 with instance 1, wanted -1"),
        ((0, 2), IndexError, "exclude: found mesh 2, but there are 2"),
        ((5, 0), IndexError, "exclude: found triangle 5, but there are 1"),
        ((0, 1, 7), IndexError, "exclude: found instance 7, but there are 2"),
        ((0,), ValueError, "exclude: found a tuple of 1"),
        (0.5, TypeError, r"exclude \(triangle\): found dtype"),
    ]:
        with pytest.raises(kind, match=text):
            scene.occluded(*UP, exclude=exclude)


def test_occluders_are_in_the_way():
    scene = am.Scene(*soup(RNG, 500))
    origins, directions = RNG.uniform(-1.5, 1.5, (300, 70, 3)), RNG.normal(size=(300, 70, 3))
    found = scene.occluder(origins, directions, 1.5)
    np.testing.assert_array_equal(found.hit, scene.occluded(origins, directions, 1.5))
    assert found.triangle.dtype == np.int32 and found.triangle.shape == (300, 70)
    every = scene.intersect_all(origins, directions, 1.5)
    pairs = set(zip(every.ray.tolist(), every.triangle.tolist()))
    rays = np.flatnonzero(found.hit)
    assert all(pair in pairs for pair in zip(rays.tolist(), found.triangle[found.hit].tolist()))
    assert (found.mesh[~found.hit] == -1).all() and (found.instance == -1).all()


def test_points_have_bounds_of_their_own():
    vertices, faces = soup(RNG, 200)
    scene = am.Scene(vertices, faces)
    points = RNG.uniform(-2, 2, (5, 4000, 3)).astype(np.float32)
    all_of_them = scene.closest(points).distance
    limits = RNG.uniform(0, 2 * all_of_them.mean(), (5, 4000)).astype(np.float32)
    found = scene.closest(points, limits, threads=1)
    np.testing.assert_array_equal(found.distance, np.where(all_of_them <= limits, all_of_them, np.inf))
    assert 0 < found.hit.mean() < 1
    np.testing.assert_array_equal(scene.closest(points, limits[:1]).hit, all_of_them <= limits[:1])
    for wrong in (-1.0, [[np.nan]]):
        with pytest.raises(ValueError, match="max_distance: found"):
            scene.closest(points, wrong)
    with pytest.raises(ValueError, match="shapes do not fit"):
        scene.closest(points, np.ones(3))
    with pytest.raises(ValueError, match=r"max_distance: found shape \(2, 1, 1\)"):
        scene.closest(points, np.ones((2, 1, 1)))


def test_signed_distances_are_negative_inside():
    scene = am.Scene(*box())
    points = RNG.uniform(-2, 2, (3, 500, 3))
    inside = (np.abs(points) < 1).all(-1)
    distance = closest(*box(), points.reshape(-1, 3)).reshape(3, 500)
    found = scene.signed_distance(points)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, np.where(inside, -distance, distance), atol=1e-5)


def test_hits_on_an_edge_are_one_where_that_is_wanted():
    scene = am.Scene(*box())
    middle = ([0, 0, 5.0], [0, 0, -1.0])
    assert scene.count(*middle) == 4 and scene.count(*middle, distinct=True) == 2
    np.testing.assert_allclose(scene.intersect_all(*middle, distinct=True).t, [4, 6])
    np.testing.assert_allclose(scene.intersect_all(*middle, distinct=True, max_hits=1).t, [4])
    # A thin plate has two sides, however thin it is; so have two boxes that touch.
    plate = am.Scene(*box((-1, -1, 0), (1, 1, 1e-7)))
    assert plate.count(*middle, distinct=True) == 2
    touching = am.Scene([box(), box((-1, -1, 1), (1, 1, 2))])
    assert touching.count(*middle, distinct=True) == 4
    # In a closed body every ray goes out as often as it goes in, also through edges and vertices.
    vertices, faces = box((-1.25, -0.5, -1), (0.5, 1, 1.5))
    body = am.Scene(vertices, faces)
    targets = np.concatenate([vertices, (vertices[faces[:, 0]] + vertices[faces[:, 1]]) / 2, vertices[faces].mean(1)])
    origins = np.array([[5, 4, 3.0], [-3, 6, 2], [0.125, 0.25, 9], [7, 0.25, 0.25]])[:, None]
    counts = body.count(origins, targets - origins, distinct=True)
    assert (counts % 2 == 0).all() and (counts > 0).any()


def flat(meshes, placed):
    return am.Scene([(np.column_stack([meshes[mesh][0], np.ones(len(meshes[mesh][0]))]) @ matrix[:3].T, meshes[mesh][1]) for mesh, matrix in placed])


def same(world, scene, rays=3000):
    origins, directions = RNG.uniform(-6, 6, (rays, 3)), RNG.normal(size=(rays, 3))
    a, b = world.intersect(origins, directions), scene.intersect(origins, directions)
    near = np.abs(np.where(a.hit, a.t, 0) - np.where(b.hit, b.t, 0)) < 1e-3
    assert ((a.hit == b.hit) & near).mean() > 0.998, "only rays at edges differ"
    hit = a.hit & b.hit & near
    assert hit.sum() > 20
    np.testing.assert_allclose(a.point[hit], b.point[hit], atol=1e-3)


def test_instances_of_a_world_move():
    meshes = [soup(RNG, 40), box()]
    world = am.World(meshes, [move(1), move(-2, 1)], [0, 1])
    same(world, flat(meshes, [(0, move(1)), (1, move(-2, 1))]))
    assert world.report["instances"] == 2 and repr(world) == "<antumbra.World: 2 meshes, 52 triangles, 2 instances>"
    for k in (1, 5, 200, 3):
        matrices, objects = np.stack([move(*RNG.uniform(-5, 5, 3)) for _ in range(k)]), RNG.integers(0, 2, k)
        world.set_instances(matrices[:, :3] if k == 5 else matrices, objects)
        same(world, flat(meshes, list(zip(objects, matrices))))
        np.testing.assert_allclose(world.transforms, matrices[:, :3], atol=1e-6)
        np.testing.assert_array_equal(world.objects, objects)
    # Objects stay where only transforms are new.
    world.set_instances(matrices + move(0.5) - np.eye(4))
    np.testing.assert_array_equal(world.objects, objects)
    world.set_instances(np.zeros((0, 4, 4)))
    assert not world.occluded([0, 0, 0], [0, 0, 1]) and np.isnan(world.bounds).all()


def test_the_ground_of_a_world_stays():
    ground = box((-6, -6, -3), (6, 6, -2))
    world = am.World([box()], [move(0)], ground=ground)
    hits = world.intersect([[0, 0, 9], [4, 4, 9.0]], [0, 0, -1])
    np.testing.assert_array_equal(hits.mesh, [0, 1])
    np.testing.assert_array_equal(hits.instance, [0, -1])
    world.set_instances([move(4, 4, 1)])
    np.testing.assert_allclose(world.intersect([[0, 0, 9], [4, 4, 9.0]], [0, 0, -1]).t, [11, 7])


def test_hits_keep_the_world_as_it_was():
    world = am.World([box()], [move()])
    hits = world.intersect([0.2, 0.1, 5], [0, 0, -1])
    world.set_instances([move(z=9)])
    world.refit({0: box()[0] * 2})
    np.testing.assert_allclose(hits.point, [0.2, 0.1, 1], atol=1e-6)


def test_vertices_of_a_world_move():
    (vertices, faces), ground = box(), box((-6, -6, -3), (6, 6, -2))
    world = am.World([box(), ROOF], [move(2), move(-2)], [0, 0], ground=[ground])
    world.refit({0: vertices * 0.5, 2: ground[0] + [0, 0, 1]})
    same(world, flat([(vertices * 0.5, faces), (ground[0] + [0, 0, 1], ground[1])], [(0, move(2)), (0, move(-2)), (1, move())]))
    np.testing.assert_allclose(world.vertices[:8], ground[0] + [0, 0, 1])
    for given, kind, text in [
        ({3: vertices}, IndexError, "vertices: found mesh 3, but there are 3 meshes"),
        ({0: vertices[:5]}, ValueError, r"vertices: found shape \(5, 3\), wanted \(8, 3\)"),
        ({1: np.zeros((3, 3))}, ValueError, ""),
    ]:
        with pytest.raises(kind, match=text):
            world.refit(given)
    same(world, flat([(vertices * 0.5, faces), (ground[0] + [0, 0, 1], ground[1])], [(0, move(2)), (0, move(-2)), (1, move())]))


def test_worlds_learn_again_and_answer_the_same():
    world = am.World([soup(RNG, 2000, 0.3)], [move(*RNG.uniform(-3, 3, 3)) for _ in range(30)])
    origins, directions = RNG.uniform(-4, 4, (5000, 3)), RNG.normal(size=(5000, 3))
    before = world.intersect(origins, directions)
    world.relearn(origins[:1000], directions[:1000])
    after = world.intersect(origins, directions)
    for name in ("t", "triangle", "mesh", "instance"):
        np.testing.assert_array_equal(getattr(before, name), getattr(after, name))


def test_an_order_is_learned_beside_the_frames_and_adopted_between_them():
    objects = [soup(RNG, 3000, 0.1), box((-0.2,) * 3, (0.2,) * 3)]
    places = [move(*RNG.uniform(-3, 3, 3)) for _ in range(40)]
    world = am.World(objects, places, np.arange(40) % 2)
    copy = pickle.loads(pickle.dumps(world))
    origins, directions = RNG.uniform(-4, 4, (20000, 3)), RNG.normal(size=(20000, 3))
    before = world.intersect(origins, directions)
    with ThreadPoolExecutor(1) as pool:
        learning = pool.submit(world.relearn, origins[:5000], directions[:5000], adopt=False)
        frames = 0
        while not learning.done() or frames == 0:
            world.set_instances(places)
            np.testing.assert_array_equal(world.intersect(origins, directions).t, before.t)
            frames += 1
    order = learning.result()
    assert type(order) is am.ChildOrder
    unlearned = world_bytes(world)
    # Learning by itself changes nothing, and adopting changes the tree.
    assert unlearned == world_bytes(copy)
    for other in (world, copy):
        other.adopt(order)
        assert world_bytes(other) != unlearned
        for _ in range(2):
            after = other.intersect(origins, directions)
            for name in ("t", "triangle", "mesh", "instance"):
                np.testing.assert_array_equal(getattr(before, name), getattr(after, name))
            other.set_instances(places)
    assert world_bytes(world) == world_bytes(copy)
    # With adopt, relearn does both.
    third = am.World(objects, places, np.arange(40) % 2)
    third.relearn(origins[:5000], directions[:5000])
    third.set_instances(places)
    assert world_bytes(third) == world_bytes(world)
    # The order of another world does no harm.
    am.World([box()], [move()]).adopt(order)
    with pytest.raises(TypeError, match="order"):
        world.adopt(None)


def world_bytes(world):
    """The world with its tree, as pickle keeps it."""
    return world.__reduce__()[1][0].tobytes()


def test_worlds_are_kept(tmp_path):
    world = am.World([box(), soup(RNG, 50)], [move(1), move(-2)], [0, 1], ground=box((-6, -6, -3), (6, 6, -2)))
    world.set_masks([1, 2, 4], instances=[3, 2])
    world.save(tmp_path / "world")
    for other in (am.World.load(tmp_path / "world"), pickle.loads(pickle.dumps(world))):
        assert type(other) is am.World
        np.testing.assert_array_equal(other.transforms, world.transforms)
        origins, directions = RNG.uniform(-6, 6, (500, 3)), RNG.normal(size=(500, 3))
        for mask in (1, 2, 4):
            np.testing.assert_array_equal(other.intersect(origins, directions, mask=mask).t, world.intersect(origins, directions, mask=mask).t)
        other.set_instances([move(5)], 0)
        assert other.intersect([5, 0, 9], [0, 0, -1]).t == 8
    with pytest.raises(ValueError, match="use World.load"):
        am.Scene.load(tmp_path / "world")
    am.Scene(*box()).save(tmp_path / "scene")
    with pytest.raises(ValueError, match="use Scene.load"):
        am.World.load(tmp_path / "scene")


def test_worlds_on_maps_keep_their_centimetres():
    far = np.array([4_500_000.0, 5_400_000.0, 120.0])
    vertices, faces = box(far, far + 0.01)
    world = am.World([(vertices, faces)], [np.eye(4), move(2)])
    points = far + [[0.005, 0.004, -1], [2.005, 0.004, -1], [1.005, 0.004, -1], [2.0101, 0.004, -1]]
    np.testing.assert_array_equal(world.intersect(points, [0, 0, 1]).instance, [0, 1, -1, -1])
    world.set_instances([move(2), move(1)])
    np.testing.assert_array_equal(world.intersect(points, [0, 0, 1]).instance, [-1, 0, 1, -1])
    np.testing.assert_allclose(world.vertices[:8], vertices + [2, 0, 0], atol=1e-6)
    np.testing.assert_allclose(world.transforms[1], move(1)[:3], atol=1e-6)


@pytest.mark.parametrize(
    "arguments, kind, text",
    [
        (([move()[:2]],), ValueError, r"transforms: found shape \(1, 2, 4\), wanted \(k, 4, 4\) or \(k, 3, 4\)"),
        ((np.eye(4),), ValueError, r"transforms: found shape \(4, 4\)"),
        (([np.ones((4, 4))], 0), ValueError, "transforms: the last row of instance 0 is"),
        (([move()] * 3,), ValueError, "objects: found none, wanted which of 2 meshes each of 3 instances places"),
        (([move()], [2]), IndexError, "objects: instance 0 names mesh 2, but there are 2 meshes"),
        (([move()], [-1]), IndexError, "objects: instance 0 names mesh -1"),
        (([move()], [0, 1]), ValueError, r"objects: found shape \(2,\), wanted \(\) or \(1,\)"),
        (([move()], [0.0]), TypeError, "objects: found dtype"),
    ],
)
def test_errors_about_instances_of_a_world(arguments, kind, text):
    world = am.World([box(), ROOF], [move()], [1])
    for call in (world.set_instances, lambda *given: am.World([box(), ROOF], *given)):
        with pytest.raises(kind, match=text):
            call(*arguments)
    np.testing.assert_array_equal(world.objects, [1])
    with pytest.raises(ValueError, match="transforms: found none beside objects"):
        am.World([box()], None, [0])


def test_a_world_may_move_while_others_ask():
    world = am.World([soup(RNG, 300)], [move()])
    origins, directions = RNG.uniform(-1.5, 1.5, (30_000, 3)), RNG.normal(size=(30_000, 3))
    at = [world.occluded(origins, directions)]
    world.set_instances([move(0.5)])
    at.append(world.occluded(origins, directions))
    found, stop = [], threading.Event()

    def ask():
        while not stop.is_set():
            found.append(world.occluded(origins, directions, threads=1))

    threads = [threading.Thread(target=ask) for _ in range(2)]
    for thread in threads:
        thread.start()
    step = 0
    while step < 60 or len(found) < 3:
        world.set_instances([move(0.5 * (step % 2))])
        if step % 20 == 0:
            world.relearn(origins[:200], directions[:200])
        step += 1
    stop.set()
    for thread in threads:
        thread.join()
    # Each answer is of one place or the other, never of both.
    assert all((each == at[0]).all() or (each == at[1]).all() for each in found)
