"""What `convert` chooses by itself is what `choose_shaper` recommends for the same machine."""

import typing

import pytest

import shapegcode as sg
from acceptance import machine_with
from extra_insensitive import worst_over_bands
from shapegcode._core import DesignError
from shapegcode.machine.programs import Shaping
from shapegcode.shaping import FAMILIES, ModeBand, choose_shaper
from shapegcode.shaping.grid import choose_grid

Axis = list[tuple[float, float, float | None]]  # Hz, damping ratio, ± % or None

#: Those that can be as short as what a conversion takes: the others cancel each mode by itself, or more often.
RIVALS = ["zv", "si", "negative-zv", "polynomial", "non-negative", "robust"]
X, Y = (46.0, 0.02), (131.0, 0.02)
VARIANTS: dict[str, tuple[Axis, Axis, dict[str, float]]] = {
    "vx500": ([(*X, None)], [(*Y, None)], {}),
    "1 ms blocks": ([(*X, None)], [(*Y, None)], {"controller.block_time_s": 0.001}),
    "2 ms blocks, both within 10 %": ([(*X, 10.0)], [(*Y, 10.0)], {"controller.block_time_s": 0.002}),
    "one of two is uncertain": ([(*X, 5.0)], [(*Y, None)], {}),
    "8 ms blocks": ([(*X, None)], [(*Y, None)], {"controller.block_time_s": 0.008}),
    "stated period": ([(*X, None)], [(*Y, None)], {"emission.block_period_s": 0.006}),
    "stated period, uncertain": ([(*X, 5.0)], [(*Y, 5.0)], {"emission.block_period_s": 0.006}),
    "three modes": ([(22.0, 0.03, None), (71.0, 0.01, 8.0)], [(38.0, 0.05, 3.0)], {"controller.block_time_s": 0.003}),
    "undamped, tighter limit": (
        [(25.0, 0.0, None)],
        [(62.0, 0.0, 4.0)],
        {"controller.block_time_s": 0.002, "shaping.vibration_limit": 0.02},
    ),
    "durations that differ by less than 2 %": ([(7.5, 0.02, None)], [], {"controller.block_time_s": 0.001}),
    "nothing is short enough": ([(*X, 10.0)], [(*Y, 10.0)], {"shaping.max_duration_s": 0.02}),
}

#: What they are about is in other variants too.
SLOW_VARIANTS = ("2 ms blocks, both within 10 %", "one of two is uncertain")


def machine_of(x: Axis, y: Axis, keys: dict[str, float]) -> sg.Machine:
    names = ("frequency_hz", "damping_ratio", "frequency_uncertainty_percent")
    modes = {
        f"axes.{axis}.modes": [
            {name: v for name, v in zip(names, mode, strict=True) if v is not None} for mode in given
        ]
        for axis, given in (("x", x), ("y", y))
    }
    return machine_with({**keys, **modes})


def worst_left(machine: sg.Machine, shaper: sg.Shaper) -> float:
    """Largest residual ratio anywhere in the modes' bands."""
    bands = [
        ModeBand(sg.Mode(mode.frequency_hz, mode.damping_ratio), (mode.frequency_uncertainty_percent or 0.0) / 100.0)
        for axis in machine.axes.as_tuple()
        for mode in axis.modes
    ]
    return worst_over_bands(shaper.times_s, shaper.amplitudes, bands, 201)


def agree(machine: sg.Machine, families: list[str]) -> None:
    grid = choose_grid(machine)
    recommended = choose_shaper(machine=machine, families=families).design
    assert recommended.period_s == pytest.approx(grid.block_period_s, rel=1e-9)
    assert recommended.duration_s == pytest.approx(grid.duration_s, rel=1e-9)
    assert recommended.family == grid.family
    # Both are found to 0.1 % of the limit.
    limit = machine.shaping.vibration_limit
    left = worst_left(machine, grid.shaper)
    assert worst_left(machine, recommended.shaper) == pytest.approx(left, abs=1e-3 * limit)
    assert recommended.worst_residual == pytest.approx(left, rel=0.01, abs=1e-9)
    assert bool(grid.note) == (left > limit * 1.001)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in SLOW_VARIANTS else name for name in VARIANTS]
)
def test_a_conversion_takes_what_is_recommended(name: str) -> None:
    agree(machine_of(*VARIANTS[name]), RIVALS)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["vx500", "2 ms blocks, both within 10 %", "one of two is uncertain"])
def test_no_family_on_a_grid_is_better_than_what_a_conversion_takes(name: str) -> None:
    agree(machine_of(*VARIANTS[name]), [row.name for row in FAMILIES if row.on_grid and row.name != "taps"])


def test_a_mode_without_a_band_is_cancelled_or_refused() -> None:
    """The one exception: a conversion does not take what leaves vibration of a mode that is said to be exact."""
    keys = {"emission.block_period_s": 0.006, "shaping.max_duration_s": 0.025}
    machine = machine_of([(*X, None)], [(*Y, None)], keys)
    with pytest.raises(DesignError, match="within 25 ms on a 6 ms grid"):
        choose_grid(machine)
    recommended = choose_shaper(machine=machine, families=RIVALS).design
    assert not recommended.exact
    assert worst_left(machine, recommended.shaper) <= 0.05 * 1.001


def test_the_key_knows_every_family_of_the_registry() -> None:
    stated = typing.get_args(Shaping.model_fields["family"].annotation)
    assert stated == ("auto", *(row.name for row in FAMILIES if row.on_grid and row.name != "taps"))


@pytest.mark.parametrize("percent", [0.0015, 0.2])
def test_a_band_as_narrow_as_a_tap_test_gives_it_costs_nothing(percent: float) -> None:
    """Exact at the nominal frequency, and over the band far below what a robust shaper would leave everywhere."""
    machine = machine_of([(*X, percent)], [(*Y, percent)], {})
    grid = choose_grid(machine)
    assert grid.shaper.amplitudes == pytest.approx(
        choose_grid(machine_of([(*X, None)], [(*Y, None)], {})).shaper.amplitudes
    )
    assert worst_left(machine, grid.shaper) < 0.1 * machine.shaping.vibration_limit
    wider = machine_of([(*X, 0.21)], [(*Y, 0.21)], {})
    assert worst_left(wider, choose_grid(wider).shaper) > 0.9 * machine.shaping.vibration_limit
