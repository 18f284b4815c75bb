"""Vibration-aware rounding, judged on the emitted text by an interpreter, player and plant of their own."""

import numpy as np
import pytest
from rounding_figures import PATHS, PERIODS_S, UNITS, Outcome, machine, outcomes, path

import shapegcode as sg
from shapegcode import _core
from shapegcode.conversion.convert import convert


def _medians_um(rows: list[Outcome]) -> tuple[float, float, float, float]:
    """Residual of X and Y under both rules of block ends."""
    x, y, carry_x, carry_y = np.median([[*row.residual_um, *row.carry_um] for row in rows], axis=0)
    return float(x), float(y), float(carry_x), float(carry_y)


def _compare(found: dict[str, list[Outcome]]) -> None:
    nearest, vibration = found["nearest"], found["vibration"]
    for before, after in zip(_medians_um(nearest), _medians_um(vibration), strict=True):
        assert after < before / 3.0
    assert max(row.error_increments for row in nearest) <= 0.5 + 1e-6
    assert 0.5 < max(row.error_increments for row in vibration) < 1.0
    # Not always the same number: a path that just leaves its contour tolerance is shaped again, slower.
    blocks = [sum(row.blocks for row in rows) for rows in (nearest, vibration)]
    assert abs(blocks[1] - blocks[0]) < 0.01 * blocks[0]
    # Where the nearest ends leave F as it is, the others may ask for another one.
    assert sum(row.size for row in vibration) < 1.08 * sum(row.size for row in nearest)


def test_a_third_of_the_residual_is_left() -> None:
    _compare(outcomes(range(12), 0.005))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "inch", "increment_mm"), UNITS)
@pytest.mark.parametrize("period_s", PERIODS_S)
def test_a_third_of_the_residual_is_left_in_every_unit(
    name: str, inch: bool, increment_mm: float, period_s: float
) -> None:
    assert name
    _compare(outcomes(range(PATHS), period_s, inch=inch, increment_mm=increment_mm))


def _emitted(number: int, **values: object) -> list[_core.Path]:
    """The cut of a path with the nearest ends and with those that vibrate least."""
    found = []
    for rounding in ("nearest", "vibration"):
        owner = machine(rounding, 0.005).with_values(values)
        result = convert(sg.Program.from_text(path(number).encode(), owner, source="path"), owner)
        (place,) = result.placed
        found.append(place.blocks(result.emitted))
    return found


def test_start_and_end_are_the_nearest_increments() -> None:
    nearest, vibration = _emitted(4)
    np.testing.assert_array_equal(nearest.end_mm, vibration.end_mm)
    np.testing.assert_array_equal(nearest.start_mm, vibration.start_mm)


def test_without_modes_on_an_axis_its_words_are_the_nearest() -> None:
    # Only X vibrates: Y and Z keep their words, whatever X does.
    nearest, vibration = (np.array([block.end_mm for block in each]) for each in _emitted(11, **{"axes.y.modes": ()}))
    np.testing.assert_array_equal(nearest[:, 1:], vibration[:, 1:])
    assert (nearest[:, 0] != vibration[:, 0]).any()
