"""Scenes and rays for comparing Python packages: made by numpy alone.

    city      a closed scene: ground of 524 288 triangles with 20 000 boxes, most rays are occluded
    terrain   a rugged range of 524 288 triangles, most rays are occluded
    hills     an open scene: the same range, low, a quarter to a half of the rays is occluded
"""

import numpy as np

SUN = {"city": (0.5, 0.3, 0.55), "terrain": (0.8, 0.4, 0.22), "hills": (0.8, 0.4, 0.5)}


def grid(height, size):
    """A square surface: heights (n + 1, n + 1) above a square of some size."""
    n = len(height) - 1
    x = np.linspace(0, size, n + 1)
    gx, gy = np.meshgrid(x, x, indexing="ij")
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1)
    faces = np.concatenate([np.stack([i, i + n + 1, i + 1], -1), np.stack([i + 1, i + n + 1, i + n + 2], -1)])
    return np.stack([gx, gy, height], -1).reshape(-1, 3), faces


def city(n=512, boxes=20_000, size=1000.0):
    rng = np.random.default_rng(7)
    swell = lambda x, y: 12 * np.sin(0.011 * x) * np.cos(0.013 * y) + 3 * np.sin(0.07 * x + 0.05 * y)
    x = np.linspace(0, size, n + 1)
    ground, faces = grid(swell(x[:, None], x[None]), size)
    middle, half = rng.uniform(20, size - 20, (boxes, 2)), rng.uniform(1.5, 7, (boxes, 2))
    tall, turn = 3 + 57 * rng.uniform(0, 1, boxes) ** 4, rng.uniform(0, np.pi, boxes)
    sides = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half[:, None]
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    px, py = middle[:, :1] + sides[..., 0] * c - sides[..., 1] * s, middle[:, 1:] + sides[..., 0] * s + sides[..., 1] * c
    base = (swell(*middle.T) - 2)[:, None] + np.zeros((1, 4))
    corners = np.concatenate([np.stack([px, py, base], -1), np.stack([px, py, base + tall[:, None]], -1)], 1)
    of_box = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4],
              [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]]
    more = (8 * np.arange(boxes)[:, None, None] + of_box).reshape(-1, 3) + len(ground)
    return np.concatenate([ground, corners.reshape(-1, 3)]).astype(np.float32), np.concatenate([faces, more]).astype(np.int32)


def terrain(n=512, size=1000.0, relief=95.0):
    """Hills of all sizes: noise whose power falls with the frequency."""
    rng = np.random.default_rng(5)
    f = np.hypot(np.fft.fftfreq(n + 1)[:, None], np.fft.rfftfreq(n + 1)[None])
    f[0, 0] = np.inf
    noise = np.fft.irfft2(np.fft.rfft2(rng.normal(size=(n + 1, n + 1))) * f**-1.55, (n + 1, n + 1))
    vertices, faces = grid(relief * noise / noise.std(), size)
    return vertices.astype(np.float32), faces.astype(np.int32)


def hills():
    return terrain(relief=12.0)


def surface(vertices, faces, n, rng):
    """Points on the surfaces, by area, and normals."""
    a, b, c = (vertices[faces[:, k]].astype(float) for k in range(3))
    cross = np.cross(b - a, c - a)
    area = np.linalg.norm(cross, axis=1)
    pick = np.searchsorted(np.cumsum(area) / area.sum(), rng.uniform(0, 1, n)).clip(0, len(faces) - 1)
    r, w = np.sqrt(rng.uniform(0, 1, (n, 1))), rng.uniform(0, 1, (n, 1))
    return (1 - r) * a[pick] + r * (1 - w) * b[pick] + r * w * c[pick], cross[pick] / area[pick][:, None]


def rays(name, vertices, faces, n):
    """Kind -> origins and directions of length 1, float32: to the sun, over the hemisphere by the cosine, from a camera."""
    rng = np.random.default_rng(11)
    points, normals = surface(vertices, faces, n, rng)
    origins = points + 1e-2 * normals
    sun = np.array(SUN[name]) / np.linalg.norm(SUN[name])
    u, w = rng.uniform(0, 1, (n, 1)), rng.uniform(0, 2 * np.pi, (n, 1))
    t = np.cross(normals, np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    t /= np.linalg.norm(t, axis=1)[:, None]
    over = np.sqrt(u) * (np.cos(w) * t + np.sin(w) * np.cross(normals, t)) + np.sqrt(1 - u) * normals
    side = int(np.sqrt(n))
    gx, gy = np.meshgrid(np.linspace(-0.6, 0.6, side), np.linspace(-0.6, 0.6, n // side), indexing="xy")
    look = np.array([0.62, 0.62, -0.48]) / np.linalg.norm([0.62, 0.62, -0.48])
    right = np.cross(look, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    view = look + gx.reshape(-1, 1) * right + gy.reshape(-1, 1) * np.cross(right, look)
    view /= np.linalg.norm(view, axis=1)[:, None]
    eye = np.array([-150.0, -150.0, 180.0 + vertices[:, 2].max() * (name != "city")])
    f32 = lambda *arrays: tuple(np.ascontiguousarray(array, np.float32) for array in arrays)
    return {
        "sun": f32(origins, np.broadcast_to(sun, origins.shape)),
        "ao": f32(origins, over),
        "camera": f32(np.broadcast_to(eye, view.shape), view),
    }


def in_order(origins, directions):
    """The rays in the order of a curve through their origins (Morton), as rasters and meshes give them."""
    cell = ((origins - origins.min(0)) / (np.ptp(origins, 0).max() + 1e-9) * 1023).astype(np.uint64)
    code = np.zeros(len(origins), np.uint64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cell[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    order = np.argsort(code, kind="stable")
    return origins[order], directions[order]
