"""Tables of the atlas of errors: each function returns a head and rows of cells."""

import json
import os

from tables.texts import RECORDS

ATLAS = "xeon-2026-11-28-atlas.json"
MOUNTAINS = "xeon-2026-11-29-rims.json"
RIMS = (100, 500)
TERRAINS = {"tower": "tower", "town": "town", "old-town": "old town", "ridge": "ridge", "alps": "alps", "new-zealand": "New Zealand"}


def rows(question):
    """Rows of a question by tool and terrain, in the order of the record."""
    with open(os.path.join(RECORDS, ATLAS)) as file:
        record = json.load(file)["rows"]
    found = {}
    for row in record:
        if row["question"] == question:
            found.setdefault(row["tool"], {})[row["terrain"]] = row
    return found


def made_by():
    """What the record was made by: the CPU, the program and the tools with their versions."""
    with open(os.path.join(RECORDS, ATLAS)) as file:
        record = json.load(file)
    return ["", ""], [[name, f"`{value}`"] for name, value in record.items() if name != "rows"]


def percent(value):
    return "0" if value == 0 else f"{100 * value:.2f}" if value < 0.0995 else f"{100 * value:.1f}"


def by_terrain(question, cell):
    """A row for each tool other than the program, and a cell for each terrain; `-` where the tool has no answer."""
    table = []
    for tool, found in rows(question).items():
        if tool != "antumbra":
            answered = {terrain: row for terrain, row in found.items() if "failed" not in row}
            table.append([tool] + [cell(answered[terrain]) if terrain in answered else "-" for terrain in TERRAINS])
    return ["", *TERRAINS.values()], table


def horizons():
    return by_terrain("horizon", lambda row: f"{percent(row['others']['over 0.1'])} / {percent(row['others']['over 1'])}")


def horizon_means():
    return by_terrain("horizon", lambda row: f"{row['others']['mean']:.4f} / {row['even']['mean']:.4f}")


def viewsheds():
    """Cells that differ, as parts of the cells that are seen."""
    seen = {terrain: row["seen"] for terrain, row in rows("viewshed")["antumbra"].items()}
    return by_terrain("viewshed", lambda row: " / ".join(percent(row[kind] / seen[row["terrain"]]) for kind in ("missed", "invented")))


def shadows():
    return by_terrain("shadow", lambda row: " / ".join(percent(part) for part in row["wrong"]))


def hours():
    return by_terrain("hours", lambda row: f"{percent(row['wrong'])} / {row['mean']:.3f} / {row['most']:.1f}")


def skies():
    return by_terrain("sky", lambda row: f"{row['mean']:.4f} / {row['most']:.2f}")


def checks():
    """How the program's answers differ from brute force, and what half of the azimuths changes in sky view."""
    lines = [
        ("horizon, largest difference in degrees", "horizon", lambda row: f"{row['beyond brute force']:.0e}"),
        ("viewshed, lines of 1000 that differ", "viewshed", lambda row: str(row["differ from brute force, of 1000"])),
        ("sky view, mean change by half of the azimuths", "sky", lambda row: f"{row['half of the azimuths, mean']:.0e}"),
    ]
    table = []
    for name, question, cell in lines:
        found = rows(question)["antumbra"]
        table.append([name] + [cell(found[terrain]) if terrain in found else "-" for terrain in TERRAINS])
    return ["", *TERRAINS.values()], table


def seconds():
    """CPU seconds of each question on three terrains, the program in the first row of each."""
    names = {"horizon": "horizons", "viewshed": "viewsheds", "shadow": "shadows", "hours": "hours", "sky": "sky view"}
    chosen = ("town", "old-town", "new-zealand")
    table = []
    for question, name in names.items():
        for tool, found in sorted(rows(question).items(), key=lambda row: row[0] != "antumbra"):
            if tool != "exact, other diagonal":
                cells = [f"{found[t]['seconds']:.2f}" if t in found and "failed" not in found[t] else "-" for t in chosen]
                table.append([name, tool, *cells])
    return ["", "", *(TERRAINS[terrain] for terrain in chosen)], table


def rims():
    """What a rim around each chunk costs: horizons in azimuths between the multiples of 45 degrees."""
    lines = {}
    for rim in RIMS:
        found = [(TERRAINS[name], row["others"]) for name, row in rows("horizon")[f"rim of {rim} cells"].items() if "failed" not in row]
        for name, row in [*found, (mountains(rim)["terrain"], mountains(rim))]:
            lines.setdefault(name, [name]).extend([f"{percent(row['over 0.1'])} / {percent(row['over 1'])}", f"{row['most']:.1f}"])
    heads = [[f"rim of {rim}, over 0.1 / 1 degree", "largest, degrees"] for rim in RIMS]
    return ["", *heads[0], *heads[1]], list(lines.values())


def mountains(rim):
    """What a rim costs in mountains that are wider."""
    with open(os.path.join(RECORDS, MOUNTAINS)) as file:
        return next(row for row in json.load(file)["rows"] if row["rim"] == rim)


TABLES = {
    "atlas-rims": rims,
    "atlas-checks": checks,
    "atlas-horizons": horizons,
    "atlas-horizon-means": horizon_means,
    "atlas-viewsheds": viewsheds,
    "atlas-shadows": shadows,
    "atlas-hours": hours,
    "atlas-sky": skies,
    "atlas-seconds": seconds,
    "atlas-made-by": made_by,
}
