"""Cycle time of a test piece with both sets of constants of a testbed.

Lee, Ro, Song and Oh, 2022 (paper 004 in docs/evidence/references.md): section 3.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources

from shapegcode.demos.result import Demonstration, Statement, stated
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.results.table import Column, Table
from shapegcode.timing.cycle_time import cycle_time
from shapegcode.timing.result import AGREEMENT_PERCENT, PARTS, TimeParts

__all__ = ["CycleTimeCase", "CycleTimeDemo", "cycle_time_demo", "paper_004_machine", "piece_text"]

# Section 3: rapid time constant, bell time of the rapids, time constant of cutting moves in s; measured and predicted
# cycle time in s of the paper's own program.
_PAPER_TIMES = (((0.150, 0.030, 0.050), 2169.1, 2172.4), ((0.100, 0.020, 0.100), 2157.3, 2172.0))
_PAPER_COMPUTING_S = 1.0
_REMARK = (
    "The paper's program is not published: its times are of another program for a test piece of the same "
    "standard, so ours cannot be compared with them, and nothing here is tuned to them. What can be compared "
    "is how the time answers to the constants, and the closed form with the full interpolation."
)


@dataclass(frozen=True)
class CycleTimeCase:
    """Our test piece with one set of constants.

    Attributes:
        rapid_time_constant_s: of rapids, linear.
        rapid_bell_time_s: of rapids, bell-shaped.
        time_constant_s: of cutting moves.
        closed_form_s: cycle time.
        full_interpolation_s: cycle time by giving every set-point.
        difference_percent: closed form over full interpolation, in % of the latter.
        closed_form_computing_s: processor time of the closed form, reading included.
        full_interpolation_computing_s: processor time of the full interpolation.
        parts: where the time goes.
        published_measured_s: the paper's measurement, of its own program.
        published_predicted_s: the paper's prediction, of its own program.
    """

    rapid_time_constant_s: float
    rapid_bell_time_s: float
    time_constant_s: float
    closed_form_s: float
    full_interpolation_s: float
    difference_percent: float
    closed_form_computing_s: float
    full_interpolation_computing_s: float
    parts: TimeParts
    published_measured_s: float
    published_predicted_s: float

    @property
    def name(self) -> str:
        """The constants in ms."""
        constants = (self.rapid_time_constant_s, self.rapid_bell_time_s, self.time_constant_s)
        return " / ".join(f"{each * 1e3:.0f}" for each in constants) + " ms"


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class CycleTimeDemo(Demonstration):
    """Our test piece with both sets of constants of the paper.

    Attributes:
        machine: name of the machine.
        program: name of the program.
        cases: one for each set of constants.
    """

    machine: str
    program: str
    cases: tuple[CycleTimeCase, ...]

    @property
    def next_step(self) -> str:
        """The one thing to do next."""
        return "shapegcode time YOUR.NC -m YOUR_MACHINE.toml"

    def tables(self) -> list[Table]:
        """The statements; the closed form and its check."""
        columns = (
            Column("rapid / bell / cutting", value="name", text=True),
            Column("closed form", "s", "closed_form_s", digits=3),
            Column("full interpolation", "s", "full_interpolation_s", digits=3),
            Column("computing", "s", "closed_form_computing_s", digits=3),
            Column("computing in full", "s", "full_interpolation_computing_s", digits=3),
        )
        return [*super().tables(), Table(f"{self.program} on {self.machine}", columns, self.cases)]


def piece_text() -> str:
    """The test piece with the features of ISO 10791-7 that comes with shapegcode."""
    return (resources.files("shapegcode") / "data" / "iso10791_7.nc").read_text(encoding="ascii")


def paper_004_machine(rapid_time_constant_s: float, rapid_bell_time_s: float, time_constant_s: float) -> Machine:
    """The paper's testbed (``kimm004``) with other constants."""
    return Machine.load("kimm004").with_values({
        "controller.rapid_time_constant_s": rapid_time_constant_s,
        "controller.rapid_bell_time_s": rapid_bell_time_s,
        "controller.time_constant_s": time_constant_s,
    })  # fmt: skip


def cycle_time_demo(on_progress: Callable[[float], None] = lambda _: None) -> CycleTimeDemo:
    """Our test piece with both sets of constants: closed form, full interpolation, computing time.

    Args:
        on_progress: called with the share of the work done, 0 to 1.

    Source: Lee, Ro, Song and Oh, 2022 (paper 004), section 3.

    Returns:
        Times in s for both sets, each statement of the paper beside ours.
    """
    cases = []
    for done, (constants, measured_s, predicted_s) in enumerate(_PAPER_TIMES):
        on_progress(done / len(_PAPER_TIMES))
        cases.append(_case(constants, measured_s, predicted_s))
    return CycleTimeDemo(
        paper=CycleTimeDemo.cited("004"),
        title="Cycle time with two sets of constants",
        rows=tuple(_statements(cases)),
        remark=_REMARK,
        machine="kimm004",
        program="iso10791_7.nc",
        cases=tuple(cases),
    )


def _case(constants: tuple[float, float, float], measured_s: float, predicted_s: float) -> CycleTimeCase:
    machine = paper_004_machine(*constants)
    began_s = time.process_time()
    program = Program.from_text(piece_text(), machine, source="iso10791_7.nc")
    closed = cycle_time(program, machine, full=False)
    middle_s = time.process_time()
    full = cycle_time(program, machine)
    ended_s = time.process_time()
    assert full.full_interpolation_s is not None
    assert full.difference_percent is not None
    return CycleTimeCase(
        *constants,
        closed_form_s=closed.cycle_time_s,
        full_interpolation_s=full.full_interpolation_s,
        difference_percent=full.difference_percent,
        closed_form_computing_s=middle_s - began_s,
        full_interpolation_computing_s=ended_s - middle_s,
        parts=TimeParts(**{name: getattr(closed, name) for name in PARTS}),
        published_measured_s=measured_s,
        published_predicted_s=predicted_s,
    )


def _statements(cases: list[CycleTimeCase]) -> list[Statement]:
    rows = [
        stated(
            "section 3", f"cycle time with {each.name}, predicted (measured)",
            f"{each.published_predicted_s:.1f} s ({each.published_measured_s:.1f} s)", f"{each.closed_form_s:.1f} s",
            None, "of another program",
        )
        for each in cases
    ]  # fmt: skip
    worst = max((each.difference_percent for each in cases), key=abs)
    slowest_s = max(each.closed_form_computing_s for each in cases)
    return [
        *rows,
        stated(
            "eq. 2-16", "closed form against every set-point", f"within {AGREEMENT_PERCENT:g} %", f"{worst:+.4f} %",
            abs(worst) <= AGREEMENT_PERCENT, "the limit is ours",
        ),
        stated(
            "section 3", "time of computing", "under 1 s", f"{slowest_s:.3f} s", slowest_s < _PAPER_COMPUTING_S
        ),
    ]  # fmt: skip
