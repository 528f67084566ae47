"""The reference of the package, from its docstrings: python reference.py writes docs/src/python/reference.md."""

import inspect
import pathlib
import re

import antumbra
import antumbra.embreex
import antumbra.open3d
import antumbra.trimesh

try:
    import antumbra.xarray
except ImportError:
    print("no xarray: the reference is without antumbra.xarray")

PAGE = pathlib.Path(__file__).parents[3] / "docs" / "src" / "python" / "reference.md"

PARTS = [
    ("Scenes", antumbra, ["Scene", "World", "Queries", "Mesh", "Curves", "Instance", "Assembly", "ChildOrder"]),
    ("Height fields", antumbra, ["HeightField"]),
    ("Results", antumbra, ["Hits", "HitList", "Closest", "Occluders", "BitMatrix", "SunPositions", "Irradiation", "Horizons", "Sky", "Map", "Picture"]),
    ("Functions", antumbra, ["sun_positions", "irradiation", "sky_patches", "texel_atlas", "heat_map", "render", "set_threads", "get_threads"]),
    ("Warnings", antumbra, ["DegenerateWarning"]),
    ("antumbra.trimesh", antumbra.trimesh, ["RayMeshIntersector", "install"]),
    ("antumbra.open3d", antumbra.open3d, ["RaycastingScene"]),
    *([("antumbra.xarray", antumbra.xarray, ["Terrain"])] if hasattr(antumbra, "xarray") else []),
    ("antumbra.embreex", antumbra.embreex, ["install"]),
    ("antumbra.embreex.rtcore_scene", antumbra.embreex.rtcore_scene, ["EmbreeScene"]),
    ("antumbra.embreex.mesh_construction", antumbra.embreex.mesh_construction, ["TriangleMesh", "ElementMesh"]),
]


def signature(thing):
    try:
        text = re.sub(r"(?<=[(, ])self(, )?(/(, )?)?", "", str(inspect.signature(thing)))
    except ValueError:
        return ""
    text = re.sub(r"='([^']*)'", r'="\1"', text.replace("=Ellipsis", "=inf"))
    return re.sub(r"'|antumbra\._core\.|numpy\.(typing\.)?", "", text).replace("dtype[", "").replace("(, ", "(")


def body(thing):
    """The docstring, sections of parameters as lists."""
    lines, out = inspect.cleandoc(thing.__doc__ or "").splitlines(), []
    section = False
    for place, line in enumerate(lines):
        below = lines[place + 1] if place + 1 < len(lines) else ""
        if re.fullmatch(r"-{3,}", below):
            out.append(f"*{line}*\n")
            section = line != "Notes"
            if line == "Examples":
                return "\n".join(out).replace("``", "`") + "\n```python\n" + "\n".join(lines[place + 2 :]).rstrip() + "\n```"
        elif re.fullmatch(r"-{3,}", line):
            continue
        elif section and line and not line.startswith(" "):
            name, colon, rest = line.partition(" : ")
            plain = not colon and not re.fullmatch(r"[\w, ]+", line)
            if plain or (not colon and line.endswith(".")):
                section = False
                out.append(line)
            else:
                out.append(f"- `{name}`" + (f": {rest}" if colon else ""))
        elif section:
            out.append("  " + line.strip() if line.strip() else "")
        else:
            out.append(line)
    return "\n".join(out).replace("``", "`")


def members(kind):
    for name, member in vars(kind).items():
        if name.startswith("_") or name in ("count", "index") and issubclass(kind, tuple):
            continue
        if isinstance(member, (classmethod, staticmethod)):
            member = member.__func__
        if callable(member) or inspect.isgetsetdescriptor(member) or inspect.isdatadescriptor(member):
            if member.__doc__ and "Alias for field" not in member.__doc__:
                yield name, getattr(kind, name)


def text():
    out = ["# Reference\n\nMade of the docstrings of the package.\n"]
    for title, module, names in PARTS:
        out.append(f"## {title}\n")
        if module is not antumbra:
            out.append(body(module) + "\n")
        for name in names:
            thing = getattr(module, name)
            out.append(f"### `{name}{signature(thing) if not inspect.isclass(thing) or name in ('Scene', 'World', 'HeightField') else ''}`\n")
            out.append(body(thing) + "\n")
            if inspect.isclass(thing) and not issubclass(thing, Warning):
                for member, of in sorted(members(thing)):
                    shown = signature(of) if callable(of) else ""
                    out.append(f"#### `{name}.{member}{shown}`\n")
                    out.append(body(of) + "\n")
    return "\n".join(out)


if __name__ == "__main__":
    PAGE.write_text(text())
