"""FLIN: blocks whose feed is linear along their path, against an ODE solver, and read back by the Siemens reader."""

import math
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import shapegcode as sg
from acceptance import machine_with, moves_of
from judge import residual_um
from linear_feed_reader import command, cuts_with_flin
from shapegcode import _core
from shapegcode.machine.programs import ANY_PRICE
from shapegcode.program.foreign.siemens import read_siemens
from test_planner_models import MODES

PATH = "G21G90\nG00X0.Y0.Z0.\nG01X20.F10000.\nG03X40.Y20.R20.\nG01Y40.\nG04P500\nM30\n"  # paper 000's
KEYS = {
    **ANY_PRICE,
    "axes.x.modes": [{"frequency_hz": 46.0, "damping_ratio": 0.02}],
    "axes.y.modes": [{"frequency_hz": 131.0, "damping_ratio": 0.02}],
    "axes.z.rigid": True,
    "emission.dialect": "siemens",
}


@cache
def converted(form: str, text: str = PATH) -> sg.Conversion:
    machine = sg.Machine.of("kimm004").with_values({**KEYS, "emission.feed_form": form})
    return sg.convert(text, machine, shape_all=True)


SPEEDS = [(10.0, 20.0), (20.0, 10.0), (100.0, 101.0), (50.0, 50.0), (1.0, 200.0), (200.0, 1.0)]


@pytest.mark.parametrize(("start", "end"), SPEEDS)
def test_time_and_distance_against_quadrature(start: float, end: float) -> None:
    length = 3.7
    time_s = _core.linear_duration_s(length, start, end)
    assert time_s == pytest.approx(quad(lambda s: 1.0 / (start + (end - start) * s / length), 0.0, length)[0], rel=1e-9)
    found = [_core.linear_distance_mm(length, start, end, t) for t in (0.0, time_s)]
    assert found == pytest.approx([0.0, length], abs=1e-9)
    half_s = brentq(lambda t: _core.linear_distance_mm(length, start, end, t) - 0.5 * length, 0.0, time_s)
    assert half_s == pytest.approx(_core.linear_duration_s(0.5 * length, start, 0.5 * (start + end)), rel=1e-9)
    assert _core.linear_end_speed(length, start, time_s) == pytest.approx(end, rel=1e-6)


def test_what_no_speed_can_do() -> None:
    for length, start, time_s in ((1.0, 10.0, 1e6), (0.0, 10.0, 1.0), (1.0, 0.0, 1.0)):
        assert _core.linear_end_speed(length, start, time_s) is None


def test_positions_of_arcs_and_lines() -> None:
    line = _core.LinearBlock(np.array([3.0, 0.0, 0.0]), 3.0, 60.0, 180.0)
    arc = _core.LinearBlock(np.array([5.0, 2.0, 0.0]), math.pi, 180.0, 180.0, 2.0, math.pi / 2.0)
    times = np.array([0.0, line.duration_s, line.duration_s + 0.5 * arc.duration_s, 99.0])
    found = _core.linear_positions_mm(np.zeros(3), [line, arc], times)
    middle = [3.0 + 2.0 * math.sin(math.pi / 4.0), 2.0 - 2.0 * math.cos(math.pi / 4.0), 0.0]
    assert np.allclose(found, [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], middle, [5.0, 2.0, 0.0]], atol=1e-12)


def test_fewer_blocks_the_same_command_and_no_vibration() -> None:
    constant, linear = converted("constant"), converted("linear")
    cuts = {name: cuts_with_flin(each.text.decode()) for name, each in (("constant", constant), ("linear", linear))}
    (many,), (few,) = cuts["constant"], cuts["linear"]
    assert len(few) < 0.7 * len(many) and linear.blocks.emitted == constant.blocks.emitted - len(many) + len(few)
    assert np.array_equal(few[-1].end, many[-1].end)
    # The blocks of constant feed last whole periods, at whose ends the command is the shaped one.
    period_s = constant.block_period_s
    ends, points = [0.0], [many[0].start]
    for block in many:
        ends.append(ends[-1] + period_s * max(1, round(block.length / block.feed * 60.0 / period_s)))
        points.append(block.end)
    moved = command(few, period_s)  # by an ODE solver, from the text
    for time_s, point in zip(ends[:-1], points[:-1], strict=True):
        assert np.linalg.norm(moved[round(time_s / period_s)] - point) < 1.5e-3
    left = residual_um(command(few, 0.0005), MODES, 0.0005)
    assert left[0] < 0.1 and left[1] < 0.1


def test_header_and_answer_say_that_it_was_not_tried() -> None:
    linear = converted("linear")
    text = linear.text.decode()
    assert "; FEED LINEAR ALONG BLOCKS FLIN - NOT TRIED ON A CONTROL" in text
    assert any("FLIN" in warning and "not tested on a control" in warning for warning in linear.warnings)
    assert text.count("FLIN ") <= text.count("FNORM") + 1 and text.rstrip().endswith("M30")
    assert "FLIN" not in converted("constant").text.decode()


def test_the_siemens_reader_reads_it_back() -> None:
    """FLIN becomes blocks of constant feed whose motion stays near the linear law."""
    text = converted("linear").text.decode()
    few = cuts_with_flin(text)[0]
    machine = machine_with({"input.tool_change_unknown_axes": ""}, "kimm004")
    program = sg.Program.from_text(read_siemens(text, file="x.mpf", machine=machine).text, machine)
    moves = [segment for segment, dwell in moves_of(program) if not dwell]
    ends = np.cumsum([each.length_mm / each.feed_mm_per_s for each in moves])
    shares = np.linspace(0.0, 1.0, 101)[1:]
    times = np.concatenate([[0.0], *(end - (1.0 - shares) * (end - begin) for begin, end in pairwise([0.0, *ends]))])
    points = np.array(
        [moves[0].start_mm, *(each.point_at(each.length_mm * share) for each in moves for share in shares)]
    )
    tick_s = 0.001
    known = command(few, tick_s)
    total_s = sum(_core.linear_duration_s(block.length, block.before / 60.0, block.feed / 60.0) for block in few)
    assert times[-1] == pytest.approx(total_s, abs=5e-6)
    clock = np.arange(len(known) - 1) * tick_s
    read = np.stack([np.interp(clock, times, points[:, k]) for k in range(3)], axis=1)
    assert np.linalg.norm(read - known[:-1], axis=1).max() < 2e-3  # 0.9 of it: ends of pieces are rounded to 1 um


@pytest.mark.parametrize("dialect", ["fanuc", "haas", "linuxcnc", "isg"])
def test_refused_elsewhere(dialect: str) -> None:
    with pytest.raises(sg.MachineError, match=f'dialect = "{dialect}": no word for a feed linear along a block'):
        sg.Machine.of("kimm004").with_values({"emission.dialect": dialect, "emission.feed_form": "linear"})


def test_cuts_in_steps_stay_constant() -> None:
    text = PATH.replace("G01X20.F10000.", "G91\nG01X20.F10000.").replace(
        "G03X40.Y20.R20.\nG01Y40.", "G03X20.Y20.R20.\nG01Y20."
    )
    linear = converted("linear", text)
    if b"G91 G94" in linear.text:  # steps are written as steps
        assert b"FLIN X" not in linear.text and any("constant feed" in each for each in linear.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["CONTOUR_R.NC", "VINT_360arc.NC"])
def test_real_programs(name: str) -> None:
    source = (Path(__file__).parents[1] / "golden" / "programs" / name).read_text()
    words = {"emission.words": {"G28": "", "G49": "", "M01": "", "G43": "D1"}}
    conversions = {}
    for form in ("constant", "linear"):
        machine = sg.Machine.of("kimm004").with_values({**KEYS, **words, "emission.feed_form": form})
        conversions[form] = cuts_with_flin(sg.convert(source, machine, shape_all=True).text.decode())
    for many, few in zip(conversions["constant"], conversions["linear"], strict=True):
        assert len(few) <= len(many) and np.array_equal(few[-1].end, many[-1].end)
        assert residual_um(command(few, 0.001), MODES, 0.001)[:2].max() < 1.5
