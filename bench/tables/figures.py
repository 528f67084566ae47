"""Finds the figures of a page that stand outside of its generated tables.

A figure is a measured number: one with a decimal point, a percent sign, a power of ten, a unit of time or memory,
or of more than three digits. Settings such as "8 wide" are none, and neither are versions, dates and code.
"""

import re

GENERATED = re.compile(r"<!-- bench/results \S+ -->\n(?:\|.*\n)*")
NOT_PROSE = re.compile(
    r"^```.*?^```$|^    .*?$|<!--.*?-->|`[^`\n]*`|\]\([^)\n]*\)|https?://\S+|^#.*?$"
    r"|\b20\d\d-\d\d-\d\d\b|\((?:19|20)\d\d\)|[A-Z]\w+(?: and [A-Z]\w+| et al\.)?,? (?:19|20)\d\d\b"
    r"|\b(?:Embree|Open3D|CPython|glibc|Rust|EN|C_p|AVX|SSE|version|commit|parry3d|pvlib|pyradiance|trimesh|embreex|issue) ?-?v?\d[\w.:]*",
    re.MULTILINE | re.DOTALL,
)
FIGURE = re.compile(
    r"(?<![\w.+/-])-?(?:"
    r"\d+(?:[.]\d+)(?:e-?\d+)?(?: %)?|\d+e-?\d+|\d+ %|\d{1,3}(?:[ ,]\d{3})+|\d{4,}"
    r"|\d+(?= (?:ns|ms|s|seconds|minutes|MB|MiB|KiB|GiB|bytes|cm|million)\b)"
    r")(?![\w.]*\w)"
)


def blank(text, pattern):
    """The text with spaces where the pattern matches, so that places stay."""
    return pattern.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)


def in_tables(text):
    return sum(len(FIGURE.findall(found[0])) for found in GENERATED.finditer(text))


def by_hand(text):
    """The figures outside of generated tables, as (place, figure)."""
    return [(found.start(), found[0]) for found in FIGURE.finditer(blank(blank(text, GENERATED), NOT_PROSE))]


def unsourced(text, accounted):
    """Figures of a page that no accounted text contains, with their lines."""
    covered = [False] * (len(text) + 1)
    for part in accounted:
        for found in re.finditer(re.escape(part), text):
            covered[found.start() : found.end()] = [True] * len(part)
    places = [(place, figure) for place, figure in by_hand(text) if not covered[place]]
    return [(text.count("\n", 0, place) + 1, figure) for place, figure in places]
