"""Brute force in double precision: horizons and sight from all crossings of a line with the triangles of a raster."""

import numpy as np


def crossings(z, row, column, along, down):
    """Distances, in lengths of (along, down) in cells, and heights where a line from a cell meets edges."""
    found = []
    for rate, kind in ((along, "columns"), (down, "rows"), (along - down, "diagonals")):
        if abs(rate) > 1e-12:
            distance = np.arange(1, 2 * max(z.shape)) / abs(rate)
            c, r = column + along * distance, row + down * distance
            if kind == "columns":
                c = np.round(c)
            elif kind == "rows":
                r = np.round(r)
            inside = (c >= 0) & (r >= 0) & (c <= z.shape[1] - 1) & (r <= z.shape[0] - 1)
            distance, c, r = distance[inside], c[inside], r[inside]
            c0, r0 = np.minimum(c.astype(int), z.shape[1] - 2), np.minimum(r.astype(int), z.shape[0] - 2)
            # Within a square the diagonal from north-west to south-east parts two planes.
            x, y = c - c0, r - r0
            a, b, d, e = z[r0, c0], z[r0, c0 + 1], z[r0 + 1, c0], z[r0 + 1, c0 + 1]
            found.append((distance, np.where(x > y, a + x * (b - a) + y * (e - b), a + y * (d - a) + x * (e - d))))
    return [np.concatenate(parts) for parts in zip(*found)]


def horizon(z, cell, row, column, azimuth):
    """The horizon of a cell in degrees, at least 0."""
    angle = np.radians(azimuth)
    distance, height = crossings(z, row, column, np.sin(angle), -np.cos(angle))
    slope = (height - z[row, column]) / (distance * cell)
    return float(np.degrees(np.arctan(slope.max(initial=0))))


def sight(z, row, column, eye, to_row, to_column):
    """How far, as a slope, the line from the eye to a cell passes above what lies between: seen unless negative."""
    distance, height = crossings(z, row, column, to_column - column, to_row - row)
    between = distance < 1 - 1e-9
    start = z[row, column] + eye
    return float((z[to_row, to_column] - start - ((height - start) / distance)[between].max(initial=-np.inf)))
