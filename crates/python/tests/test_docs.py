"""The examples run, their pictures are those of the gallery, and the reference is what the docstrings say."""

import doctest
import pathlib
import subprocess
import sys

import antumbra as am
import numpy as np
import pytest
import reference

DOCS = pathlib.Path(__file__).parents[3] / "docs" / "python"
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
    assert (DOCS / "reference.md").read_text() == reference.text(), "run crates/python/tests/reference.py"


def test_the_first_example_is_true():
    failures, tried = doctest.testmod(am)
    assert tried > 2 and not failures


def test_examples_of_docstrings_are_true():
    tried = 0
    for thing in (am.irradiation, am.texel_atlas, am.Scene.sensor_grid):
        runner = doctest.DocTestRunner()
        runner.run(doctest.DocTestParser().get_doctest(thing.__doc__, {}, thing.__name__, None, 0))
        tried += runner.tries
        assert not runner.failures
    assert tried > 10


def test_programs_on_the_pages_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for page in (DOCS / "README.md", DOCS / "many-machines.md", DOCS.parents[1] / "README.md"):
        names = {}
        for part in page.read_text().split("```python\n")[1:]:
            program = part.split("```")[0]
            if "tcp://" not in program and "trimesh" not in program:
                exec(compile(program, page, "exec"), names)
