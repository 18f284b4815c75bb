"""Tool files: what they hold, what is said about a bad one, and the library of work materials."""

import math
import re
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from tool_files_page import STEEL_TOOL

from shapegcode import _core
from shapegcode.cutting.tool import Tool, materials
from shapegcode.errors import ToolError
from shapegcode.settings.load import line_of

DATA = resources.files("shapegcode") / "data" / "milling"
TOOL = """\
[tool]
name = "8 mm"
diameter_mm = 8.0
flutes = 6
helix_deg = 50.0
flute_length_mm = 20.0
overhang_mm = 30.0

[cutting]
material = "al6061-t6-carbide-6"
"""
MATERIAL = 'material = "al6061-t6-carbide-6"'


def paper_tool() -> Tool:
    return Tool.from_toml((DATA / "paper001_tool.toml").read_text(encoding="utf-8"))


def complaint(text: str) -> str:
    with pytest.raises(ToolError) as caught:
        Tool.from_toml(text, "t.toml")
    return str(caught.value)


def test_the_tool_of_paper_001() -> None:
    tool = paper_tool()
    mill = tool.end_mill()
    assert (mill.diameter_mm, mill.flutes, mill.runout_mm) == (8.0, 6, [])
    assert mill.helix_rad == pytest.approx(math.radians(50))
    assert tool.radius_mm == 4.0
    assert tool.sense(_core.SpindleSense.counter_clockwise) == _core.SpindleSense.clockwise
    assert tool.feed.spindle_rev_per_min == 1800


def test_sense_is_the_programs_where_the_file_has_none() -> None:
    tool = Tool.from_toml(TOOL)
    assert tool.sense() == _core.SpindleSense.clockwise
    assert tool.sense(_core.SpindleSense.counter_clockwise) == _core.SpindleSense.counter_clockwise
    other = Tool.from_toml(TOOL.replace("overhang_mm = 30.0", 'overhang_mm = 30.0\nspindle = "counter_clockwise"'))
    assert other.sense(_core.SpindleSense.clockwise) == _core.SpindleSense.counter_clockwise


def test_runout_is_handed_over_in_mm() -> None:
    tool = Tool.from_toml(TOOL.replace("flutes = 6", "flutes = 2\nrunout_um = [5, -5]"))
    assert tool.end_mill().runout_mm == pytest.approx([0.005, -0.005])


def test_coefficients_are_the_materials_unless_the_file_has_its_own() -> None:
    entry = materials()["steel-scm435"]
    mixed = Tool.from_toml(STEEL_TOOL).coefficients()
    assert mixed.specific_n_per_mm2 == entry.specific_n_per_mm2
    assert mixed.specific_exponent == entry.specific_exponent
    assert mixed.tangential_edge_n_per_mm == 15
    assert mixed.radial_edge_n_per_mm == entry.radial_edge_n_per_mm
    assert mixed.thickness == _core.ChipThickness.mean


def test_coefficients_of_your_own_need_no_material() -> None:
    own = 'specific_n_per_mm2 = 700\nratio = 0.3\nchip_thickness = "local"'
    values = Tool.from_toml(TOOL.replace('material = "al6061-t6-carbide-6"', own)).coefficients()
    assert (values.specific_n_per_mm2, values.ratio) == (700, 0.3)
    assert (values.specific_exponent, values.ratio_exponent) == (0, 0)
    assert (values.tangential_edge_n_per_mm, values.radial_edge_n_per_mm) == (0, 0)
    assert values.thickness == _core.ChipThickness.local


def test_a_file_is_read_from_disk_and_named_in_messages(tmp_path: Path) -> None:
    file = tmp_path / "t.toml"
    file.write_text(TOOL, encoding="utf-8")
    assert Tool.load(file).tool.name == "8 mm"
    file.write_text(TOOL.replace("flutes = 6", "flutes = 0"), encoding="utf-8")
    with pytest.raises(ToolError, match=re.escape(f"{file}:4: tool.flutes = 0: must be 1 or more")):
        Tool.load(file)
    with pytest.raises(FileNotFoundError):
        Tool.load(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "flute_length_mm = 20.0",
            "flute_length_mm = 31",
            "6: tool.flute_length_mm = 31.0: must not exceed overhang_mm",
        ),
        (
            "flutes = 6",
            "flutes = 3\nrunout_um = [1, 2]",
            "5: tool.runout_um = [1.0, 2.0]: has 2 values: must have one per",
        ),
        (
            "flutes = 6",
            "flutes = 1\nrunout_um = [4000]",
            "5: tool.runout_um = [4000.0]: must stay below the radius, 4000",
        ),
        ("helix_deg = 50.0", "helix_deg = 81", "5: tool.helix_deg = 81: must be 80 or less (unit: degrees)"),
        ("flutes = 6", "flutes = 6.5", "4: tool.flutes = 6.5: must be a whole number"),
        ("diameter_mm = 8.0", "diameter_mm = nan", "3: tool.diameter_mm = nan: must be"),
        ("overhang_mm = 30.0\n", "", " tool.overhang_mm: required, but missing (unit: mm)"),
        ("flutes = 6", "flute = 6", "4: tool.flute = 6: unknown key; did you mean flutes?"),
        ("al6061-t6-carbide-6", "al6061", '10: cutting.material = "al6061": no such material; known are al6061-t6-'),
        (
            MATERIAL,
            "ratio = 0.3",
            "9: cutting: needs material, or both specific_n_per_mm2 and ratio: specific_n_per_mm2 is",
        ),
        (
            MATERIAL,
            "ratio = 0.3\nspecific_n_per_mm2 = 700\nspecific_exponent = -0.6\nratio_exponent = -0.5",
            "9: cutting: specific_exponent + ratio_exponent = -1.1: must be greater than -1",
        ),
    ],
)
def test_a_bad_value_is_named_with_its_line_and_limit(old: str, new: str, expected: str) -> None:
    assert old in TOOL
    assert f"t.toml:{expected}" in complaint(TOOL.replace(old, new))


@pytest.mark.parametrize(
    ("tables", "expected"),
    [
        (
            "[limits]\nfeed_per_tooth_min_mm = 0.1\nfeed_per_tooth_max_mm = 0.1",
            "10: limits.feed_per_tooth_min_mm = 0.1: must be less than feed_per_tooth_max_mm = 0.1",
        ),
        ("[limits]\nresultant_n = 0", "10: limits.resultant_n = 0: must be greater than 0 (unit: N)"),
        ('[limits]\nresultant = "rms"', '10: limits.resultant = "rms": must be "peak" or "mean"'),
        (
            "[feed]\nair_feed_mm_per_min = 900\nmax_feed_mm_per_min = 800",
            "10: feed.air_feed_mm_per_min = 900.0: must not exceed max_feed_mm_per_min = 800.0",
        ),
        (
            "[feed]\nmax_feed_mm_per_min = 800\nspindle_rev_per_min = 1000\n[limits]\nfeed_per_tooth_min_mm = 0.2",
            "13: limits.feed_per_tooth_min_mm = 0.2: needs a feed of 1200 mm/min, but feed.max_feed_mm_per_min is 800",
        ),
    ],
)
def test_limits_and_feeds_that_contradict_are_named_with_their_line(tables: str, expected: str) -> None:
    assert f"t.toml:{expected}" in complaint(TOOL.replace("[cutting]", f"{tables}\n[cutting]"))


def test_all_problems_are_listed_at_once() -> None:
    text = TOOL.replace("flutes = 6", "flutes = 0").replace("30.0", "-1").replace("al6061-t6-carbide-6", "x")
    said = ["tool.flutes = 0", "tool.overhang_mm = -1", 'cutting.material = "x"']
    assert [line.split(": ")[1] for line in complaint(text).splitlines()] == said


def test_text_that_is_no_toml_or_no_utf_8(tmp_path: Path) -> None:
    assert complaint("[tool]\nname = ").startswith("t.toml:2: ")
    (tmp_path / "t.toml").write_bytes(b"[tool]\nname = '\xff'\n")
    with pytest.raises(ToolError, match=r"t.toml:2: not UTF-8 text \(byte 0xff\)"):
        Tool.load(tmp_path / "t.toml")


def test_a_key_is_found_behind_a_list_over_several_lines() -> None:
    text = '[a]\nlist = [\n  [0, 0],\n  [1, 2]  # [\n]\n"s" = "["\nkey = 1\n[b]\nkey = 2\n'
    assert line_of("a.list.2", text) == 2
    assert line_of("a.key", text) == 7
    assert line_of("b.key", text) == 9


# Tungaloy General Catalogue 2020-2021, specific cutting force in N/mm² at these feeds per tooth in mm.
FEEDS = (0.1, 0.15, 0.2, 0.3, 0.4)
CATALOGUE = {
    "steel-ss400": (2150, 2000, 1900, 1750, 1650),
    "steel-s55c": (1970, 1860, 1800, 1760, 1620),
    "steel-scm435": (2450, 2350, 2200, 1980, 1710),
    "cast-iron-fc250": (1660, 1450, 1320, 1150, 1030),
    "brass": (1090, 960, 877, 760, 680),
}
# Chinese Journal of Mechanical Engineering 34 (2021), doi 10.1186/s10033-021-00536-9, table 5: K_tc, K_te, K_rc, K_re.
REVIEW = {
    "al6061-t6-carbide": (243.77, 7.53, 113.5, 7.83),
    "al6082-t6-carbide": (631, 13, 99, 10),
    "al7075-t6-carbide": (767.01, 27.7, 168.8, 26.6),
    "al7075-hss": (951.365, 11.115, 262.597, 11.314),
}


@pytest.mark.parametrize("name", CATALOGUE)
def test_power_laws_are_the_fit_to_the_catalogue_and_within_what_the_source_says(name: str) -> None:
    entry, values = materials()[name], np.array(CATALOGUE[name], dtype=float)
    exponent, logarithm = np.polyfit(np.log(FEEDS), np.log(values), 1)
    assert entry.specific_exponent == pytest.approx(exponent, abs=1e-4)
    assert entry.specific_n_per_mm2 == pytest.approx(math.exp(logarithm), rel=1e-3)
    assert entry.chip_mm == (FEEDS[0], FEEDS[-1])
    assert ", ".join(map(str, CATALOGUE[name])) in entry.source
    stated = re.search(r"within ([0-9.]+) %", entry.source)
    law = entry.specific_n_per_mm2 * np.array(FEEDS) ** entry.specific_exponent
    # The figure is printed with one decimal.
    assert 100 * np.abs(law / values - 1).max() == pytest.approx(float(stated[1]), abs=0.06)


@pytest.mark.parametrize("name", REVIEW)
def test_constant_coefficients_are_those_of_the_review(name: str) -> None:
    entry = materials()[name]
    k_tc, k_te, k_rc, k_re = REVIEW[name]
    assert entry.specific_n_per_mm2 == k_tc
    assert entry.specific_n_per_mm2 * entry.ratio == pytest.approx(k_rc, rel=5e-4)
    assert (entry.tangential_edge_n_per_mm, entry.radial_edge_n_per_mm) == (k_te, k_re)
    assert (entry.specific_exponent, entry.ratio_exponent) == (0, 0)


def test_the_material_of_paper_001() -> None:
    entry = materials()["al6061-t6-carbide-6"]
    assert entry.specific_n_per_mm2 == pytest.approx(22.57 * 9.80665, rel=2e-4)  # kgf/mm²
    assert (entry.specific_exponent, entry.ratio, entry.ratio_exponent) == (-0.153, 0.41, -0.0775)
    # Mean chip thickness at 0.1 and 0.3 of the diameter, 0.12 mm per revolution, 6 flutes.
    for bound, depth in zip(entry.chip_mm, (0.8, 2.4), strict=True):
        angle = math.acos(1 - depth / 4)
        assert bound == pytest.approx(0.02 * (1 - math.cos(angle)) / angle, abs=3e-4)


def test_every_entry_says_where_it_comes_from() -> None:
    assert len(materials()) >= 5
    for name, entry in materials().items():
        assert entry.name == name
        assert re.search(r"\b(19|20)\d\d\b", entry.source), f"{name}: no year"
        assert entry.cutter
        assert entry.description


def test_examples_load() -> None:
    assert Tool.from_toml(STEEL_TOOL).tool.number == 3
    assert paper_tool().cutting.library_entry() == materials()["al6061-t6-carbide-6"]
