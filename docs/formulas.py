"""A preprocessor of mdBook: blocks of TeX between ```math and ``` become MathML. Knows the commands in COMMANDS only."""

import html
import json
import re
import sys

COMMANDS = {"cdot": "·", "sum": "∑", "prod": "∏", "lt": "<", "le": "≤", "ge": "≥", "in": "∈", "times": "×"}
TOKEN = re.compile(r"\\([a-z]+)|([0-9.]+)|([A-Za-z])|([-+=()|,/])|([_^{}])|(\s+)|(.)")
BLOCK = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)


class Formula:
    """A reader of one formula: `row` returns the MathML of everything up to a closing brace."""

    def __init__(self, text):
        self.tokens = [found.groups() for found in TOKEN.finditer(text) if not found[6]]

    def mark(self):
        """The next brace, underscore or caret, or nothing."""
        return self.tokens[0][4] if self.tokens else None

    def row(self):
        parts = []
        while self.tokens and self.mark() != "}":
            parts.append(self.scripts(self.atom()))
        return f"<mrow>{''.join(parts)}</mrow>"

    def group(self):
        if self.mark() != "{":
            return self.atom()
        self.tokens.pop(0)
        inner = self.row()
        if not self.tokens:
            raise ValueError("a brace is not closed")
        self.tokens.pop(0)
        return inner

    def scripts(self, base):
        """A base with what stands below and above it; sums and products have theirs under and over."""
        found = {}
        while self.mark() in ("_", "^"):
            mark = self.tokens.pop(0)[4]
            found[mark] = self.group()
        names = ("munder", "mover", "munderover") if "∑" in base or "∏" in base else ("msub", "msup", "msubsup")
        if len(found) == 2:
            return f"<{names[2]}>{base}{found['_']}{found['^']}</{names[2]}>"
        for mark, name in zip("_^", names):
            if mark in found:
                return f"<{name}>{base}{found[mark]}</{name}>"
        return base

    def atom(self):
        if self.mark() == "{":
            return self.group()
        command, number, letter, sign, _, _, other = self.tokens.pop(0)
        if command == "frac":
            return f"<mfrac>{self.group()}{self.group()}</mfrac>"
        if command in ("text", "mathrm"):
            return self.group().replace("<mi>", '<mi mathvariant="normal">')
        if command in COMMANDS or sign:
            shown = html.escape((COMMANDS.get(command) or sign).replace("-", "−"))
            return f'<mo stretchy="false">{shown}</mo>' if sign else f"<mo>{shown}</mo>"
        if number:
            return f"<mn>{number}</mn>"
        if letter:
            return f"<mi>{letter}</mi>"
        raise ValueError(f"unknown in formulas: {command or other}")


def mathml(text):
    formula = Formula(text)
    row = formula.row()
    if formula.tokens:
        raise ValueError("a brace is closed that was not opened")
    return f'<div class="formula"><math display="block">{row}</math></div>'


def chapters(items):
    for item in items:
        if "Chapter" in item:
            chapter = item["Chapter"]
            try:
                chapter["content"] = BLOCK.sub(lambda found: mathml(found[1]), chapter["content"])
            except ValueError as error:
                sys.exit(f"{chapter['path']}: {error}")
            chapters(chapter["sub_items"])


if __name__ == "__main__" and sys.argv[1:2] != ["supports"]:
    _, book = json.load(sys.stdin)
    chapters(book.get("items", book.get("sections", [])))
    json.dump(book, sys.stdout)
