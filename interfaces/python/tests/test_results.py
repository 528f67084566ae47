"""Results are at home in numpy: arrays, indices, tables, and what notebooks show."""

import gc
import sys
import weakref
from html.parser import HTMLParser

import antumbra as am
import numpy as np
import pytest
from brute import box, soup

RNG = np.random.default_rng(21)
SCENE = am.Scene(*soup(RNG, 200, 2.0))
ORIGINS, DIRECTIONS = RNG.uniform(-1.5, 1.5, (6, 7, 3)), RNG.normal(size=(6, 7, 3))
HITS = SCENE.intersect(ORIGINS, DIRECTIONS)
NAMES = ("t", "triangle", "mesh", "instance", "uv", "hit", "point", "normal")


def matrix(rows, columns):
    answers = RNG.random((rows, columns)) < 0.4
    words = np.zeros((rows, -(-columns // 64) * 64), bool)
    words[:, :columns] = answers
    words = np.packbits(words.reshape(-1), bitorder="little").view(np.uint64)
    return am.BitMatrix(words.reshape(rows, -(-columns // 64)), columns), answers


def test_hits_are_several_arrays():
    hits = am.Scene([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]]).intersect([0.2, 0.2, 0], [0, 0, 1])
    with pytest.raises(TypeError, match="hits.t, hits.point"):
        np.asarray(hits)


@pytest.mark.parametrize("shape", [(5, 70), (3, 64), (4, 1), (1, 200), (0, 5), (5, 0)])
def test_bits_are_a_bool_array(shape):
    bits, answers = matrix(*shape)
    array = np.asarray(bits)
    assert array.dtype == bool and array.shape == shape
    np.testing.assert_array_equal(array, answers)
    np.testing.assert_array_equal(np.array(bits, dtype=np.float32), answers.astype(np.float32))
    assert np.stack([bits, bits]).shape == (2, *shape)
    with pytest.raises(ValueError, match="copy: found False"):
        bits.__array__(copy=False)
    np.testing.assert_array_equal(np.asarray(bits.T), answers.T)
    np.testing.assert_array_equal(np.asarray(~bits), ~answers)
    assert (~bits).count() == (~answers).sum(), "bits behind the last column stay 0"
    other, more = matrix(*shape)
    np.testing.assert_array_equal(np.asarray(bits & other), answers & more)
    np.testing.assert_array_equal(np.asarray(bits | other), answers | more)
    np.testing.assert_array_equal(np.asarray(bits ^ other), answers ^ more)
    for both in (bits & more, more & bits):
        assert isinstance(both, np.ndarray)
        np.testing.assert_array_equal(both, answers & more)


def test_bits_are_saved_as_bool(tmp_path):
    bits, answers = matrix(5, 70)
    np.save(tmp_path / "bits.npy", bits)
    np.testing.assert_array_equal(np.load(tmp_path / "bits.npy"), answers)


INDICES = [
    3, -1, slice(1, 4), slice(None, None, -2), (2, 5), (-1, -1), (slice(None), 3), (slice(1, 4), -2), (slice(None), slice(2, 60)),
    [0, 2, 2], np.array([[1, 3], [0, 4]]), np.array([True, False, True, True, False]), (Ellipsis, 7), ([0, 1], [65, 2]),
    (2, slice(3, 9)), np.int64(2), (slice(None), [1, 69]), np.array([], int),
]  # fmt: skip


@pytest.mark.parametrize("index", INDICES, ids=repr)
def test_indices_of_bits_are_those_of_an_array(index):
    bits, answers = matrix(5, 70)
    found = bits[index]
    np.testing.assert_array_equal(found, answers[index])
    assert np.shape(found) == np.shape(answers[index]) and np.asarray(found).dtype == bool


def test_wrong_indices_and_shapes_of_bits_are_errors():
    bits, _ = matrix(5, 70)
    for index in (5, (0, 70), (slice(None), 70), [7], np.zeros(4, bool)):
        with pytest.raises(IndexError):
            bits[index]
    with pytest.raises(ValueError, match=r"&: found matrices of shapes \(5, 70\) and \(5, 71\), wanted one shape"):
        bits & matrix(5, 71)[0]
    with pytest.raises(TypeError):
        bits & "text"


def test_pictures_are_arrays_and_show_themselves(tmp_path):
    image = pytest.importorskip("PIL.Image")
    linear = am.Picture(RNG.random((4, 5, 3)))
    assert np.asarray(linear).shape == (4, 5, 3) and np.asarray(linear) is linear.pixels
    assert np.array(linear) is not linear.pixels
    assert np.asarray(linear, dtype=np.float64).dtype == np.float64
    with pytest.raises(ValueError, match="copy"):
        linear.__array__(np.float64, copy=False)
    shown = am.heat_map(RNG.random((4, 5)), legend=False)
    for picture in (linear, shown):
        picture.save(tmp_path / "saved.png")
        (tmp_path / "shown.png").write_bytes(picture._repr_png_())
        a, b = (np.asarray(image.open(tmp_path / name)) for name in ("saved.png", "shown.png"))
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    "index",
    [0, -1, slice(2, 5), slice(None, None, -1), (1, 2), (slice(None), 3), [0, 0, 4], HITS.hit, (Ellipsis, 2), np.array([[1], [2]]), (None, 2)],
    ids=lambda index: "mask" if isinstance(index, np.ndarray) and index.dtype == bool else repr(index),
)
def test_indices_of_hits_choose_in_every_array(index):
    chosen = HITS[index]
    assert type(chosen) is am.Hits
    for name in NAMES:
        array = getattr(HITS, name)
        # The last axis of vectors is no axis of the hits.
        expected = array[..., 2, :] if isinstance(index, tuple) and index[0] is Ellipsis and array.ndim == 3 else array[index]
        np.testing.assert_array_equal(getattr(chosen, name), expected, name)
    assert chosen.shape == HITS.t[index].shape


def test_hits_are_a_sequence():
    assert len(HITS) == 6 and HITS.hit.any()
    assert [hits.shape for hits in HITS] == [(7,)] * 6
    one = SCENE.intersect(ORIGINS[0, 0], DIRECTIONS[0, 0])
    with pytest.raises(TypeError, match="one hit has no length"):
        len(one)
    with pytest.raises(IndexError):
        HITS[6]
    near = SCENE.closest(ORIGINS)
    chosen = near[2:4, 1]
    assert type(chosen) is am.Closest
    for name in (*NAMES, "distance"):
        np.testing.assert_array_equal(getattr(chosen, name), getattr(near, name)[2:4, 1], name)


def test_chosen_hits_on_spheres_keep_their_rays(tmp_path):
    path = tmp_path / "scene.pbrt"
    path.write_text('Camera "perspective"\nWorldBegin\nShape "sphere" "float radius" 1\nWorldEnd\n')
    hits = am.Scene.from_file(path).intersect([[0, 0, 5], [0.6, 0, 5], [9, 0, 5]], [0, 0, -1])
    np.testing.assert_allclose(hits[1].point, [0.6, 0, 0.8], atol=1e-6)
    np.testing.assert_allclose(hits[[1, 0]].normal, [[0.6, 0, 0.8], [0, 0, 1]], atol=1e-6)


def test_lists_of_hits_are_lists_of_rays():
    hits = SCENE.intersect_all(ORIGINS, DIRECTIONS)
    assert len(hits) == 42 == len(list(hits))
    assert len(hits.t) > 42
    for ray in (0, 17, -1):
        own = hits[ray]
        assert type(own) is am.Hits
        first, last = hits.splits[ray % 42], hits.splits[ray % 42 + 1]
        for name in NAMES:
            np.testing.assert_array_equal(getattr(own, name), getattr(hits, name)[first:last], name)
    with pytest.raises(IndexError, match="ray 42 of hits of 42 rays"):
        hits[42]
    with pytest.raises(TypeError, match="index: found slice, wanted the number of one ray"):
        hits[1:2]


def test_tables_have_a_row_for_every_hit():
    table = HITS.to_dict(point=True, normal=True)
    assert list(table) == ["t", "triangle", "mesh", "instance", "u", "v", "x", "y", "z", "nx", "ny", "nz"]
    assert all(column.shape == (42,) for column in table.values())
    np.testing.assert_array_equal(table["y"], HITS.point[..., 1].reshape(-1))
    np.testing.assert_array_equal(table["nz"], HITS.normal[..., 2].reshape(-1))
    np.testing.assert_array_equal(table["v"], HITS.uv[..., 1].reshape(-1))
    assert list(HITS.to_dict()) == list(table)[:6]
    every = SCENE.intersect_all(ORIGINS, DIRECTIONS)
    assert list(every.to_dict()) == ["ray", *list(table)[:6]]
    np.testing.assert_array_equal(every.to_dict()["ray"], every.ray)
    assert "distance" in SCENE.closest(ORIGINS).to_dict()


class Reader(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.open, self.cells = [], []
        self.feed(text)
        assert not self.open, "all elements are closed"

    def handle_starttag(self, tag, _):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.cells.append(data)


def test_notebooks_show_tables():
    bits, answers = matrix(5, 70)
    share = f"{answers.sum()} ({100 * answers.mean():.1f} %)"
    assert Reader(bits._repr_html_()).cells[:5] == ["antumbra.BitMatrix", "shape", "(5, 70)", "ones", share]
    cells = Reader(HITS._repr_html_()).cells
    assert cells[0] == "antumbra.Hits" and cells[-1].startswith(f"{HITS.hit.sum()} of 42 rays")
    assert "200" in Reader(SCENE._repr_html_()).cells
    assert "42" in Reader(SCENE.intersect_all(ORIGINS, DIRECTIONS)._repr_html_()).cells
    assert "points" in Reader(SCENE.closest(ORIGINS)._repr_html_()).cells[-1]
    assert "rows" in repr(bits) and f"{HITS.hit.sum()} of 42" in repr(HITS) and "200 triangles" in repr(SCENE)
    for empty in (am.Scene([]), am.Scene([]).intersect(np.zeros((0, 3)), [0, 0, 1]), matrix(0, 0)[0]):
        Reader(empty._repr_html_())


def test_sizes_are_those_of_the_memory():
    small, large = am.Scene(*soup(RNG, 1000)), am.Scene(*soup(RNG, 100_000))
    for scene in (small, large):
        own = scene.report["bytes"] + 36 * scene.report["triangles"] + 12 * scene.report["triangles"]
        assert own <= sys.getsizeof(scene) < 1.1 * own + 10_000
    assert sys.getsizeof(matrix(1000, 6400)[0]) >= 800_000
    hits = large.intersect(np.zeros((10_000, 3)), [0, 0, 1])
    before = sys.getsizeof(hits)
    assert before >= 240_000
    hits.point
    assert sys.getsizeof(hits) == before + 240_000
    try:
        from dask.sizeof import sizeof
    except ImportError:
        return
    assert sizeof(large) == sys.getsizeof(large)


def test_weak_references_do_not_keep_objects():
    world = am.World([box()], [np.eye(4)])
    things = [am.Scene(*box()), world, SCENE.intersect(ORIGINS, DIRECTIONS), SCENE.closest(ORIGINS), matrix(2, 2)[0], am.heat_map([[1.0]])]
    references = [weakref.ref(thing) for thing in things]
    assert all(reference() is thing for reference, thing in zip(references, things))
    del things, world
    gc.collect()
    assert not any(reference() is not None for reference in references)


def test_answers_go_into_arrays_of_the_caller():
    expected = SCENE.occluded(ORIGINS, DIRECTIONS)
    out = ~expected
    assert SCENE.occluded(ORIGINS, DIRECTIONS, out=out) is out
    np.testing.assert_array_equal(out, expected)
    part = np.zeros((9, 6, 7), bool)
    SCENE.occluded(ORIGINS, DIRECTIONS, out=part[4])
    np.testing.assert_array_equal(part[4], expected)
    assert not part[5].any()
    seen = SCENE.visible(ORIGINS, [0, 0, 0])
    assert SCENE.visible(ORIGINS, [0, 0, 0], out=out) is out
    np.testing.assert_array_equal(out, seen)
    one = np.zeros((), bool)
    assert SCENE.occluded([0, 0, 0], [0, 0, 1], out=one) is one
    frozen = np.zeros((6, 7), bool)
    frozen.setflags(write=False)
    for wrong, found in [
        (np.zeros((6, 7), np.uint8), "dtype"),
        (np.zeros((7, 6), bool), r"shape \(7, 6\)"),
        (np.zeros((7, 6), bool).T, "another order"),
        (frozen, ""),
        ([False], "list"),
    ]:
        with pytest.raises(ValueError, match=f"out: found {found}.*wanted a writeable array of bool of shape \\(6, 7\\)"):
            SCENE.occluded(ORIGINS, DIRECTIONS, out=wrong)


def test_large_answers_need_no_copy():
    out = np.zeros(300_000, bool)
    origins = RNG.uniform(-1.5, 1.5, (300_000, 3)).astype(np.float32)
    SCENE.occluded(origins, [0, 0, 1], out=out, threads=2)
    np.testing.assert_array_equal(out, SCENE.occluded(origins, [0, 0, 1]))


def test_a_map_is_written_in_three_formats_and_drawn_by_matplotlib(tmp_path):
    values = np.linspace(0, 12, 600).reshape(20, 30)
    values[3, 4] = np.nan
    heights = np.zeros((40, 60))
    heights[10:20, 10:30] = 9.0
    found = am.Map(values, 2.0, title="A court & a wall", quantity="Direct sun", unit="h", range=(0, 8), heights=heights, size=(640, 480))
    assert found.size == (640, 480) and found.range == (0, 8)
    for name, start in (("map.png", b"\x89PNG"), ("map.svg", b"<svg "), ("map.pdf", b"%PDF-")):
        found.save(tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(start)
    svg = (tmp_path / "map.svg").read_text(encoding="utf-8")
    assert "A court &amp; a wall" in svg and "Direct sun in h" in svg and "#fde725" in svg
    assert found._repr_png_() == (tmp_path / "map.png").read_bytes()
    assert am.Map(values, 2.0).range == (0, 12)
    with pytest.raises(ValueError, match="png, .svg or .pdf"):
        found.save(tmp_path / "map.xyz")
    for bad in (
        dict(values=values[0]),
        dict(cell=0),
        dict(range=(1, 1)),
        dict(size=(10, 10)),
        dict(metres=0),
        dict(north=np.nan),
        dict(heights=heights[:39]),
    ):
        with pytest.raises(ValueError):
            am.Map(**{"values": values, "cell": 2.0, **bad})


def test_a_map_by_matplotlib_has_the_range_of_the_drawing():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    found = am.Map([[0.0, 5.0], [9.0, np.nan]], 10.0, title="Court", quantity="Direct sun", unit="h", range=(0, 8))
    axes = found.plot()
    (image,) = axes.get_images()
    assert image.get_clim() == (0, 8) and image.get_cmap().name == "viridis"
    assert list(image.get_extent()) == [0, 20, 0, 20]
    assert image.get_array().shape == (2, 2) and axes.get_title() == "Court"
    assert image.colorbar.extend == "max" and image.colorbar.ax.get_ylabel() == "Direct sun in h"
    assert found.plot(ax=axes) is axes
