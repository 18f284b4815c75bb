"""Commands that are given an emitted program say of it what the conversion said."""

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import shapegcode as sg
from shapegcode.machine.programs import ANY_PRICE

PART = (
    "%\nO1\nG21G17G90G94\nG54G00X0Y0Z5.\nG01Z-1.F300\nX40.F6000\nY30.\nG03X20.Y50.I-20.J0.\nG00Z5.\nX0Y0\nG01X.5F60\n"
    "G00X60.Y0\nG04P200\nG61\nG01X90.F4000\nG64\nG00X0Y0\nM30\n%\n"
)


@pytest.fixture(scope="module")
def machine() -> sg.Machine:
    return sg.Machine.load("vx500")


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("agreement") / "part.nc"
    path.write_text(PART)
    return path


@pytest.fixture(scope="module")
def conversion(original: Path, machine: sg.Machine) -> sg.Conversion:
    return sg.convert(original, machine)


@pytest.fixture(scope="module")
def emitted(conversion: sg.Conversion, original: Path) -> Path:
    path = original.with_name("shaped.nc")
    path.write_bytes(conversion.text)
    return path


def simulated(path: Path, original: Path, machine: sg.Machine) -> tuple[sg.CycleTime, sg.Simulation]:
    return sg.cycle_time(path, machine), sg.simulate(path, machine, record_samples=0, against=original)


@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"controller.in_position": "servo_lag"},
        {"controller.block_end": "carry"},
        {"emission.prefill_dwell_s": 0.3, "controller.shaped_time_constant_s": 0.02},
        {"shaping.rapids": True},
        {"emission.prologue": ["G05.1Q0"], "emission.epilogue": ["G05.1Q1"]},
        {"emission.override": "lock"},
    ],
    ids=["plain", "servo lag", "carry", "prefill and filter", "rapids", "prologue", "lock"],
)
def test_every_command_says_what_convert_said(keys: dict[str, Any], original: Path, tmp_path: Path) -> None:
    machine = sg.Machine.load("vx500").with_values(ANY_PRICE | keys)
    conversion = sg.convert(original, machine)
    assert conversion.placed and conversion.kept, "the case needs regions of both kinds"
    path = tmp_path / "shaped.nc"
    path.write_bytes(conversion.text)
    time, simulation = simulated(path, original, machine)
    tick_s = machine.controller.interpolation_period_s
    for said_s in (time.cycle_time_s, time.full_interpolation_s, simulation.cycle_time_s):
        assert said_s == pytest.approx(conversion.cycle_time_s.emitted, abs=0.01 * tick_s)
    assert sg.cycle_time(original, machine).cycle_time_s == pytest.approx(conversion.cycle_time_s.original, abs=1e-9)
    shaped = simulation.of_shaped
    assert shaped is not None and shaped.regions == len(conversion.placed)
    verdict = simulation.verdict
    assert verdict is not None and verdict.region_time_s() == conversion.cutting_time_s
    assert shaped.cutting_time_s == pytest.approx(sum(cut.time_s.emitted for cut in conversion.regions), abs=1e-9)
    for figure in ("residual_vibration_um", "peak_vibration_um", "contour_error_um", "rapid_vibration_um"):
        assert getattr(verdict, figure) == getattr(conversion, figure)
    regions = [run for run in simulation.regions if run.shaped and not run.was_rapid]
    for run, region in zip(regions, conversion.regions, strict=True):
        assert run.residual_vibration_um == region.residual_vibration_um.emitted
        assert run.time_s == region.time_s.emitted


def test_time_is_that_of_the_words(machine: sg.Machine, tmp_path: Path) -> None:
    """Every block of a line along X lasts ceil(l / (F T)) periods: counted from the words alone."""
    path = tmp_path / "line.nc"
    text = "%\nO1\nG21G17G90G94\nG00X0Y0Z0\nG01X60.F6000\nM30\n%\n"
    path.write_bytes(sg.convert(sg.Program.from_text(text, machine), machine).text)
    tick_s = machine.controller.interpolation_period_s
    ticks, x, feed = 0, 0.0, 0.0
    lines = path.read_text().splitlines()
    for line in lines[lines.index("(SHAPED)") + 2 : lines.index("M30")]:
        match = re.fullmatch(r"(?:X([\d.]+))?(?:F([\d.]+))?", line)
        assert match is not None, line
        feed = float(match[2]) if match[2] else feed
        if match[1]:
            length, x = float(match[1]) - x, float(match[1])
            ticks += math.ceil(length / (feed / 60.0 * tick_s) - 1e-9)
    assert x == 60.0 and ticks > 600
    (region,) = sg.cycle_time(path, machine).regions
    assert region.duration_s == pytest.approx(ticks * tick_s, abs=1e-9)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace(b"\n", b"\r\n"),
        lambda text: text.replace(b"\n", b"\n\r\r"),
        lambda text: re.sub(rb"(?m)^(?=[XYZG])", b"N7 ", text),
        lambda text: re.sub(rb"(?m)^X", b" X ", text).replace(b"O1\n", b"O0777(COPY)\n"),
        lambda text: text.replace(b"M30", b"(THE END)\nM30"),
        lambda text: text.replace(b"%\n", b""),
        lambda text: text.replace(b"(CHECKSUM ", b"(TEXT "),
    ],
    ids=["CR LF", "LF CR CR", "N words", "blanks and O", "a comment", "without %", "an older header"],
)
def test_what_a_control_changes_in_passing_is_no_edit(
    change: Callable[[bytes], bytes], conversion: sg.Conversion, original: Path, machine: sg.Machine, tmp_path: Path
) -> None:
    path = tmp_path / "punched.nc"
    path.write_bytes(change(conversion.text))
    time, simulation = simulated(path, original, machine)
    assert not [warning for warning in time.warnings if "changed since" in warning]
    assert time.cycle_time_s == pytest.approx(conversion.cycle_time_s.emitted, abs=1e-9)
    assert simulation.verdict.residual_vibration_um == conversion.residual_vibration_um


def test_an_edit_is_noticed_and_said_by_every_command(
    conversion: sg.Conversion, machine: sg.Machine, tmp_path: Path
) -> None:
    path = tmp_path / "edited.nc"
    path.write_bytes(conversion.text.replace(b"F6000.", b"F4000.", 1))
    assert path.read_bytes() != conversion.text
    for result in (
        sg.cycle_time(path, machine),
        sg.simulate(path, machine, record_samples=0),
        sg.measure(path, machine, 10.0).programs[0],
    ):
        assert any("changed since it was shaped" in warning for warning in result.warnings)
    assert "edited" in [finding.code for finding in sg.check(path, machine).findings]


@pytest.mark.parametrize(
    ("keys", "code", "words"),
    [
        ({"name": "KIMM"}, "other_machine", "machine: VX500 in the program, KIMM here"),
        ({"axes.x.modes": [{"frequency_hz": 47.0, "damping_ratio": 0.02}]}, "other_machine", "X 47 HZ"),
        ({"controller.shaped_time_constant_s": 0.1}, "other_machine", "100 MS here"),
        ({"emission.block_period_s": 0.008}, "other_period", "emission.block_period_s is 8 ms here"),
        ({"controller.interpolation_period_s": 0.002}, "other_period", "not a whole number"),
        ({"controller.block_time_s": 0.008}, "other_period", "needs 8 ms for a block"),
    ],
)
def test_another_machine_is_noticed(
    keys: dict[str, Any], code: str, words: str, emitted: Path, machine: sg.Machine
) -> None:
    other = machine.with_values(keys)
    assert any(words in warning for warning in sg.cycle_time(emitted, other).warnings)
    assert [
        finding for finding in sg.check(emitted, other).findings if finding.code == code and words in finding.message
    ]


def test_check_finds_no_fault_with_our_blocks(emitted: Path, machine: sg.Machine) -> None:
    checked = sg.check(emitted, machine)
    assert checked.short_blocks is not None and checked.short_blocks.count == 0
    assert not [finding for finding in checked.findings if finding.severity != "note"]
    # On a control that is too slow for them the same blocks are short.
    slow = sg.check(emitted, machine.with_values({"controller.block_time_s": 0.008}))
    assert slow.short_blocks is not None and slow.short_blocks.count > 10


def test_contour_says_against_what(emitted: Path, original: Path, machine: sg.Machine) -> None:
    alone = sg.simulate(emitted, machine, record_samples=0)
    assert alone.measured_against == alone.program
    assert "against its own blocks" in alone.answer and "--against ORIGINAL" in alone.next_step
    beside = sg.simulate(emitted, machine, record_samples=0, against=original)
    assert beside.measured_against == str(original) and "own blocks" not in beside.answer


def test_emitted_programs_are_not_shaped_twice(emitted: Path, machine: sg.Machine) -> None:
    with pytest.raises(sg.ProgramError, match="already shaped by shapegcode"):
        sg.convert(emitted, machine)
