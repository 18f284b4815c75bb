"""The HAL component in LinuxCNC's own simulation: what came out, held against NumPy. `make test-linuxcnc`."""

from __future__ import annotations

import itertools
from pathlib import Path

import analysis
import linuxcnc_run
import machine
import numpy as np
import pytest
from linuxcnc_run import Recording

FADE_S = 0.2
RAW_FEEDBACK = {f"net lag-{joint}      shapegcode-shaper.0.lag-{joint} => fb-{joint}.in1": "" for joint in range(3)}
# Seconds after the start, in the contour but for the last: off, on, another frequency, none that is possible, ZVD.
SWITCHES = [[2.0, "enable", 0], [3.0, "enable", 1], [4.0, "frequency-1", 60], [5.0, "family", 9], [6.0, "family", 1]]


@pytest.fixture(scope="session")
def user() -> list[str]:
    return linuxcnc_run.as_user()


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machine.contour_program(tmp_path_factory.mktemp("program"))


@pytest.fixture(scope="session")
def shaped(user: list[str], program: Path) -> Recording:
    return linuxcnc_run.run(user, program, override=machine.FEED_OVERRIDE)


@pytest.fixture(scope="session")
def fading(user: list[str], program: Path) -> Recording:
    """Switched while it moves, with the drive's own feedback and what docs/howto/linuxcnc.md says on FERROR for it."""
    delay_s = max(analysis.mean_delay_s(taps) for taps in designs())
    limits = f"FERROR = {0.5 + 2 * 200 * delay_s}\nMIN_FERROR = {0.05 + 2 * 2000 * delay_s**2}"
    wide = {"FERROR = 0.5\nMIN_FERROR = 0.05": limits}
    return linuxcnc_run.run(
        user, program, ini=wide, hal=RAW_FEEDBACK, override=machine.FEED_OVERRIDE, set={"fade": FADE_S}, switch=SWITCHES
    )


@pytest.fixture(scope="session")
def waiting(user: list[str], program: Path) -> Recording:
    """The same without a fade."""
    return linuxcnc_run.run(user, program, override=machine.FEED_OVERRIDE, switch=SWITCHES)


def designs() -> list[analysis.Array]:
    """What the switches ask for, one after the other; the impossible one asks for nothing."""
    first, slow = machine.MODES[0], (60.0, machine.MODES[1][1])
    zvd = [analysis.zv_taps(*mode, zeros=2) for mode in (first, slow)]
    return [
        machine.both_modes(),
        np.ones(1),
        machine.both_modes(),
        np.convolve(analysis.zv_taps(*first), analysis.zv_taps(*slow)),
        np.convolve(*zvd),
    ]


def rises(pin: np.ndarray) -> np.ndarray:
    """Samples at which a pin is set and was not before."""
    return np.flatnonzero(np.diff(pin.astype(int)) > 0) + 1


def falls(pin: np.ndarray) -> np.ndarray:
    return rises(~pin)


def test_the_program_ran(shaped: Recording) -> None:
    assert np.allclose(shaped.command.min(axis=0)[:2], [-55.123, -55.123], atol=1e-6)
    speed = np.linalg.norm(np.diff(shaped.command, axis=0), axis=1) / analysis.PERIOD_S
    assert speed.max() > 100.0
    assert shaped.ok.all()


def test_the_output_is_the_command_convolved_with_the_shaper(shaped: Recording) -> None:
    expected = analysis.convolved(shaped.command, machine.both_modes())
    assert np.abs(shaped.shaped - expected).max() < 1e-9


def test_the_lag_in_the_feedback_takes_the_delay_out_of_the_following_error(
    shaped: Recording, fading: Recording
) -> None:
    assert np.abs(shaped.following_error).max() < 1e-9
    # The drive's own feedback follows by speed times delay: rapids at 200 mm/s.
    before_switches = slice(0, rises(fading.pending)[0])
    speed = np.abs(np.diff(fading.command[before_switches], axis=0)).max() / analysis.PERIOD_S
    lag = np.abs(fading.following_error[before_switches]).max()
    assert lag == pytest.approx(speed * analysis.mean_delay_s(machine.both_modes()), rel=0.05)


def test_what_vibrates_vibrates_no_longer(shaped: Recording) -> None:
    for axis, mode in enumerate(machine.MODES):
        swings = [analysis.swing_when_steady(signal[:, axis], *mode) for signal in (shaped.command, shaped.shaped)]
        assert swings[0] > 0.005
        assert swings[1] < 1e-6


def test_a_fade_goes_from_one_shaper_to_the_next_afterout_a_step(fading: Recording) -> None:
    """Every sample is what the two shapers and the weight say; nowhere a step."""
    outputs = [analysis.convolved(fading.command, taps) for taps in designs()]
    refused = rises(~fading.ok)[0]
    begun = [start for start in rises(fading.pending) if not refused - 100 < start <= refused]
    done = [end for end in falls(fading.pending) if end > begun[0] and end != refused]
    assert len(begun) == len(done) == len(outputs) - 1
    moving = np.any(np.diff(fading.command, axis=0) != 0.0, axis=1)
    assert all(moving[end - 100 : end].all() for end in done)
    expected = outputs[0].copy()
    fade = round(FADE_S / analysis.PERIOD_S)
    for k, end in enumerate(done):
        share = 1.0 - (end - np.arange(len(expected))) / fade
        weight = analysis.fade_weight(share)[:, None]
        rows = slice(begun[k], None)
        expected[rows] = (outputs[k] + weight * (outputs[k + 1] - outputs[k]))[rows]
    assert np.abs(fading.shaped - expected).max() < 1e-9
    delays = [analysis.mean_delay_s(taps) for taps in designs()]
    largest = max(abs(a - b) for a, b in itertools.pairwise(delays))
    increments = [np.abs(np.diff(signal, axis=0)).max() for signal in (fading.command, fading.shaped)]
    assert increments[1] < increments[0] * (1.0 + 1.875 * largest / FADE_S)


def test_the_acceleration_of_a_fade_is_bounded(fading: Recording) -> None:
    """Beside a shaper at work, whose taps are not negative, it is what the weight adds."""
    speed = np.abs(np.diff(fading.command, axis=0)).max() / analysis.PERIOD_S
    own = np.abs(analysis.acceleration(fading.command)).max()
    delays = [analysis.mean_delay_s(taps) for taps in designs()]
    largest = max(abs(a - b) for a, b in itertools.pairwise(delays))
    longest = analysis.PERIOD_S * max(len(taps) for taps in designs())
    added = speed * largest * 5.78 / FADE_S**2 + 2.0 * own * longest * 1.875 / FADE_S
    assert np.abs(analysis.acceleration(fading.shaped)).max() < own + added


def test_what_is_impossible_is_told_and_changes_nothing(fading: Recording) -> None:
    (off,), (on,) = falls(fading.ok), rises(fading.ok)
    assert 700 < on - off < 1300
    assert not fading.pending[off:on].any()
    assert len(fading.said["errors"]) == 1
    assert "family 9 is none" in fading.said["errors"][0]


def test_without_a_fade_a_switch_waits_for_rest(waiting: Recording) -> None:
    """While the contour runs nothing changes; what was asked for last comes at the first rest behind it."""
    outputs = [analysis.convolved(waiting.command, taps) for taps in designs()]
    asked, done = rises(waiting.pending)[0], falls(waiting.pending)[-1]
    assert done - asked > 5000
    rest = max(len(designs()[0]), len(designs()[-1]))
    moved = np.any(np.diff(waiting.command, axis=0) != 0.0, axis=1)
    assert not moved[done - rest + 1 : done].any()
    assert np.abs(waiting.shaped[:done] - outputs[0][:done]).max() < 1e-9
    assert np.abs(waiting.shaped[done:] - outputs[-1][done:]).max() < 1e-9
    increments = [np.abs(np.diff(signal, axis=0)).max() for signal in (waiting.command, waiting.shaped)]
    assert increments[1] < increments[0] * (1.0 + 1e-9)
