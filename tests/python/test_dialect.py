"""Programs in the full dialect: what the package reads against what the independent judge simulates."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings

import shapegcode as sg
from acceptance import machine_with
from judge.dialect import Alarm, play
from judge.dialect.generate import compensated_programs, coordinate_programs, macro_programs
from second_reading import compare, read_moves

DIALECT = Path(__file__).parents[1] / "golden" / "dialect"
NAMES = sorted(path.stem for path in DIALECT.glob("*.nc"))
#: The block skip switch is a setting; programs that have `/` are read with it off and on.
SKIPPING = [name for name in NAMES if "/" in (DIALECT / f"{name}.nc").read_text() and name.startswith("block_skip")]


@pytest.mark.parametrize("name", [name for name in NAMES if name not in SKIPPING])
def test_read_as_judged(name: str) -> None:
    compare((DIALECT / f"{name}.nc").read_text(), machine_with())


@pytest.mark.parametrize("name", SKIPPING)
@pytest.mark.parametrize("switch", ["on", "off"])
def test_block_skip(name: str, switch: str) -> None:
    on = frozenset(range(1, 10)) if switch == "on" else frozenset()
    compare((DIALECT / f"{name}.nc").read_text(), machine_with({"input.block_skip": switch}), switches=on)


RANDOM = settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
MACHINE = machine_with()


@RANDOM
@given(text=macro_programs())
def test_random_macro_programs(text: str) -> None:
    try:
        play(text)
    except Alarm as alarm:
        with pytest.raises(sg.ProgramError) as caught:
            read_moves(text, MACHINE)
        # The judge leaves out what is no alarm of arithmetic.
        assert (caught.value.line, f"(alarm {alarm.alarm:04d})" in str(caught.value)) == (alarm.line, True), str(alarm)
        return
    # A computed word that lies on the half of an increment may go either way by the last bit of its value.
    compare(text, MACHINE, place_mm=1.001e-3)


@RANDOM
@given(text=coordinate_programs())
def test_random_coordinate_modes_and_cycles(text: str) -> None:
    compare(text, MACHINE, place_mm=1.001e-3)


@RANDOM
@given(text=compensated_programs())
def test_random_compensation(text: str) -> None:
    # The rounded end of an arc is up to 0.7 µm off its circle, which a corner of 30 degrees makes 1.4 µm.
    compare(text, MACHINE, place_mm=2.5e-3)
