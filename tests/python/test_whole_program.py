"""The verdict is of the whole program that was written: cuts left unchanged, its price, and one of five grades."""

import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import shapegcode as sg
from acceptance import PROGRAMS
from command import run
from judge import Mode, contour_error_um, interpret, play, residual_um, response
from judge.in_order import Way, deviation_um, missed_um
from shapegcode import _core
from shapegcode.conversion.outcome import recommend
from shapegcode.conversion.plan import knee_of
from shapegcode.conversion.write import RegionWriter
from shapegcode.model.machine_model import MachineModel
from shapegcode.results.outcome import Pair, Xyz
from shapegcode.shaping.grid import choose_grid
from shapegcode.verdict.figures import RegionVerdict

# Fast facets that shake, a square that rounds its corners, a slow line that does nothing.
FACETS = "".join(
    f"G1X{30 * math.cos(0.1 * i) + 0.02 * i - 30:.3f}Y{20 * math.sin(0.13 * i):.3f}F6000.\n" for i in range(200)
)
SQUARE = "G1X20.F5000.\nY20.\nX0.\nY0.\n"
SLOW = "G1X20.F200.\nY5.\n"
DENSE = "".join(f"G1X{0.5 * (i % 2) + 0.3 * i:.3f}Y{0.4 * (i % 3):.3f}F4000.\n" for i in range(60))


VX500 = sg.Machine.load("vx500")


def part(*cuts: str) -> str:
    body = "".join(f"G0X0Y0\nG1Z-1.F1000.\n{cut}G0Z5.\n" for cut in cuts)
    return f"%\nO1\nG21G17G90G94G54\nT1M6\nS8000M3\nG0X0Y0Z5.\n{body}M5\nM30\n%\n"


MIXED = part(FACETS, SLOW, SQUARE, DENSE)


def converted(text: str, machine: sg.Machine, **options: object) -> sg.Conversion:
    return sg.convert(sg.Program.from_text(text, machine, source="part.nc"), machine, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("tolerance_um", [4.0, 15.0, 30.0])
@pytest.mark.parametrize(
    "keys", [{}, {"axes.x.modes.1.frequency_uncertainty_percent": 3.0}], ids=["exact modes", "X 3 %"]
)
def test_simulate_against_the_original_gives_the_figures_of_convert(
    tolerance_um: float, keys: dict[str, object]
) -> None:
    machine = VX500.with_values({"tolerance.contour_um": tolerance_um, **keys})
    conversion = converted(MIXED, machine, leave=[(9, 9)])
    assert conversion.regions
    assert conversion.unchanged
    emitted = sg.Program.from_text(conversion.text, machine, source="out.nc")
    original = sg.Program.from_text(MIXED, machine, source="part.nc")
    simulation = sg.simulate(emitted, machine, against=original, record_samples=0)
    verdict = simulation.verdict
    assert verdict.within_tolerance == conversion.within_tolerance == simulation.ok
    for name in ("residual_vibration_um", "peak_vibration_um", "contour_error_um", "rapid_vibration_um"):
        assert getattr(verdict, name) == getattr(conversion, name), name
    counted = [case for case in conversion.cases if case.counts]
    assert [case for case in verdict.cases if case.counts] == counted
    assert verdict.worst_case == conversion.worst_case
    for ours, theirs in zip(verdict.all_cuts, conversion.all_cuts, strict=True):
        assert replace(ours, emitted_lines=(0, 0)) == replace(theirs, emitted_lines=(0, 0))


def test_a_program_against_itself_has_one_contour_error() -> None:
    machine = VX500
    program = sg.Program.read(PROGRAMS / "PARALLEL.NC", machine)
    simulation = sg.simulate(program, machine, against=program, record_samples=0)
    assert simulation.contour_error_um.command.max == simulation.verdict.contour_error_um.command.emitted.max == 0.0


def test_figures_of_the_original_do_not_depend_on_what_is_asked_for() -> None:
    asked = [
        {"tolerance.contour_um": 5.0}, {"tolerance.contour_um": 40.0}, {"shaping.family": "zvd"},
        {"emission.block_period_s": 0.008}, {"emission.rounding": "nearest", "emission.override": "any"},
    ]  # fmt: skip
    found = [converted(MIXED, VX500.with_values(keys)) for keys in asked]
    for other in found[1:]:
        for name in ("residual_vibration_um", "peak_vibration_um", "rapid_vibration_um"):
            assert getattr(other, name).original == getattr(found[0], name).original
        assert other.contour_error_um.response.original == found[0].contour_error_um.response.original


def test_a_cut_left_unchanged_that_misses_a_limit_is_in_the_first_three_lines() -> None:
    machine = VX500.with_values({"tolerance.contour_um": 15.0})
    free = converted(MIXED, machine)
    facets = free.cuts[0].lines
    conversion = converted(MIXED, machine, leave=[facets])
    assert not conversion.within_tolerance
    assert conversion.shaped_cuts_within
    assert conversion.recommendation == "better, tolerance not met"
    assert not conversion.ok
    first_three = conversion.answer.split("\n")[:3]
    assert any("lines {} to {}".format(*facets) in line and "--leave" in line for line in first_three)
    report = conversion.to_dict()
    assert report["within_tolerance"] is False
    assert report["shaped_cuts_within"] is True
    # Its figures are those of the whole program.
    assert conversion.contour_error_um.response.emitted.max == pytest.approx(free.cuts[0].contour_um.original)


def test_whole_program_figures_are_the_independent_players() -> None:
    """Shaped cuts and cuts left unchanged, by an interpreter, a player and a plant that share no code with ours."""
    # Without acceleration ramps before interpolation an original is simulated block by block, smoothed.
    machine = VX500.with_values({"controller.motion": "after_interpolation", "controller.time_constant_s": 0.024,
                            "controller.block_end": "carry", "tolerance.contour_um": 60.0})  # fmt: skip
    text = part(SQUARE, SLOW, SQUARE)
    first = converted(text, machine, shape_all=True, max_cut_time_increase_percent=1e4, max_time_increase_percent=1e4)
    conversion = converted(
        text, machine, shape_all=True, leave=[first.cuts[-1].lines], max_cut_time_increase_percent=1e4,
        max_time_increase_percent=1e4,
    )  # fmt: skip
    modes = [
        [Mode(m.frequency_hz, m.damping_ratio, m.participation) for m in axis.modes] for axis in machine.axes.as_tuple()
    ]
    ours, theirs = interpret(text).lines, interpret(conversion.text.decode()).lines
    worst_residual, nearest_um, missed = np.zeros(3), 0.0, 0.0
    for cut in conversion.all_cuts:
        programmed = [m for r in ours[cut.lines[0] - 1 : cut.lines[1]] for m in r.moves]
        blocks = [m for r in theirs[cut.emitted_lines[0] - 1 : cut.emitted_lines[1]] for m in r.moves if m.length > 0]
        is_shaped = cut in conversion.regions
        for rule in ("ceil", "carry") if is_shaped else ("carry",):
            points = play(blocks, period_s=0.001, block_end=rule, acceleration_samples=0 if is_shaped else 24)
            worst_residual = np.maximum(worst_residual, residual_um(points, modes, 0.001, still_mm=1e-9))
            _, _, moved = response(points, modes, 0.001)
            off_um = contour_error_um(moved[::10], programmed).max_um
            ahead = 20.0 * float(np.linalg.norm(np.diff(points, axis=0), axis=1).max()) + 1e-2
            way = Way.of(programmed)
            in_order = deviation_um(moved[::10], way, off_um, ahead=ahead)
            nearest_um = max(nearest_um, off_um)
            missed = max(missed, in_order, missed_um(moved[::10], way, 1.02 * in_order, ahead=ahead))
    assert conversion.unchanged
    assert conversion.regions
    report = conversion.residual_vibration_um.emitted
    np.testing.assert_allclose(worst_residual, [report.x, report.y, report.z], rtol=0.05, atol=0.3)
    reached = conversion.contour_error_um.response.emitted.max
    # Corners that the table cuts short count in full: between the nearest distance and that.
    assert 0.95 * nearest_um - 0.5 <= reached <= 1.05 * missed + 0.5


@pytest.mark.parametrize(
    ("program_percent", "cut_percent", "tolerance_um"),
    [(2.0, 25.0, 2.0), (5.0, 3.0, 6.0), (10.0, 12.0, 2.0), (10.0, 25.0, 6.0), (0.01, 50.0, 6.0)],
)
def test_nothing_costs_more_than_its_price(program_percent: float, cut_percent: float, tolerance_um: float) -> None:
    conversion = converted(
        MIXED, VX500.with_values({"tolerance.contour_um": tolerance_um}), max_time_increase_percent=program_percent,
        max_cut_time_increase_percent=cut_percent,
    )  # fmt: skip
    whole = conversion.cycle_time_s
    assert whole.emitted <= whole.original * (1.0 + program_percent / 100.0) + 1e-9
    for cut in conversion.cuts:
        assert cut.time_s.emitted <= cut.time_s.original * (1.0 + cut_percent / 100.0) + 1e-9, cut
        assert cut.is_shaped or cut.reason
    # No cut is worse than it was, whatever the price.
    for cut in conversion.cuts:
        assert cut.contour_um.emitted <= max(tolerance_um, cut.contour_um.original) * 1.001 + 0.05


def test_a_larger_price_brings_a_tighter_contour() -> None:
    machine = VX500.with_values({"tolerance.contour_um": 2.0})
    reached = [
        converted(MIXED, machine, max_time_increase_percent=percent, max_cut_time_increase_percent=percent)
        .cuts[0].contour_um.emitted
        for percent in (4.0, 12.0, 40.0, 400.0)
    ]  # fmt: skip
    assert reached == sorted(reached, reverse=True)
    assert reached[0] > 2.0 * reached[-1]


def test_the_curve_says_what_conversions_at_other_tolerances_take() -> None:
    """Each point beside a conversion of its own with that tolerance, at any price."""
    prices = {"max_time_increase_percent": 1e5, "max_cut_time_increase_percent": 1e5}
    asked = converted(MIXED, VX500.with_values({"tolerance.contour_um": 6.0}), **prices)
    curve = asked.tolerance_curve
    names = [point.name for point in curve.points]
    assert {"as asked", "1.25 times", "1.5 times", "2 times", "the original's contour error"} < {*names}
    assert "no slowing needed" in names
    assert sum(point.is_knee for point in curve.points) == 1
    increases = [point.time_increase_percent for point in curve.points]
    assert increases == sorted(increases, reverse=True)
    for point in curve.points:
        if point.tolerance_um < 16.0:
            other = converted(MIXED, VX500.with_values({"tolerance.contour_um": point.tolerance_um}), **prices)
            assert point.time_s == pytest.approx(other.cycle_time_s.emitted, rel=0.05), point


def test_planned_times_are_those_of_the_shaped_command() -> None:
    """Each tolerance planned after another one beside the shaper that gives every block out, from a cold start."""
    machine = VX500
    program = sg.Program.from_text(part(FACETS), machine)
    (region,) = program.regions
    model, grid = MachineModel(machine), choose_grid(machine)
    writer = RegionWriter(model, grid)
    tolerances = [math.inf, 0.02, 0.012, 0.008]
    options = writer.options(model.limits(), writer.tolerance(), model.offset(region))
    planned = _core.plan_tolerances(region.path, grid.fir, options, tolerances)
    times = [time_s for time_s, _ in planned]
    assert times == sorted(times)
    for tolerance_mm, (time_s, reached_mm) in zip(tolerances, planned, strict=True):
        assert reached_mm <= tolerance_mm
        cold = writer.options(model.limits(), writer.tolerance(tolerance_mm * 1e3), model.offset(region))
        shaper = _core.RegionShaper(region.path, grid.fir, [], cold)
        periods = 0
        while (piece := shaper.next(1 << 17)) is not None:
            periods += len(piece.middle_mm)
        assert time_s == pytest.approx(periods * grid.block_period_s, rel=0.04)
        assert shaper.is_slowed == (tolerance_mm < planned[0][1])


def test_the_same_motion_is_recognised_whatever_its_lines() -> None:
    one, other, faster = (
        sg.Program.from_text(part(cut), VX500).regions[0].path
        for cut in (SQUARE, SQUARE.replace("Y20.", "(A COMMENT)\nY20."), SQUARE.replace("F5000.", "F5001."))
    )
    assert one.moves_as(other) and other.moves_as(one)
    assert not one.moves_as(faster)


def test_the_knee_is_where_the_curve_bends() -> None:
    # Two straight pieces over the logarithms meet at 10: by construction the knee.
    tolerances = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]
    times = [
        100.0 / tolerance**0.9 if tolerance <= 10.0 else 12.59 / (tolerance / 10.0) ** 0.01 for tolerance in tolerances
    ]
    assert knee_of(tolerances, times) == 3
    assert knee_of(tolerances, [5.0] * 7) is None


def test_only_and_leave_choose_cuts_by_their_lines(tmp_path: Path) -> None:
    machine = VX500.with_values({"tolerance.contour_um": 15.0})
    free = converted(MIXED, machine)
    first, _, square, _ = (cut.lines for cut in free.cuts)
    only = converted(MIXED, machine, only=[square])
    assert [cut.lines for cut in only.regions] == [square]
    assert {cut.reason for cut in only.cuts if not cut.is_shaped} == {"not listed in --only"}
    (tmp_path / "part.nc").write_text(MIXED)
    lines = "{}-{}".format(*first)
    done = run(tmp_path, "convert", "part.nc", "-m", "vx500", "-o", "out.nc", "--leave", lines, "--json", "out.json",
               "--contour-tolerance", "15um")  # fmt: skip
    assert done.returncode == 1
    report = json.loads((tmp_path / "out.json").read_text())
    assert report["cuts"][0]["is_shaped"] is False
    assert (tmp_path / "out.nc").exists()


def test_verbose_lists_every_cut(tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_text(part(*[SLOW] * 15))
    for words, listed in (((), 12), (("-v",), 15)):
        done = run(tmp_path, "convert", "part.nc", "-m", "vx500", "-o", "out.nc", *words)
        assert len(re.findall(r"(?m)^\d+-\d+ ", done.stdout)) == listed
        assert ("3 more in --verbose" in done.stdout) == (listed == 12)


def cut(
    contour: Sequence[float] = (5.0, 5.0), residual: Sequence[float] = (0.0, 0.0), *, misses: Sequence[str] = (),
    worse: Sequence[str] = (),
) -> RegionVerdict:  # fmt: skip
    before, after = (Xyz(value, 0.0, 0.0) for value in residual)
    return RegionVerdict(
        (1, 9), (1, 99), Pair(1.0, 1.02), Pair(before, after), Xyz(3.0, 3.0, 3.0), contour[1], contour[0], None,
        tuple(misses), tuple(worse),
    )  # fmt: skip


WORTH, BETTER, WITHIN, NONE, NOT = (
    "worth running", "better, tolerance not met", "already within tolerance: shaping is optional",
    "no benefit: run the original", "do not run",
)  # fmt: skip
OUT = ["contour 18 um, limit 15 um"]
#                    cuts                                              within gain  benefit  grade
SITUATIONS = [
    ([cut((40.0, 12.0))], False, True, True, WORTH),
    ([cut((5.0, 5.0), (20.0, 0.5))], False, True, True, WORTH),
    ([cut((40.0, 12.0)), cut((4.0, 4.0))], False, True, True, WORTH),
    ([cut((40.0, 18.0), misses=OUT)], False, True, True, BETTER),
    ([cut((40.0, 12.0)), cut((18.0, 18.0), misses=OUT)], False, True, True, BETTER),
    ([cut((10.0, 4.0))], True, True, False, WITHIN),
    ([cut((10.0, 4.0))], True, True, True, WITHIN),
    ([cut((1.0, 1.0))], True, False, False, NONE),
    ([cut((18.0, 18.0), misses=OUT)], False, True, False, NONE),
    ([cut((18.0, 17.0), misses=OUT)], False, False, False, NONE),
    ([], True, False, False, NONE),
    ([cut((10.0, 18.0), misses=OUT, worse=OUT)], True, True, True, NOT),
    ([cut((40.0, 12.0)), cut((10.0, 18.0), misses=OUT, worse=OUT)], False, True, True, NOT),
    ([cut((40.0, 12.0), misses=["runs 20 % faster"], worse=["runs 20 % faster"])], False, True, True, NOT),
]


@pytest.mark.parametrize(("cuts", "within", "gain", "benefit", "grade"), SITUATIONS)
def test_the_grade_of_a_situation(
    cuts: Sequence[RegionVerdict], within: bool, gain: bool, benefit: bool, grade: str
) -> None:
    found, reason = recommend(cuts, original_within=within, could_gain=gain, benefit=benefit)
    assert found == grade
    assert reason


# What is converted and asked for, and the grade and exit code that it must get.
WIDE = {"tolerance.contour_um": 60.0, "tolerance.residual_floor_um": 40.0}
IMPOSSIBLE = {
    "tolerance.residual_ratio": 1e-6, "tolerance.residual_floor_um": 1e-6, "tolerance.residual_floor_increments": 0.0,
}  # fmt: skip
DEAR = {"tolerance.contour_um": 15.0, "price.cut_time_percent": 0.01}
ANSWERS: dict[str, tuple[str, dict[str, object], dict[str, object], str]] = {
    "vibrates and errs": (part(SQUARE), {"tolerance.contour_um": 15.0}, {}, WORTH),
    "everything within": (part(SQUARE), WIDE, {}, WITHIN),
    "within, and shaped all the same": (part(SQUARE), WIDE, {"shape_all": True}, WITHIN),
    "nothing to gain": (part(SLOW.replace("F200.", "F30.")), {}, {}, NONE),
    "nothing to cut": ("%\nO1\nG21G90\nG0X10.\nM30\n%\n", {}, {}, NONE),
    "a price that nothing fits": (part(SQUARE), DEAR, {}, NONE),
    "the price loosens": (MIXED, {"tolerance.contour_um": 3.0}, {}, BETTER),
    "a cut left by choice": (part(SQUARE, FACETS), {"tolerance.contour_um": 15.0}, {"leave": [(9, 12)]}, BETTER),
    "a limit that no shaping keeps": (part(SQUARE), IMPOSSIBLE, {}, BETTER),
}  # fmt: skip


@pytest.mark.parametrize("name", ANSWERS)
def test_the_answer_of_a_program(name: str) -> None:
    text, keys, options, grade = ANSWERS[name]
    conversion = converted(text, VX500.with_values(keys), **options)
    assert conversion.recommendation == grade
    assert conversion.exit_code == (1 if grade in (BETTER, NOT) else 0)
    assert conversion.is_written_as_output == (grade != NOT)
    if grade in (NONE, WITHIN) and not options:
        assert conversion.text == text.encode()
    assert conversion.answer.startswith(grade)
    verdict = {WORTH: b"(VERDICT WITHIN TOLERANCE", BETTER: b"(BETTER - TOLERANCE NOT MET"}.get(grade)
    assert verdict is None or verdict in conversion.text


def test_restart_points_are_no_change_of_the_program() -> None:
    """The modal line of a restart point names what is in force: neither an offset nor the end of a cut."""
    long = FACETS.replace("F6000.", "F600.")
    conversion = converted(
        part(long), VX500.with_values({"tolerance.contour_um": 4.0, "shaping.least_gain_um": 0.1,
                                  "emission.restart_interval_s": 2.0, "emission.restart_stops": True}),
        shape_all=True, max_time_increase_percent=1e4, max_cut_time_increase_percent=1e4,
    )  # fmt: skip
    assert len(conversion.restart_points) > 3
    assert conversion.proof.refused == ()
    assert "1 of 1 tool calls" in conversion.proof.answer


def test_shaped_rapids_stay_within_the_price_too() -> None:
    machine = VX500.with_values({"tolerance.contour_um": 15.0, "shaping.rapids": True})
    dear = converted(MIXED, machine, max_time_increase_percent=1e4, max_cut_time_increase_percent=1e4)
    assert dear.rapids is not None
    for percent in (0.5, 1.0, 2.0, 4.0):
        conversion = converted(MIXED, machine, max_time_increase_percent=percent, max_cut_time_increase_percent=1e4)
        times = conversion.cycle_time_s
        assert times.emitted <= times.original * (1.0 + percent / 100.0) + 1e-9


def test_a_cut_that_is_chosen_and_left_is_refused() -> None:
    with pytest.raises(sg.ShapegcodeError, match="--only and --leave both contain the cut in lines 8 to"):
        converted(MIXED, VX500, only=[(8, 20)], leave=[(10, 12)])


def test_what_is_not_shaped_is_written_as_it_was() -> None:
    """Calls, macros and coordinate modes too, which are expanded only to be simulated."""
    alone = "%\nO1\nG21G17G90G94G54\nG0X0Y0Z5.\n#1=2.\nG68X0Y0R30.\nG1X[#1*10.]F30.\nG69\nG0Z5.\nM30\n%\n"
    called = "%\nO1\nG21G17G90G94G54\nG0X0Y0Z5.\nM98P100\nG0Z5.\nM30\nO100\nG1X20.F30.\nX0\nM99\n%\n"
    for text in (alone, called):
        conversion = converted(text, VX500)
        assert conversion.expanded
        assert conversion.recommendation == NONE
        assert conversion.text == text.encode()
        assert conversion.bytes_emitted == len(text)


def test_rounding_by_the_control_is_told_apart_from_vibration() -> None:
    """Slow enough not to vibrate: what errs is the control's own filter, and a smaller one does the same."""
    keys = {
        "controller.motion": "after_interpolation",
        "controller.time_constant_s": 0.048,
        "tolerance.contour_um": 60.0,
    }
    slow_square = SQUARE.replace("F5000.", "F800.")
    machine = VX500.with_values(keys)
    conversion = converted(part(slow_square), machine)
    advice = conversion.advice
    assert advice.key == "controller.time_constant_s"
    assert str(advice) in conversion.answer
    # Closed form: a corner of 90 degrees behind a moving average of T is missed by T / 8 * hypot(v, w); the
    # first one is from the plunge at 1000 mm/min into the square.
    expected_um = math.hypot(1000.0, 800.0) / 60.0 * 0.048 / 8.0 * 1e3
    assert advice.rounding_um == pytest.approx(expected_um, rel=0.05)
    smaller = machine.with_values(advice.key, advice.enough_s)
    assert sg.convert(part(slow_square), smaller).recommendation == WITHIN
    # Where vibration is the cause there is no such advice.
    assert converted(part(SQUARE), VX500.with_values({"tolerance.contour_um": 15.0})).advice is None


@pytest.mark.slow
@pytest.mark.parametrize("name", ["PARALLEL.NC", "PROGRAM2.NC", "TEST_G90.NC", "TEST_G91.NC"])
def test_real_programs_stay_within_their_price(name: str) -> None:
    machine = VX500.with_values({"tolerance.contour_um": 8.0})
    conversion = sg.convert(PROGRAMS / name, machine)
    assert conversion.cycle_time_s.emitted <= 1.1 * conversion.cycle_time_s.original + 1e-9
    assert all(cut.time_s.emitted <= 1.25 * cut.time_s.original + 1e-9 for cut in conversion.cuts)
