"""The plan of a tap test: how to record each axis, and the instructions for the operator."""

from __future__ import annotations

from dataclasses import dataclass

from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table


@dataclass(frozen=True)
class AxisRecording:
    """How to record the modes of an axis.

    Attributes:
        axis: "X", "Y", "Z", or all of them.
        modes_hz: those known, ascending; empty: the usual range is taken.
        highest_hz: modes are looked for up to here.
        samples_per_s: sampling rate.
        duration_s: of one tap, from the trigger on.
        pre_trigger_s: before it.
        pulse_s: longest pulse of the force that still excites the highest frequency.
        tip: of the hammer.
    """

    axis: str
    modes_hz: tuple[float, ...]
    highest_hz: float
    samples_per_s: float
    duration_s: float
    pre_trigger_s: float
    pulse_s: float
    tip: str


@dataclass(frozen=True)
class RapidStop:
    """How to let an axis decay without a hammer.

    Attributes:
        axis: "X", "Y" or "Z".
        distance_mm: of each rapid.
        dwell_s: rest after each, in which the decay is recorded.
        program: that does it, in FANUC's dialect.
    """

    axis: str
    distance_mm: float
    dwell_s: float
    program: str


@dataclass(frozen=True, repr=False, eq=False)
class TapPlan(Result):
    """How to do a tap test.

    Attributes:
        machine: its name; null: no machine file was given.
        recordings: for each axis.
        stops: the decays after a rapid stop, for each axis.
        instructions: the rest of it, for the operator: machine, sensor and hammer, recording, file, what is refused.
        warnings: none.
    """

    machine: str | None
    recordings: tuple[AxisRecording, ...]
    stops: tuple[RapidStop, ...]
    instructions: str
    warnings: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """There is a plan for every machine."""
        return True

    @property
    def answer(self) -> str:
        """Of which machine."""
        return f"tap test of {self.machine or 'a machining centre'}: how to do it"

    @property
    def next_step(self) -> str:
        """The one thing to do next."""
        return "do the test, then for each axis: shapegcode identify x1.csv x2.csv x3.csv --axis x --update mine.toml"

    def tables(self) -> list[Table]:
        """How to record each axis."""
        columns = (
            Column("axis", text=True),
            Column(
                "modes known", "Hz", lambda row: ", ".join(f"{each:g}" for each in row.modes_hz) or "none", text=True
            ),
            Column("look up to", "Hz", "highest_hz", digits=0),
            Column("samples/s", value="samples_per_s", digits=0),
            Column("record", "s", lambda row: f"{row.duration_s:g}"),
            Column("pre-trigger", "s", lambda row: f"{row.pre_trigger_s:.2g}"),
            Column("pulse at most", "ms", lambda row: f"{1e3 * row.pulse_s:.2g}"),
            Column("tip", text=True),
        )
        return [Table("recording", columns, self.recordings)]


def _modes_known(row: AxisRecording) -> str:
    return ", ".join(f"{each:g}" for each in row.modes_hz) or "none"
