"""What a conversion says of itself: answer, tables, next step, JSON, and the options that override machine keys."""

import functools
from dataclasses import replace
from typing import Any

import jsonschema
import pytest

import shapegcode as sg
from acceptance import machine_with
from shapegcode.conversion.tables import BeforeAfter, Sensitivity, sensitivity_table
from shapegcode.results.json import schema
from shapegcode.results.outcome import Pair, Xyz
from shapegcode.verdict.figures import RegionVerdict, case_table

PART = "%\nO1\nG21G17G90G94\nG54G00X0Y0Z0\nG01X20.F12000\nG03X40.Y20.I0J20.\nG01Y40.\nM30\n%\n"
TWO = PART.replace("M30", "G00X0Y0\nG01X30.F3000\nM30")


@functools.cache
def converted(text: str = PART, **options: Any) -> sg.Conversion:
    machine = machine_with()
    return sg.convert(
        sg.Program.from_text(text.encode(), machine, source="part.nc"), machine, **({"shape_all": True} | options)
    )


def rows(conversion: sg.Conversion) -> dict[str, BeforeAfter]:
    return {row.figure: row for row in conversion.tables()[0].rows}


def test_the_answer_is_the_verdict_with_the_figures_of_the_json() -> None:
    conversion = converted()
    report = conversion.to_dict()
    was, now = (report["residual_vibration_um"][side]["x"] for side in ("original", "emitted"))
    assert conversion.answer.startswith(f"worth running: residual vibration X {was:.1f} → {now:.1f} µm, contour ")
    both = report["contour_error_um"]["response"]
    assert f"contour {both['original']['max']:.1f} → {both['emitted']['max']:.1f} µm" in conversion.answer
    time = report["cycle_time_s"]
    assert conversion.answer.endswith(f"time {100 * (time['emitted'] / time['original'] - 1):+.1f} %")
    assert repr(conversion) == f"<Conversion: {conversion.answer}>"
    assert (conversion.ok, conversion.exit_code) == (True, 0)


def test_every_kind_of_conversion_has_the_json_of_its_schema() -> None:
    for conversion in (
        converted(),
        converted(TWO, rapids=True),
        converted(budget=sg.Budget(max_bytes=10**6)),
        converted("%\nG90G21\nG0X10.Y0Z0\nM30\n%\n"),
    ):
        report = conversion.to_dict()
        jsonschema.validate(report, schema(sg.Conversion))
        assert ("budget" in report) == (conversion.budget is not None)
        assert ("rapids" in report) == (conversion.rapids is not None)
        assert "text" not in report and "model" not in report


def test_the_table_sets_original_against_emitted() -> None:
    conversion = converted()
    found = rows(conversion)
    times = conversion.cycle_time_s
    assert found["cycle time"].change == f"{100 * (times.emitted / times.original - 1):+.1f} %"
    assert found["residual vibration X"].limit == conversion.regions[0].residual_limit_um.x
    assert "residual vibration Z" not in found
    assert found["contour error of the command, largest"].change == ""  # nothing to compare with
    assert found["contour error of the command, largest"].limit is None
    assert found["contour error of the machine table, largest"].limit == 20.0  # what `shaping.contour` names
    assert found["size of the program"].emitted == len(conversion.text)
    assert found["orbit error of the command"].emitted == conversion.orbit_error_percent[0]
    text = str(conversion.tables()[0])
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize(
    ("unit", "original", "emitted", "change"),
    [("µm", 0.4, 1.1, ""), ("µm", 2.0, 1.0, "-50.0 %"), ("s", 0.0004, 2.0, ""), ("s", 4.0, 4.001, "0 %")],
)
def test_percentages_of_next_to_nothing_are_blank(unit: str, original: float, emitted: float, change: str) -> None:
    assert BeforeAfter("x", unit, original, emitted, 3).change == change


def with_residuals(*regions: tuple[float, float]) -> sg.Conversion:
    """A conversion whose regions leave so much of X, each with its limit."""

    def verdict(emitted: float, limit: float) -> RegionVerdict:
        (region, *_) = converted().regions
        residual = Pair(region.residual_vibration_um.original, Xyz(emitted, 0.0, 0.0))
        return replace(region, residual_vibration_um=residual, residual_limit_um=Xyz(limit, limit, limit))

    return replace(converted(), regions=tuple(verdict(*each) for each in regions))


def test_the_limit_is_that_of_the_region_shown() -> None:
    assert rows(with_residuals((1.0, 9.0), (4.0, 5.0)))["residual vibration X"].limit == 5.0


def test_nothing_to_shape_is_one_line() -> None:
    air = converted("%\nG90G21\nG0X10.Y0Z0\nM30\n%\n")
    assert air.answer == "no benefit: run the original: there is nothing to shape; the program is unchanged"
    assert air.tables() == [] and dict(air.plots()) == {}
    assert air.next_step.startswith("run the original")
    given_up = converted(budget=sg.Budget(max_bytes=len(PART)))
    assert given_up.answer.startswith("no benefit: run the original: nothing fits the budget; residual vibration ")


def test_the_next_step_follows_the_verdict() -> None:
    good = replace(converted(), warnings=())
    assert good.next_step.startswith("run the emitted program")
    assert replace(good, warnings=("w",)).next_step.startswith("resolve the warnings")
    wrong = replace(good.regions[0], lines=(3, 9), misses=("contour error too large",))
    bad = replace(good, regions=(wrong,), recommendation="do not run", reason="lines 3 to 9: contour error too large")
    assert (bad.ok, bad.exit_code, bad.within_tolerance) == (False, 1, False)
    assert bad.answer.startswith("do not run, OUT OF TOLERANCE: ")
    assert bad.next_step.startswith("do not run it (lines 3 to 9: contour error too large)")


@pytest.mark.parametrize(
    ("options", "keys"),
    [
        ({"contour": "command"}, {"shaping.contour": "command"}),
        ({"contour_tolerance_um": 1}, {"tolerance.contour_um": 1.0}),
        ({"shaper": "zvd"}, {"shaping.family": "zvd"}),
        ({"per_axis": True}, {"shaping.per_axis": True}),
        ({"arc_feed_ratio": 0.5}, {"shaping.arc_feed_ratio": 0.5}),
    ],
)
def test_an_option_is_a_key_of_the_machine_file(options: dict[str, Any], keys: dict[str, Any]) -> None:
    machine = machine_with(keys)
    stated = sg.convert(sg.Program.from_text(PART.encode(), machine, source="part.nc"), machine, shape_all=True)
    assert converted(**options).text == stated.text != converted().text


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"contour_tolerance_um": -5}, "tolerance.contour_um"),
        ({"contour": "table"}, "shaping.contour"),
        ({"shaper": "fast"}, "shaping.family"),
        ({"arc_feed_ratio": 0.0}, "shaping.arc_feed_ratio"),
    ],
)
def test_an_option_is_checked_as_a_key_of_the_machine_file(options: dict[str, Any], said: str) -> None:
    with pytest.raises(sg.MachineError, match=said):
        converted(**options)


def test_what_a_verdict_rests_on_fits_80_columns_without_a_broken_word() -> None:
    longest = Sensitivity(
        "controller.interpolation_period_s", "0.001 s", "inherited", "longer: buffer underrun 20 ms",
        "contour error of the machine table", 12.3, 279.8, 20.0,
    )  # fmt: skip
    law = replace(longest, key="controller.motion", value="after_interpolation", origin="assumed")
    lines = str(sensitivity_table([longest, law], 6)).splitlines()
    assert max(map(len, lines)) <= 80 and len(lines) <= 10
    words = {word for line in lines for word in line.split()}
    assert {longest.key, "inherited", "after_interpolation", "contour", "279.8", "20.0", "limit", "underrun"} <= words
    assert any("20 ms" in line for line in lines)


def test_an_override_stays_on_the_line_of_its_percent() -> None:
    conversion = converted()
    case = conversion.cases[0]
    crowded = replace(case, name="override 110 %", share_of_limit=45.67, residual_um=Xyz(234.56, 234.56, 234.56))
    text = str(case_table([crowded], None))
    assert "override 110 %" in text and max(map(len, text.splitlines())) <= 80
    # Nor is "100 %" said of what is out of its limit.
    assert ">\xa0100" in str(case_table([replace(case, share_of_limit=1.003, within=False)], None))
