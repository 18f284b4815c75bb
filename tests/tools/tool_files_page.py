"""The reference of tool and stock files as Markdown: ``docs/reference/tool_files.md``; ``make docs`` writes it."""

from __future__ import annotations

from importlib import resources

from machine_page import key_tables

from shapegcode.cutting.stock import Stock
from shapegcode.cutting.tool import Tool, materials
from shapegcode.settings.keys import toml

STEEL_TOOL = """\
[tool]
name = "12 mm, 4 flutes"
number = 3
diameter_mm = 12
flutes = 4
helix_deg = 38
flute_length_mm = 26
overhang_mm = 45
runout_um = [4, 0, -4, 0]
holder_stiffness_n_per_um = 40

[cutting]
material = "steel-scm435"
tangential_edge_n_per_mm = 15  # takes the place of the library's value

[limits]
resultant_n = 900
deflection_um = 25
power_w = 3500
feed_per_tooth_min_mm = 0.02
feed_per_tooth_max_mm = 0.1

[feed]
air_feed_mm_per_min = 4000
approach_mm = 1.5
"""

STOCK_EXAMPLES = {
    "A block": """\
[box]
x_mm = [0, 120]
y_mm = [0, 80]
z_mm = [-25, 0]
""",
    "A prism with a hole": """\
[polygon]
points_mm = [[0, 0], [120, 0], [120, 50], [90, 80], [0, 80]]
holes_mm = [[[50, 30], [70, 30], [70, 50], [50, 50]]]
z_mm = [-25, 0]
""",
    "Layer left by roughing on the walls finished by this program": """\
[allowance]
allowance_mm = 0.5
corner_radius_mm = 8  # the roughing tool had a diameter of 16 mm
wall = "right"
z_mm = [-12, 0]
""",
    "What a roughing program left of a block": """\
[program]
file = "rough.nc"
tool = "rough_tool.toml"

[program.on.box]
x_mm = [0, 120]
y_mm = [0, 80]
z_mm = [-25, 0]
""",
}

_INTRODUCTION = """\
# Tool and stock files

<!-- Generated: make docs -->

A tool file says what cuts, how large the forces are and what must not be exceeded; a stock file says what material is
there before the first block. `shapegcode feed` reads both; what the machine allows stands in its own file
([feed_control](machine.md#feed_control)). Both are TOML. An unknown key, a number that is not finite or a value
outside its limits is an error, and all errors of a file are listed at once, each with its line.

A default marked **assumed** is a typical value; your tool's may differ: look it up or measure it.

## The tool file

The tool of paper 001, which comes with shapegcode (`data/milling/paper001_tool.toml`):
"""

_STOCK = """\

## The stock file

A stock file holds exactly one of the tables `[box]`, `[polygon]`, `[allowance]` and `[program]`. Coordinates are those
of the program that is scheduled, in its work coordinate system: X0 Y0 Z0 of the stock file is X0 Y0 Z0 of the program.
"""

_ALLOWANCE = """\

### What an allowance is taken to be

The finished part is what lies behind the wall: on the side `wall` of the tool's travel, a tool radius from its centre.
Roughing has left `allowance_mm` on it, and inside corners with `corner_radius_mm` where the part has a smaller one: a
wall along which a circle of that radius could roll at that distance. All of it reaches from `z_mm[0]` to `z_mm[1]`.

A closed contour is a pocket or a boss, depending on `wall` and on its direction of travel; moves that lead to it and
away from it are ignored. An open contour is a wall from its beginning to its end and continues straight beyond both;
state `lead_in_mm` and `lead_out_mm` where the cut begins before the wall, or ends after it. Only moves below the top of
the stock count.
Where a path crosses itself or both of its sides are walls, describe the stock as a `[polygon]` instead: the message
says so. Outlines are right within half a micrometre.
"""


def file_documentation() -> str:
    """The text of ``docs/reference/tool_files.md``."""
    lines = _INTRODUCTION.splitlines()
    lines += ["", *_fenced(_example("paper001_tool.toml"))]
    lines += ["", "A tool for steel with limits:", "", *_fenced(STEEL_TOOL)]
    lines += key_tables(Tool, fanuc=False, heading="###")
    lines += ["", "## The library of materials", *_library()]
    lines += _STOCK.splitlines()
    for title, text in STOCK_EXAMPLES.items():
        lines += ["", f"{title}:", "", *_fenced(text)]
    lines += key_tables(Stock, fanuc=False, heading="###")
    lines += _ALLOWANCE.splitlines()
    return "\n".join(lines) + "\n"


def _example(name: str) -> str:
    return (resources.files("shapegcode") / "data" / "milling" / name).read_text(encoding="utf-8")


def _fenced(text: str) -> list[str]:
    return ["```toml", *text.splitlines(), "```"]


def _library() -> list[str]:
    lines = [
        "",
        "Values that `cutting.material` names. k1 in N/mm² and k2 hold at a chip 1 mm thick, edge forces are in N/mm,",
        "chip thickness in mm. Forces depend on the cutter as much as on the material, and sources differ by a factor",
        "of two and more: take these for a first estimate and fit your own to a test cut. A law of Kienzle is",
        "`specific_n_per_mm2` = k_c1.1, `specific_exponent` = -m_c; constant coefficients K_tc, K_rc are",
        "`specific_n_per_mm2` = K_tc, `ratio` = K_rc / K_tc with exponents 0.",
        "",
        "| name | material | k1 | exponent | k2 | exponent | K_te | K_re | chip | cutter |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for entry in materials().values():
        chip = "not stated" if entry.chip_mm is None else f"{entry.chip_mm[0]:g} … {entry.chip_mm[1]:g}"
        numbers = (
            entry.specific_n_per_mm2,
            entry.specific_exponent,
            entry.ratio,
            entry.ratio_exponent,
            entry.tangential_edge_n_per_mm,
            entry.radial_edge_n_per_mm,
        )
        cells = (
            f"`{entry.name}`",
            entry.description,
            *map(toml, numbers),
            f"{chip}, {entry.chip_thickness}",
            entry.cutter,
        )
        lines.append("| " + " | ".join(cells) + " |")
    lines.append("")
    for entry in materials().values():
        assumed = f" Assumed: {entry.assumed}." if entry.assumed else ""
        lines.append(f"* `{entry.name}`: {entry.source}.{assumed}")
    return lines
