"""The examples run, their pictures are those of the gallery, and the reference is what the docstrings say."""

import doctest
import inspect
import pathlib
import re
import subprocess
import sys

import antumbra as am
import antumbra.embreex
import antumbra.open3d
import antumbra.trimesh
import numpy as np
import pytest
import reference
import stubs

DOCS = pathlib.Path(__file__).parents[3] / "docs" / "src" / "python"
EXAMPLES = sorted((DOCS / "examples").glob("*.py"))


def pixels(path):
    image = pytest.importorskip("PIL.Image")
    return np.asarray(image.open(path).convert("RGB")).astype(int)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_examples_make_the_pictures_of_the_gallery(example, tmp_path):
    if "trimesh" in example.stem:
        pytest.importorskip("trimesh")
    assert len(example.read_text().splitlines()) < 60
    subprocess.run([sys.executable, example, tmp_path], check=True, timeout=300)
    made = tmp_path / f"{example.stem}.png"
    assert made.stat().st_size > 1000
    a, b = pixels(made), pixels(DOCS / "pictures" / made.name)
    # Sines and roots of numpy may differ in the last place between machines.
    assert a.shape == b.shape and np.abs(a - b).mean() < 1


def test_there_is_a_page_about_every_example():
    assert len(EXAMPLES) == 5
    gallery = (DOCS / "gallery.md").read_text()
    for example in EXAMPLES:
        assert f"examples/{example.name}" in gallery and f"pictures/{example.stem}.png" in gallery


def test_the_reference_is_what_the_docstrings_say():
    pytest.importorskip("xarray")
    assert (DOCS / "reference.md").read_text() == reference.text(), "run interfaces/python/tests/reference.py"


def test_the_stub_is_what_the_signatures_say():
    assert stubs.STUB.read_text() == stubs.text(), "run interfaces/python/tests/stubs.py"


MODULES = [am, antumbra.open3d, antumbra.trimesh, antumbra.embreex, antumbra.embreex.rtcore, antumbra.embreex.rtcore_scene, antumbra.embreex.mesh_construction]
MODULES += [antumbra.xarray] if hasattr(antumbra, "xarray") else []
RETURN_NOTHING = {"save", "set_masks", "set_instances", "refit", "adopt", "set_threads", "install"}
RAISE_NOTHING = {"antumbra.embreex.install"}


def public():
    """Name, thing and whether it is a class, of every callable and property that users see."""
    seen = {}
    for module in MODULES:
        for name, thing in vars(module).items():
            is_ours = getattr(thing, "__module__", "").split(".")[0] == "antumbra" or type(thing).__name__ == "builtin_function_or_method"
            if name.startswith("_") or not callable(thing) or not is_ours:
                continue
            if inspect.isclass(thing):
                seen.setdefault(thing, f"{module.__name__}.{name}")
                for member, of in vars(thing).items():
                    if member.startswith("_") or (issubclass(thing, tuple) and member in thing._fields):
                        continue
                    if callable(getattr(thing, member)):
                        seen.setdefault(getattr(of, "__func__", of), f"{module.__name__}.{name}.{member}")
            else:
                seen.setdefault(thing, f"{module.__name__}.{name}")
    return sorted((name, thing) for thing, name in seen.items())


def sections(thing):
    lines = inspect.cleandoc(thing.__doc__ or "").splitlines()
    heads = [place for place, line in enumerate(lines) if place and set(line) == {"-"}]
    return {lines[head - 1]: "\n".join(lines[head + 1 : next_head - 1]) for head, next_head in zip(heads, [*heads[1:], len(lines) + 2])}


PUBLIC = public()


def test_there_are_as_many_callables_as_we_know():
    assert len(PUBLIC) >= 75, [name for name, _ in PUBLIC]


@pytest.mark.parametrize("name, thing", PUBLIC, ids=[name for name, _ in PUBLIC])
def test_every_callable_says_what_it_takes_and_returns(name, thing):
    if thing is am.DegenerateWarning:
        return
    found, short = sections(thing), name.rpartition(".")[2]
    assert (thing.__doc__ or "").strip().splitlines()[0].rstrip(".:"), "a first line"
    assert ">>> " in found.get("Examples", ""), "an example"
    try:
        parameters = inspect.signature(thing).parameters
    except ValueError:
        parameters = {}
    taken = re.findall(r"(?m)^(\w[\w, ]*?)(?: :|$)", found.get("Parameters", ""))
    taken = {each for names in taken for each in names.split(", ")}
    if not (inspect.isclass(thing) and issubclass(thing, (tuple, am.Hits))) and thing is not am.Queries:
        wanted = {each for each, of in parameters.items() if each not in ("self", "cls", "args", "kwargs", "_", "arguments", "named")}
        assert wanted <= taken, wanted - taken
    if not inspect.isclass(thing):
        assert "Returns" in found or short in RETURN_NOTHING, "what it returns"
        assert "Raises" in found or name in RAISE_NOTHING, "what it raises"


@pytest.mark.parametrize("name, thing", [*PUBLIC, *((module.__name__, module) for module in MODULES)], ids=lambda each: each if isinstance(each, str) else "")
def test_examples_of_docstrings_are_true(name, thing):
    if "trimesh" in name:
        pytest.importorskip("trimesh")
    runner = doctest.DocTestRunner()
    runner.run(doctest.DocTestParser().get_doctest(thing.__doc__ or "", {}, name, None, 0))
    assert not runner.failures


@pytest.mark.parametrize("name", ["vertices", "faces", "normals", "paths"])
def test_examples_of_properties_are_true(name):
    runner = doctest.DocTestRunner()
    runner.run(doctest.DocTestParser().get_doctest(getattr(am.Queries, name).__doc__, {}, name, None, 0))
    assert runner.tries > 1 and not runner.failures


def test_types_know_the_texts_that_arguments_take():
    api = pytest.importorskip("mypy.api")
    right = 'import antumbra as am\nscene = am.Scene([], quality="fast")\nscene.sky_view([0, 0, 0], up="y", weighting="uniform")\n'
    wrong = right.replace('"fast"', '"fats"').replace('"y"', '"x"').replace('"uniform"', '"uniforn"')
    text, _, status = api.run(["--strict", "--no-incremental", "-c", right])
    assert status == 0, text
    text, _, status = api.run(["--strict", "--no-incremental", "-c", wrong])
    assert status == 1 and text.count("[arg-type]") == 3, text


def test_programs_on_the_pages_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pages = [DOCS / "index.md", DOCS / "scenes.md", DOCS / "terrain.md", DOCS / "many-machines.md", DOCS.parent / "first-python.md"]
    for page in [*pages, DOCS.parents[2] / "README.md"]:
        names = {}
        for part in page.read_text().split("```python\n")[1:]:
            program = part.split("```")[0]
            # Engines of plans are run by tests/plans/run.
            if "trimesh" in program or "from plans import" in program:
                continue
            if "xarray" in program:
                pytest.importorskip("xarray")
            exec(compile(program, page, "exec"), names)


def test_the_program_of_the_package_page_runs():
    text = (DOCS.parents[2] / "interfaces" / "python" / "README.md").read_text()
    program = text.split("```python\n")[1].split("```")[0]
    corners, faces = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1.0]]), np.array([[0, 1, 2]])
    names = dict(vertices=corners, faces=faces, points=np.zeros((4, 3)), sun=[0.1, 0.1, 1], origins=np.zeros((4, 3)), directions=[0, 0, 1])
    names |= dict(z=np.zeros((3, 4)), dx=1, dy=2, meshes=[(corners, faces)], transforms=[np.eye(4)])
    exec(program, names)
    assert names["in_shadow"].all() and len(names["near"]) == 4 and names["world"].report["instances"] == 1
