"""Tables beside pbrt-v3: times of twenty standard scenes, and differences of pictures by feature."""

import pathlib

from tables.texts import lines

TIMES, PICTURES = "xeon-2026-11-26-pbrt3-times.txt", "zen3-2026-11-26-pbrt3.txt"
SCENES = pathlib.Path(__file__).resolve().parent.parent / "pbrt3-scenes"


def rows(name):
    """Rows of a record as dictionaries by the names of its columns; comments begin with #."""
    cells = [[cell.strip() for cell in line.split("|")] for line in lines(name) if line and not line.startswith("#")]
    heads = [number for number, row in enumerate(cells) if row[0] == "scene"]
    return [dict(zip(cells[heads[0]], row)) for number, row in enumerate(cells) if number not in heads]


def times():
    """CPU seconds of both programs, scene by scene."""
    found = rows(TIMES)
    table = [
        [row["scene"], row["size"].replace("x", " x "), row["spp"], row["pbrt-v3 cpu s"], row["antumbra cpu s"], row["speedup"]]
        for row in found
    ]
    return ["scene", "size", "samples per pixel", "pbrt-v3, CPU s", "Antumbra, CPU s", "speedup"], table


def about(scene):
    """The first sentence of a scene's file, which says what it has."""
    path = SCENES / f"{scene}.pbrt"
    return path.read_text().split("\n")[0].strip("# ").split(". ")[0].rstrip(".") if path.exists() else "standard scene"


def pictures():
    """Differences of pictures, scene by scene."""
    table = [
        [f"`{row['scene']}`", about(row["scene"]), f"{float(row['difference %']):+.2f} %", f"{float(row['its error']):.2f} %", f"{float(row['beyond 4 %']):.2f} %"]
        for row in rows(PICTURES)
    ]
    return ["scene", "features", "difference of means", "its standard error", "pixels beyond 4 standard errors"], table


TABLES = {"pbrt3-times": times, "pbrt3-pictures": pictures}
