"""The feed override and shaped text: blocks that bear a turned dial, and a dial that is locked; held by the judge."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from acceptance import convert, machine_with
from judge import durations, interpret, play, residual_um
from shapegcode.demos.path import path_program

PROGRAMS = Path(__file__).parents[1] / "golden" / "programs"
TICK = 0.001
DIAL = (0.7, 0.8, 0.9, 1.0, 1.1, 1.2)
# The path of paper 000 at 200 mm/s.
PATH = "%\nO1\nG21G17G90G94\nG54G00X0.Y0.\nG01X20.F12000\nG03X40.Y20.R20.\nG01Y40.\nG00X0.\nM30\n%\n"
LONG = "%\nO1\nG21G17G90G94\nG54G00X0.Y0.\nG01X900.F6000\nG00X0.\nM30\n%\n"
LOCK = {"emission.override": "lock"}


def cut_by_dial_um(keys: dict[str, Any]) -> list[float]:
    """Residual vibration at each position of the dial, by the judge's player and plant."""
    judged = convert(PATH, machine_with(keys))
    ((_, blocks, _),) = judged.regions()
    cuts = [move for move in blocks if move.length > 0.0]
    return [
        float(residual_um(play(cuts, period_s=TICK, override=ratio), judged.modes, TICK, still_mm=1e-9).max())
        for ratio in DIAL
    ]


def test_equal_blocks_bear_a_turned_dial() -> None:
    asked = cut_by_dial_um({})
    borne = cut_by_dial_um({"emission.override": "any"})
    assert max(asked) > 50.0, "the case that this is about"
    assert max(borne) < max(asked) / 3.0, (asked, borne)
    assert borne[DIAL.index(1.0)] < 3.0


def test_a_stated_band_asks_for_equal_blocks_too() -> None:
    machine = machine_with({"verdict.override_percent": [80.0, 110.0]})
    assert machine.bears_override
    assert machine.dial_positions == pytest.approx((0.8, 0.9, 1.0, 1.1))
    assert not machine_with({}).bears_override
    assert machine_with({"emission.override": "any"}).dial_positions[0] == pytest.approx(0.7)


def test_equal_blocks_are_equal_where_they_count_and_long_where_it_is_forgotten() -> None:
    judged = convert(LONG, machine_with({"emission.override": "any", "emission.block_period_s": 0.005}))
    ((_, blocks, _),) = judged.regions()
    ticks = durations([move for move in blocks if move.length > 0.0], period_s=TICK) / TICK
    longest = int(np.argmax(ticks))
    assert ticks[longest] > 1000.0
    # 46 Hz, damping .02: a hundredth is left after .8 s, that is 160 blocks.
    assert longest >= 160
    assert len(ticks) - longest > 160
    moving = ticks[20 : longest - 20]
    assert np.allclose(moving, 5.0, atol=1e-6)


def test_a_band_that_cannot_be_reached_is_not_paid_for() -> None:
    """A contour that is missed only with the dial turned is tried once with less room, then left as fast as it was."""
    stated = {"verdict.override_percent": [50.0, 120.0], "tolerance.contour_um": 2.0}
    judged = sg.convert(path_program(200, machine_with(stated)), machine_with(stated), shape_all=True)
    free = machine_with({"emission.override": "any", "tolerance.contour_um": 2.0})
    alone = sg.convert(path_program(200, free), free, shape_all=True)
    assert not judged.ok
    assert judged.cycle_time_s.emitted < 1.1 * alone.cycle_time_s.emitted


def test_a_lock_surrounds_every_shaped_stretch_and_gives_the_dial_back() -> None:
    machine = machine_with(LOCK)
    conversion = sg.convert(path_program(200, machine), machine, shape_all=True)
    lines = conversion.text.decode().split("\n")
    assert "(FEED OVERRIDE IS OFF IN SHAPED MOVES)" in lines
    locks = [i for i, line in enumerate(lines) if line == "#3004=[#33OR2]"]
    frees = [i for i, line in enumerate(lines) if line == "#3004=#33"]
    assert len(locks) == len(frees) == len(conversion.regions)
    for region, lock, free in zip(conversion.regions, locks, frees, strict=True):
        assert lines[lock - 1] == "#33=#3004"
        assert lines[free - 1] == "G53"  # not read past before the moves are done
        assert lines[lock - 2] == "(SHAPED)"
        assert (lock, free) == (region.emitted_lines[0] + 1, region.emitted_lines[1] - 1)
        # Nothing between them ends, stops or leaves the program.
        assert not any(re.search(r"M(?:0?[012]|30|98|99)(?!\d)", line) for line in lines[lock + 1 : free - 1])
    # Without these lines it is the text of the machine without a lock.
    inserted = {"#33=#3004", "#3004=[#33OR2]", "G53", "#3004=#33"}
    left = [line for line in lines if line not in inserted and not re.search("OVERRIDE|CHECKSUM", line)]
    plain = sg.convert(path_program(200, machine_with({})), machine_with({}), shape_all=True).text.decode()
    assert left == [line for line in plain.split("\n") if not re.search("OVERRIDE|CHECKSUM", line)]
    assert interpret("\n".join(left)).lines


def test_a_locked_dial_has_no_cases_and_leaves_what_it_leaves_at_100() -> None:
    machine = machine_with({**LOCK, "verdict.override_percent": [50.0, 120.0]})
    conversion = sg.convert(path_program(200, machine), machine, shape_all=True)
    assert all(case.override == 1.0 for case in conversion.cases)
    nominal = max(case.residual_um.x for case in conversion.cases[:2])
    assert {each.residual_um.x for each in conversion.override_residual} == {nominal}


def test_the_builders_own_codes_lock_where_macros_cannot() -> None:
    own = {"emission.lock_lines": ["M49"], "emission.unlock_lines": ["M48"]}
    machine = machine_with({**LOCK, **own, "controller.dnc_baud": 19200})
    text = sg.convert(path_program(200, machine), machine, shape_all=True).text.decode()
    assert text.count("\nM49\n") == text.count("\nM48\n") == 2
    assert "#" not in text


@pytest.mark.parametrize(
    ("keys", "why"),
    [({"controller.dnc_baud": 19200}, "controller.dnc_baud = 19200"), ({"controller.macros": False}, "macros = false")],
)
def test_a_lock_is_refused_where_no_variable_can_be_set(keys: dict[str, Any], why: str) -> None:
    with pytest.raises(sg.MachineError, match=re.escape(why)):
        machine_with({**LOCK, **keys})


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ({"emission.lock_lines": []}, "emission.lock_lines"),
        ({"emission.unlock_lines": []}, "emission.unlock_lines"),
        ({"emission.prologue": ["#33=5", "G08P0"]}, "uses #33"),
        ({"shaping.rapids": True}, "shaping.rapids"),
    ],
)
def test_a_lock_that_could_not_be_given_back_is_refused(keys: dict[str, Any], why: str) -> None:
    with pytest.raises(sg.MachineError, match=re.escape(why)):
        machine_with({**LOCK, **keys})


def worst_override(conversion: sg.Conversion) -> tuple[float, str]:
    """The other override at which a figure is largest relative to its limit, and how the note states the figure."""
    residual_limits = [conversion.residual_limit_um(axis) or 0.0 for axis in "xyz"]
    limits = [*residual_limits, conversion.limits.contour_um]
    ratios = []
    for case in conversion.cases:
        if case.override != 1.0:
            figures = [*(case.residual_um[axis] for axis in "xyz"), case.contour_error_um.response or 0.0]
            pairs = [(now / limit, now, limit) for now, limit in zip(figures, limits, strict=True) if limit]
            ratios.append((*max(pairs), case.override))
    _, now, limit, override = max(ratios)
    return override, f"is {now:.1f} µm, limit {limit:.1f} µm"


def test_the_note_on_the_override_is_about_the_contour_where_that_is_worst() -> None:
    conversion = sg.convert(PROGRAMS / "CONTOUR_R.NC", "vx500", shape_all=True)
    notes = {note.topic: note.text for note in conversion.at_the_control}
    override, text = worst_override(conversion)
    assert f"at {override * 100:.0f} % the contour error of the machine table {text}" in notes["override"]


def test_the_operator_reads_the_worst_position_and_where_to_begin_again() -> None:
    machine = machine_with({})
    conversion = sg.convert(path_program(200, machine), machine, shape_all=True)
    notes = {note.topic: note.text for note in conversion.at_the_control}

    override, text = worst_override(conversion)
    assert f"at {override * 100:.0f} % the residual vibration" in notes["override"] and text in notes["override"]
    locked = machine_with(LOCK)
    conversion = sg.convert(path_program(200, locked), locked, shape_all=True)
    lines = conversion.text.decode().split("\n")
    restart = next(note.text for note in conversion.at_the_control if note.topic == "restart")
    for line in map(int, re.findall(r"line (\d+)", restart)):
        assert lines[line - 1] == "#33=#3004"
        assert lines[line - 2] == "(SHAPED)"


def test_a_locked_program_is_not_expanded_and_own_marks_are_refused() -> None:
    machine = machine_with(LOCK)
    conversion = sg.convert(path_program(200, machine), machine, shape_all=True)
    emitted = sg.Program.from_text(conversion.text, machine, source="shaped.nc")
    with pytest.raises(sg.ProgramError, match="lock the feed override"):
        sg.expand(emitted, machine)
    text = PATH.replace("G00X0.\nM30", "G00X0.\n(SHAPED)\nM30")
    with pytest.raises(sg.ProgramError, match=r"part\.nc:9:1: the comment \(SHAPED\)"):
        sg.convert(sg.Program.from_text(text, machine, source="part.nc"), machine)
