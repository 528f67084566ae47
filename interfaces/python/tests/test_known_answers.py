"""Bits of answers against those of the kernel, by check sums: kernel/antumbra/tests/kernel/known_answers.rs has the same."""

import antumbra as am
import numpy as np
import pytest

KNOWN = [0xC5F9BC35038014A6, 0xA6DEB02CD489BB4D, 0x80ED3271B9F4AEA7, 0xA5FB0F7D7820D4FF]


def numbers(count):
    """Numbers in [0, 1) of 24 bits, by a generator modulo 2**32."""
    state, found = 2016, np.empty(count, np.float32)
    for index in range(count):
        state = (state * 1664525 + 1013904223) % 2**32
        found[index] = (state >> 8) / 2**24
    return found


def check_sum(array):
    """FNV-1a of 64 bits."""
    found = 0xCBF29CE484222325
    for byte in array.tobytes():
        found = (found ^ byte) * 0x100000001B3 % 2**64
    return found


@pytest.fixture(scope="module")
def question():
    drawn = numbers(300 * 9 + 4000 * 6)
    corners, ends = drawn[:2700].reshape(300, 3, 3).copy(), drawn[2700:].reshape(4000, 2, 3)
    corners[:, 1:] = corners[:, :1] + (corners[:, 1:] - np.float32(0.5)) * np.float32(0.25)
    scene = am.Scene(corners.reshape(-1, 3), np.arange(900).reshape(300, 3))
    return scene, ends[:, 0].copy(), ends[:, 1] - ends[:, 0]


@pytest.mark.parametrize("threads", [1, 2])
def test_answers_have_the_bits_of_the_kernel(question, threads):
    scene, origins, directions = question
    hits = scene.intersect(origins, directions, threads=threads)
    found = [
        scene.occluded(origins, directions, 1, threads=threads).astype(np.uint8),
        hits.t.astype("<f4"),
        hits.triangle.astype("<i4"),
        np.where(hits.hit[:, None], hits.uv, 0).astype("<f4"),
    ]
    assert [check_sum(array) for array in found] == KNOWN
    # The same after learning, and of the other layouts that rays come in.
    scene.learn(origins, directions)
    mixed = scene.intersect(np.asfortranarray(origins.astype(np.float64)), directions[::-1][::-1], threads=threads)
    assert check_sum(mixed.t.astype("<f4")) == KNOWN[1]
