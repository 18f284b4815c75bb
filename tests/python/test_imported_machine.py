"""A machine imported from a parameter dump, held against a simulation that knows the dump and not our reading of it."""

import numpy as np
import pytest

import shapegcode as sg
from acceptance import BLOCK_ENDS, convert
from judge import Mode, contour_error_um, play, residual_um, response, starts

TICK_S = 0.001

DUMP = """%
N00020Q1P4
N00103Q1P12
N01013Q1A1P00000000A2P00000000A3P00000000
N01420Q1A1P24000.0A2P24000.0A3P24000.0
N01430Q1A1P10000.0A2P10000.0A3P10000.0
N01610Q1A1P{bits}A2P{bits}A3P{bits}
N01620Q1A1P170A2P170A3P170
N01622Q1A1P{ms}A2P{ms}A3P{ms}
N01660Q1A1P2000.0A2P2000.0A3P2000.0
N01769Q1L1P24
N01772Q1L1P48
%
"""
#: Entered and left along the tangent, as a ball bar's circle is: what is left is what the circle itself shows.
BALL_BAR = "%\nO0001\nG21G90G17\nG0X-60.Y50.\nG1X0F4000\nG2J-50.\nG1X60.\nM30\n%\n"
MODE = Mode(46.0, 0.02, 1.0)


def imported(ms: int, bits: str) -> sg.Machine:
    """The dump's machine with one measured mode, and room enough for its filter to show."""
    found = sg.import_parameters(DUMP.format(ms=ms, bits=bits).encode(), source="HM2_CNC-PARA.TXT")
    mode = {"frequency_hz": MODE.frequency_hz, "damping_ratio": MODE.damping_ratio, "participation": 1.0}
    return found.machine.with_values({"axes.x.modes": [mode], "tolerance.contour_um": 120.0})


def smoothed(points: np.ndarray, ms: int, bits: str) -> np.ndarray:
    """Set-points behind the filter of 1622 and 1610: a moving average, or a first-order lag."""
    if bits == "00000001":
        weights = np.full(ms, 1.0 / ms)
    else:
        weights = np.exp(-TICK_S * np.arange(20 * ms) / (ms * TICK_S))
        weights /= weights.sum()
    ahead = np.repeat(points[:1], len(weights) - 1, axis=0)
    behind = np.repeat(points[-1:], len(weights) - 1, axis=0)
    padded = np.concatenate([ahead, points, behind])
    return np.stack([np.convolve(padded[:, axis], weights, mode="valid") for axis in range(3)], axis=1)


@pytest.mark.parametrize(("ms", "bits"), [(100, "00000001"), (24, "00000001"), (40, "00000000")])
def test_ball_bar_circle_with_the_filter_of_1622(ms: int, bits: str) -> None:
    """Report and simulation agree within 5 %: contour error of the machine table, and residual vibration."""
    judged = convert(BALL_BAR, imported(ms, bits))
    report = judged.conversion.to_dict()
    modes = [[MODE], [], []]
    contour, residual = [], []
    for programmed, blocks, _ in judged.regions():
        cuts = [move for move in blocks if move.length > 0.0]
        for rule in BLOCK_ENDS:
            points = play(cuts, period_s=TICK_S, block_end=rule, acceleration_samples=0)
            points = smoothed(points + np.round(starts(programmed)[0] - points[0], 2), ms, bits)
            _, _, moved = response(points, modes, TICK_S)
            over = (len(moved) - 1) // (len(points) - 1)
            contour.append(contour_error_um(moved[::over], programmed)[0])
            residual.append(residual_um(points, modes, TICK_S, still_mm=1e-7)[0])
    theirs = report["contour_error_um"]["response"]["emitted"]["max"]
    assert max(contour) > 2.0, "the case must show the filter"
    assert theirs == pytest.approx(max(contour), rel=0.05), (theirs, max(contour))
    assert report["residual_vibration_um"]["emitted"]["x"] == pytest.approx(max(residual), rel=0.05, abs=0.2)


LOOP = "%\nO0001\nG21G90G17\nG0X0Y0\n#1=0\nWHILE[#1LT3]DO1\nG1X[#1*10.]F500\n#1=#1+1\nEND1\nM30\n%\n"


@pytest.mark.parametrize(("channel", "alarm"), [(17, False), (4, False), (0, True)])
def test_a_loop_is_an_alarm_only_where_programs_come_over_a_serial_line(channel: int, alarm: bool) -> None:
    """A dump holds 0103 whether the line is used or not; 0020 says where programs come from."""
    text = DUMP.format(ms=24, bits="00000001").replace("N00020Q1P4", f"N00020Q1P{channel}")
    found = sg.check(LOOP, sg.import_parameters(text.encode(), source="HM2.TXT").machine)
    assert ("macro_in_dnc" in [each.code for each in found.findings]) == alarm


def test_look_ahead_that_is_on_at_the_start_is_left_and_may_be_left_on() -> None:
    text = DUMP.format(ms=24, bits="00000001").replace("N01610", "N01604Q1P00000001\nN01610")
    found = sg.import_parameters(text.encode(), source="HM2.TXT").machine
    mode = {"frequency_hz": MODE.frequency_hz, "damping_ratio": MODE.damping_ratio}
    judged = convert(BALL_BAR, found.with_values({"axes.x.modes": [mode], "tolerance.contour_um": 120.0}))
    lines = judged.emitted.splitlines()
    off, on = lines.index("G05.1Q0"), lines.index("G05.1Q1")
    cuts = [place for place, line in enumerate(lines) if "F" in line and place > lines.index("G0X-60.Y50.")]
    assert off < cuts[0] < cuts[-1] < on
    (case,) = [each for each in judged.conversion.cases if each.look_ahead]
    assert case.counts


def test_a_tool_change_that_is_a_macro_is_a_call() -> None:
    text = DUMP.format(ms=24, bits="00000001").replace("N01610", "N06071Q1P6\nN01610")
    machine = sg.import_parameters(text.encode(), source="HM2.TXT").machine
    program = sg.Program.from_text("%\nO0001\nG21G90G17\nG0X0Y0\nT1M6\nG0X0Y0\nG1X10.F500\nM30\n%\n", machine)
    assert any("9001" in warning for warning in program.warnings)
