"""Modes that one axis excites and that move another: plant, verdict, shapers and contour compensation against SciPy's
`lsim` and the judge's plant, interpreter and player, which share nothing with the package."""

from typing import Any

import numpy as np
import pytest

import random_verdict
import shapegcode as sg
from crossing_machines import PERIOD_S, ROCKING, ZIGZAG, deflection, largest_z_um, skewed_draw
from random_verdict import complaints, convert
from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import axis_modes, excited_modes, own_modes
from shapegcode.shaping.grid import choose_grid


def a_command(samples: int = 3000) -> FloatArray:
    rng = np.random.default_rng(1)
    kicks = [np.convolve(rng.normal(size=samples), np.hanning(60), "same") for _ in range(3)]
    return np.cumsum(np.cumsum(np.array(kicks).T, axis=0), axis=0) * 1e-6


def skewed(machine: sg.Machine, **keys: Any) -> sg.Machine:
    """With a mode that Y and, a little, X excite, and that rocks the tool in Y and Z."""
    mode = {
        "frequency_hz": 41.0, "damping_ratio": 0.03, "participation": 0.8, "excited_by": {"x": 0.3, "y": 1.0},
        "moves": {"y": 1.0, "z": -0.4},
    }  # fmt: skip
    return machine.with_values({"axes.y.modes": [mode], "axes.z.rigid": True, **keys})


def test_the_response_is_scipys() -> None:
    command = a_command()
    found = sg.plant_response(command, skewed(sg.Machine.load("vx500")), PERIOD_S)
    rocking = 0.8 * deflection(command @ [0.3, 1.0, 0.0], 41.0, 0.03)
    expected = command.copy()
    expected[:, 0] += deflection(command[:, 0], 46.0, 0.02)
    expected[:, 1] += rocking
    expected[:, 2] += -0.4 * rocking
    assert np.abs(found - expected).max() < 1e-9
    assert np.abs(rocking).max() > 1e-4


def test_by_axis_that_moves_and_by_axis_that_excites() -> None:
    machine = skewed(sg.Machine.load("vx500"))
    moved, excited, own = axis_modes(machine), excited_modes(machine), own_modes(machine)
    assert [len(modes) for modes in moved] == [1, 1, 1]
    assert moved[2][0] == _core.Mode(41.0, 0.03, 0.8 * -0.4, (0.3, 1.0, 0.0))
    assert [[mode.frequency_hz for mode in modes] for modes in excited] == [[46.0, 41.0], [41.0], []]
    assert excited[0][1].participation == pytest.approx(0.8 * 0.3 * np.hypot(1.0, 0.4))
    assert [len(modes) for modes in own] == [1, 0, 0]
    # Today's modes are the special case, word for word.
    plain = sg.Machine.load("vx500")
    said = plain.with_values({"axes.y.modes.1.excited_by": {"y": 1.0}, "axes.y.modes.1.moves": {"y": 1.0}})
    assert axis_modes(said) == axis_modes(plain)
    assert sg.Machine.from_toml(machine.to_toml()) == machine
    assert sg.Machine.from_toml(machine.to_toml(short=True)) == machine


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"axes.y.modes.1.excited_by": {"x": 1.0}}, r"axes\.y\.modes\.1\.excited_by.*component along y"),
        ({"axes.y.modes.1.moves": {"y": 0.0}}, r"axes\.y\.modes\.1\.moves.*x, y and z are 0"),
        ({"axes.y.modes.1.moves": {"a": 1.0}}, r"axes\.y\.modes\.1\.moves\.a"),
        ({"axes.y.modes.1.moves": {"z": float("inf")}}, r"axes\.y\.modes\.1\.moves\.z"),
        ({"axes.y.modes.1.moves": {"y": 1e300}}, r"axes\.y\.modes\.1\.moves\.y"),
    ],
)
def test_bad_directions_are_refused(keys: dict[str, Any], words: str) -> None:
    with pytest.raises(sg.MachineError, match=words):
        sg.Machine.load("vx500").with_values(keys)


def test_shapers_of_each_axis_hold_what_it_excites() -> None:
    machine = skewed(sg.Machine.load("vx500"), **{"shaping.per_axis": True})
    grid = choose_grid(machine)
    for fir, modes in zip(grid.axis_firs, excited_modes(machine), strict=True):
        shaper = _core.Shaper(
            [(d - fir.delays[0]) * grid.block_period_s for d in fir.delays], list(fir.taps)
        )  # what is left does not depend on when the first tap comes
        for mode in modes:
            assert shaper.residual_ratio(mode) < 1e-6
    assert len(grid.axis_firs[2].taps) <= 2  # Z excites nothing and is only delayed


def test_behind_feed_drives_the_tables_excite_it() -> None:
    """Y's motion comes from its drive; Z, whose drive rests, shows nothing but the mode under the table of Y."""
    machine = skewed(sg.Machine.load("vx500")).with_values("axes.x.modes", [])
    path = _core.Path([_core.Segment.line([0.0, 0.0, 0.0], [0.0, 30.0, 0.0], 100.0)])
    model = MachineModel(machine)
    options = model.options(plant="feed-drive")
    options.record_samples = 2000
    figures = model.ordinary.simulate(path, options)
    plain = MachineModel(machine.with_values("axes.y.modes", [])).options(plant="feed-drive")
    plain.record_samples = 2000
    alone = model.ordinary.simulate(path, plain)
    table, response = alone.recorded_response, figures.recorded_response
    length = min(len(table), len(response))
    rocking = 0.8 * deflection(np.asarray(table)[:length, 1], 41.0, 0.03)
    off = np.asarray(response)[:length] - np.asarray(table)[:length]
    assert np.abs(rocking).max() > 0.01
    assert np.abs(off[:, 1] - rocking).max() < 1e-6
    assert np.abs(off[:, 2] + 0.4 * rocking).max() < 1e-6


def test_rocking_in_z_from_y_is_shaped_and_fed_forward() -> None:
    """A published machine rocked by 6 µm in Z from motion in Y, and by 1.2 µm with Z compensated."""
    machine = sg.Machine.load("vx500").with_values(ROCKING)
    original = largest_z_um(ZIGZAG, machine)
    shaped, fed_forward = (largest_z_um(emitted(machine, contour), machine) for contour in ("command", "response"))
    assert original == pytest.approx(6.0, abs=0.1)
    assert shaped < 0.45 * original
    assert fed_forward < 1.2


def emitted(machine: sg.Machine, contour: str) -> str:
    machine = machine.with_values("shaping.contour", contour)
    found = sg.convert(ZIGZAG, machine)
    assert found.ok
    assert max(found.residual_vibration_um.emitted) < 0.2
    assert found.residual_vibration_um.original.z > 3.0
    return found.text.decode()


def test_what_another_axis_excites_is_ranked_by_what_it_changes() -> None:
    """Only X moves; the mode that stands at Y is excited by it and was not measured."""
    machine = sg.Machine.load("vx500").with_values(
        {"axes.y.modes.1.excited_by": {"y": 1.0, "x": 0.5}, "axes.y.modes.1.moves": {"x": 1.0}, "axes.z.rigid": True}
    )
    program = sg.Program.from_text("%\nO1\nG21 G90 G17\nG0 X0 Y0 Z0\nG1 X40 F6000.\nX0\nM30\n%\n", machine)
    ranked = {row.key for row in sg.convert(program, machine, shape_all=True).parameter_sensitivity}
    assert {f"axes.{letter}.modes.1.damping_ratio" for letter in "xy"} <= ranked


QUICK = range(4)
MANY = range(4, 104)


def judged(seed: int) -> list[str]:
    return [f"seed {seed}: {what}" for what in complaints(convert(skewed_draw(seed), shape_all=True))]


@pytest.fixture(autouse=True)
def a_tenth_of_a_micrometre(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures agree within 5 % or .1 µm here."""
    monkeypatch.setattr(random_verdict, "ABSOLUTE_UM", 0.1)


@pytest.mark.parametrize("seed", QUICK)
def test_the_report_is_the_judges(seed: int) -> None:
    assert judged(seed) == []


@pytest.mark.slow
@pytest.mark.parametrize("first", range(MANY.start, MANY.stop, 20))
def test_a_hundred_machines(first: int) -> None:
    assert [what for seed in range(first, first + 20) for what in judged(seed)] == []
