"""The stub of the compiled part, from its signatures: python stubs.py writes python/antumbra/_core.pyi.

Names, order and defaults of parameters are what the module says. Types stay as the stub has them: a parameter without one gets the
type that its name has elsewhere, and a function that is new gets a place at the end of its class, with ``Any`` as what it returns.
"""

import ast
import inspect
import json
import pathlib

from antumbra import _core

STUB = pathlib.Path(__file__).parents[1] / "python" / "antumbra" / "_core.pyi"
WIDTH = 120


def parameters(thing, first):
    """Name, kind and default of each parameter; None where the module says nothing."""
    try:
        found = list(inspect.signature(thing).parameters.values())
    except (TypeError, ValueError):
        return None
    names = [each.name for each in found]
    if first and names[:1] != [first]:
        found.insert(0, inspect.Parameter(first, inspect.Parameter.POSITIONAL_OR_KEYWORD))
    kinds = [found[0].POSITIONAL_OR_KEYWORD if each.name in ("self", "cls") else each.kind for each in found]
    return [(each.name, kind, default(each.default)) for each, kind in zip(found, kinds)]


def default(value):
    if value is inspect.Parameter.empty:
        return None
    if value is Ellipsis:
        return "..."
    return json.dumps(value) if isinstance(value, str) else repr(value)


def written(arguments):
    """The same of a function of the stub."""
    kinds = inspect.Parameter
    plain = [(each, kinds.POSITIONAL_ONLY) for each in arguments.posonlyargs]
    plain += [(each, kinds.POSITIONAL_OR_KEYWORD) for each in arguments.args]
    values = [None] * (len(plain) - len(arguments.defaults)) + arguments.defaults
    named = [(each, kinds.KEYWORD_ONLY) for each in arguments.kwonlyargs]
    pairs = zip(plain + named, values + arguments.kw_defaults)
    return [(each.arg, kind, default(ast.literal_eval(value)) if value else None) for (each, kind), value in pairs]


def known_types(tree):
    """Types of parameters by name, the most frequent one of each."""
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.arg) and node.annotation:
            found.setdefault(node.arg, []).append(ast.unparse(node.annotation))
    return {name: max(types, key=types.count) for name, types in found.items()}


def declaration(name, found, types, returns, indent):
    parts, before = [], None
    for parameter, kind, value in found:
        if before == inspect.Parameter.POSITIONAL_ONLY != kind:
            parts.append("/")
        if kind == inspect.Parameter.KEYWORD_ONLY != before:
            parts.append("*")
        kept = types.get(parameter)
        parts.append(parameter + (f": {kept}" if kept else "") + (f" = {value}" if value and kept else f"={value}" if value else ""))
        before = kind
    if before == inspect.Parameter.POSITIONAL_ONLY:
        parts.append("/")
    ends = f"{indent}def {name}(", f") -> {returns}: ..."
    line = ends[0] + ", ".join(parts) + ends[1]
    inside = indent + "    " + ", ".join(parts)
    if len(line) <= WIDTH:
        return line
    if len(inside) <= WIDTH:
        return "\n".join([ends[0], inside, indent + ends[1]])
    return "\n".join([ends[0], *(f"{indent}    {part}," for part in parts), indent + ends[1]])


def functions(body, owner):
    """Functions of a module or class that are written once, with what the module has under their name."""
    for node in body:
        if isinstance(node, ast.FunctionDef) and not node.decorator_list or is_method_of_class(node):
            dunder = node.name.startswith("__") and node.name != "__new__"
            thing = owner if node.name == "__new__" else getattr(owner, node.name, None)
            if thing is not None and not dunder:
                yield node, thing


def is_method_of_class(node):
    return isinstance(node, ast.FunctionDef) and [ast.unparse(each) for each in node.decorator_list] in (["classmethod"], ["staticmethod"])


def missing(body, owner):
    """Functions of the module or of a class that the stub has not."""
    has = {node.name for node in body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    for name, thing in vars(owner).items():
        if not name.startswith("__") and name not in has and callable(thing) and not inspect.isclass(thing):
            yield name, thing


def text():
    stub = STUB.read_text()
    tree, lines = ast.parse(stub), stub.split("\n")
    everywhere = known_types(tree)
    groups = [(tree.body, _core, "", None)]
    groups += [(node.body, getattr(_core, node.name, None), "    ", node) for node in tree.body if isinstance(node, ast.ClassDef)]
    edits = []
    for body, owner, indent, node in groups:
        if owner is None:
            continue
        for function, thing in functions(body, owner):
            names = [each.arg for each in function.args.posonlyargs + function.args.args]
            first = names[0] if names and names[0] in ("self", "cls") else None
            found, has = parameters(thing, first), written(function.args)
            if found is None or [each[0::2] for each in found] == [each[0::2] for each in has]:
                continue
            every = function.args.posonlyargs + function.args.args + function.args.kwonlyargs
            types = everywhere | {each.arg: ast.unparse(each.annotation) for each in every if each.annotation}
            returns = ast.unparse(function.returns)
            edits.append((function.lineno - 1, function.end_lineno, declaration(function.name, found, types, returns, indent)))
        for name, thing in missing(body, owner) if node else []:
            found = parameters(thing, None)
            if found is not None:
                edits.append((node.end_lineno, node.end_lineno, declaration(name, found, everywhere, "Any", indent)))
    for begin, end, new in sorted(edits, reverse=True):
        lines[begin:end] = new.split("\n")
    return "\n".join(lines)


if __name__ == "__main__":
    STUB.write_text(text())
