"""What trimesh's own ray tests import beside trimesh. Its source distribution has the tests, but neither this module nor the
models: tests that need a model of a scanner are skipped, the others get bodies that are made here."""

import logging
import time  # noqa: F401

import numpy as np
import pytest
import trimesh  # noqa: F401

log = logging.getLogger("trimesh")


class Data(dict):
    def __missing__(self, name):
        pytest.skip(f"no {name}")


data = Data()


def random(shape):
    return np.random.default_rng(0).random(shape)


def get_mesh(name, **arguments):
    bodies = {"unit_sphere.STL": trimesh.creation.icosphere, "unit_cube.STL": trimesh.creation.box}
    if name not in bodies:
        pytest.skip(f"no model {name}")
    made = bodies[name]()
    return trimesh.Trimesh(made.vertices, made.faces, **arguments)
