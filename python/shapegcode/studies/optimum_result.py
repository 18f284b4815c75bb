"""The choice that was found: what to set, its time, how likely it stays within tolerance, and the others."""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from shapegcode.results.page.model import Figure
from shapegcode.results.result import Plot, Result
from shapegcode.results.table import Column, Table

_SHOWN = 12


@dataclass(frozen=True)
class ChosenValue:
    """A key of the machine file and what was chosen.

    Attributes:
        key: dotted name.
        value: as TOML.
    """

    key: str
    value: str


@dataclass(frozen=True)
class Candidate:
    """A combination that was converted.

    Attributes:
        values: what was chosen.
        time_s: cycle time; None: there is no text.
        within: share of the draws that stay within tolerance; None: not played, as there is a shorter one.
        checked: the same of fresh draws, four times as many; None: not played.
        why: there is no text.
    """

    values: tuple[ChosenValue, ...]
    time_s: float | None
    within: float | None = None
    checked: float | None = None
    why: str = ""

    @property
    def words(self) -> str:
        """The values, for a cell."""
        return ", ".join(f"{each.key.rpartition('.')[2]} {each.value}" for each in self.values)


@dataclass(frozen=True, repr=False, eq=False)
class Optimum(Result):
    """The shortest program that stays within tolerance as likely as was asked for.

    Attributes:
        program: its name.
        machine: that was varied.
        probability: of staying within tolerance that was asked for.
        draws: machines on which a candidate is played; four times as many fresh ones confirm it.
        best: the candidate; None: none is likely enough.
        as_it_is: the machine file without a choice; None: it has no text.
        candidates: all that were converted, the shortest first.
        combinations: how many there are to choose from.
        warnings: caution, before you run.
        machine_words: the machine as a command names it behind -m.
    """

    program: str
    machine: str
    probability: float
    draws: int
    best: Candidate | None
    as_it_is: Candidate | None
    candidates: tuple[Candidate, ...]
    combinations: int
    warnings: tuple[str, ...] = ()
    machine_words: str = "MACHINE"

    @property
    def ok(self) -> bool:
        """Whether there is one."""
        return self.best is not None

    @property
    def values(self) -> dict[str, Any]:
        """What to set: `machine.with_values(found.values)`; nothing where none is likely enough."""
        chosen = () if self.best is None else self.best.values
        return {each.key: tomllib.loads(f"value = {each.value}")["value"] for each in chosen}

    @property
    def answer(self) -> str:
        """What to set, how long it takes, how likely it is good."""
        if self.best is None or self.best.time_s is None:
            asked = f"{self.probability * 100:g} % of the machines"
            return f"none of {len(self.candidates)} choices stays within tolerance on {asked}"
        was = self.as_it_is
        before = "" if was is None or was.time_s is None else f" (as the file has it {was.time_s:.3f} s)"
        checked = self.best.checked or 0.0
        return (
            f"{self.best.words}: {self.best.time_s:.3f} s{before}, within tolerance on {checked * 100:.1f} % of the "
            f"machines, asked for {self.probability * 100:g} %"
        )

    @property
    def next_step(self) -> str:
        """To convert with it."""
        if self.best is None:
            return "measure what decides (shapegcode study), widen the tolerance, or ask for less."
        words = [word for each in self.best.values for word in ("--set", f"{each.key}={each.value}")]
        return (
            f"shapegcode convert {shlex.quote(self.program)} -m {self.machine_words} {shlex.join(words)} -o shaped.nc"
        )

    def key_figures(self) -> tuple[Figure, ...]:
        """Time and probability of the best one."""
        if self.best is None or self.best.time_s is None:
            return ()
        was = None if self.as_it_is is None else self.as_it_is.time_s
        return (
            Figure("cycle time", "s", was, self.best.time_s, 3, None, "as_it_is.time_s", "best.time_s"),
            Figure("stay within tolerance", "%", None, (self.best.checked or 0.0) * 100, 1, None, "", "best.checked",
                   100.0),
        )  # fmt: skip

    def plots(self) -> Mapping[str, Plot]:
        """Time and probability of the shortest choices; nothing where none has a text."""
        return self._drawn_beside() if self.shown else {}

    @property
    def shown(self) -> tuple[Candidate, ...]:
        """The shortest candidates that have a text."""
        return tuple(each for each in self.candidates[:_SHOWN] if each.time_s is not None)

    def tables(self) -> list[Table]:
        """The shortest candidates."""

        def chosen(rank: int) -> Callable[[Candidate], str]:
            return lambda row: row.values[rank].value

        keys = [each.key for each in self.candidates[0].values]
        columns = (
            *(Column(key.rpartition(".")[2], value=chosen(rank), text=True) for rank, key in enumerate(keys)),
            Column("time", "s", "time_s", digits=3),
            Column("within", "%", lambda row: None if row.within is None else row.within * 100.0, digits=1),
            Column("confirmed", "%", lambda row: None if row.checked is None else row.checked * 100.0, digits=1),
            Column("why not", value="why", text=True, priority=2),
        )
        more = len(self.candidates) - _SHOWN
        caption = f"and {more} more, all slower or without a text" if more > 0 else ""
        title = f"choices by time: {len(self.candidates)} of {self.combinations} converted"
        return [Table(title, columns, self.candidates[:_SHOWN], caption)]
