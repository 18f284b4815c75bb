"""Vibration-aware rounding, judged on the emitted text by an interpreter, player and plant of their own."""

import numpy as np
import pytest
from rounding_figures import PATHS, PERIODS_S, UNITS, Outcome, machine, outcomes, path

import shapegcode as sg
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


def test_start_and_end_are_the_nearest_increments() -> None:
    texts = {}
    for rounding in ("nearest", "vibration"):
        owner = machine(rounding, 0.005)
        program = sg.Program.from_text(path(4).encode(), owner, source="path")
        result = convert(program, owner)
        (place,) = result.placed
        texts[rounding] = result.emitted.core.cutting_path(place.first_line, place.last_line)
    np.testing.assert_array_equal(texts["nearest"].end_mm, texts["vibration"].end_mm)
    np.testing.assert_array_equal(texts["nearest"].start_mm, texts["vibration"].start_mm)


def test_without_modes_on_an_axis_its_words_are_the_nearest() -> None:
    # Only X vibrates: Y and Z keep their words, whatever X does.
    words = {}
    for rounding in ("nearest", "vibration"):
        owner = machine(rounding, 0.005)
        owner = owner.with_values("axes.y.modes", ())
        program = sg.Program.from_text(path(11).encode(), owner, source="path")
        result = convert(program, owner)
        (place,) = result.placed
        blocks = result.emitted.core.cutting_path(place.first_line, place.last_line)
        words[rounding] = np.array([blocks[index].end_mm for index in range(len(blocks))])
    assert len(words["nearest"]) == len(words["vibration"])
    np.testing.assert_array_equal(words["nearest"][:, 1:], words["vibration"][:, 1:])
    assert (words["nearest"][:, 0] != words["vibration"][:, 0]).any()
