"""What every demonstration is: statements of a paper beside ours, each with its verdict."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, get_args

from shapegcode.results.result import Plot, Result
from shapegcode.results.table import Column, Table

__all__ = ["PAPERS", "Agreement", "Demonstration", "Statement", "compared", "stated"]

PAPERS = {
    "000": "Ko, Lim and Hong, 2023",
    "001": "Kim and Ko, 2001",
    "002": "Park, Hong and Danielson, 2009",
    "003": "Back, Ko and Kim, 2003",
    "004": "Lee, Ro, Song and Oh, 2022",
}
"""Authors and year by the short name of the paper; in full in docs/evidence/references.md."""

Agreement = Literal["agrees", "differs", "explained", "open"]
"""Of a statement: it holds here; it does not; it does not, and why is known (a slip of the paper, other conditions);
or the paper leaves open what it depends on."""

_SAID: dict[Agreement, str] = {"agrees": "yes", "differs": "NO", "explained": "explained", "open": ""}


@dataclass(frozen=True)
class Statement:
    """What a paper states, beside what comes out here.

    Attributes:
        place: where in the paper: figure, table, section or equation.
        what: is stated.
        published: as the paper has it, with its unit.
        ours: as it comes out here, with its unit.
        agreement: whether both say the same: agrees, differs, explained (differs for a known reason) or open (the paper
            leaves open what it depends on).
        difference_percent: ours over the published figure, in % of the latter; null where it is no figure.
        note: why they differ, or under which conditions ours holds; empty: nothing to add.
    """

    place: str
    what: str
    published: str
    ours: str
    agreement: Agreement
    difference_percent: float | None = None
    note: str = ""

    @property
    def ok(self) -> bool:
        """Whether it agrees, or why it does not is known."""
        return self.agreement != "differs"


def stated(place: str, what: str, published: str, ours: str, agrees: bool | None, note: str = "") -> Statement:
    """A statement of a paper beside ours.

    Args:
        place: where in the paper.
        what: is stated.
        published: as the paper has it.
        ours: as it comes out here.
        agrees: whether both say the same; None: the paper leaves open what it depends on.
        note: to the reader.

    Returns:
        The row, with whether the two agree.
    """
    return Statement(place, what, published, ours, "open" if agrees is None else _verdict(agrees), note=note)


def _verdict(agrees: bool) -> Agreement:
    return "agrees" if agrees else "differs"


def compared(
    place: str, what: str, published: float, ours: float, unit: str, *, digits: int, within: float, note: str = ""
) -> Statement:
    """A figure of a paper beside ours.

    Args:
        place: where in the paper.
        what: is stated.
        published: the paper's figure.
        ours: the same of this project.
        unit: of both.
        digits: behind the point.
        within: they agree if they differ by no more than this, in the unit.
        note: to the reader.

    Returns:
        The row, with the difference in percent and whether the two agree.
    """
    said = [f"{value:.{digits}f} {unit}".rstrip() for value in (published, ours)]
    difference_percent = (ours / published - 1.0) * 100.0
    return Statement(place, what, said[0], said[1], _verdict(abs(ours - published) <= within), difference_percent, note)


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class Demonstration(Result):
    """A paper's figures, repeated.

    Its pictures are drawn by the module beside it whose name ends with `_plots`.

    Attributes:
        paper: authors, year, and under which name docs/evidence/references.md has it in full.
        title: what is repeated.
        rows: the paper's statements beside ours.
        remark: how to read the differences.
        warnings: none as a rule.
    """

    json_extra: ClassVar[dict[str, Any]] = {**Result.json_extra}

    paper: str
    title: str
    rows: tuple[Statement, ...]
    remark: str
    warnings: tuple[str, ...] = ()

    @staticmethod
    def cited(number: str) -> str:
        """The `paper` of a demonstration: "Park, Hong and Danielson, 2009 (paper 002 in docs/evidence/references.md)".

        Args:
            number: as docs/evidence/references.md counts them, for example "002".

        Returns:
            Authors, year and number.
        """
        return f"{PAPERS[number]} (paper {number} in docs/evidence/references.md)"

    @property
    def ok(self) -> bool:
        """Whether every statement agrees, or why it does not is known."""
        return all(row.ok for row in self.rows)

    @property
    def answer(self) -> str:
        """How many statements of the paper agree."""
        count = {kind: sum(row.agreement == kind for row in self.rows) for kind in get_args(Agreement)}
        said = f"{self.title}: {count['agrees']} of {len(self.rows)} statements of {self.paper} agree"
        others = [
            f"{count[kind]} {words}"
            for kind, words in (
                ("differs", "DIFFER"),
                ("explained", "differ for a known reason"),
                ("open", "cannot be compared"),
            )
            if count[kind]
        ]
        return ", ".join([said, *others])

    def tables(self) -> list[Table]:
        """The statements, and the remark below them."""
        columns = (
            Column("place", left=True),
            Column("what", text=True),
            Column("paper", value="published", text=True),
            Column("here", value="ours", text=True),
            Column("differs", "%", "difference_percent", digits=2),
            Column("agrees", value=lambda row: _SAID[row.agreement], text=True),
            Column("note", text=True),
        )
        return [Table("", columns, self.rows, caption=self.remark)]

    def plots(self) -> Mapping[str, Plot]:
        """The paper's figures, where there are some."""
        name = f"{type(self).__module__}_plots"
        if importlib.util.find_spec(name) is None:
            return {}
        return self._drawable(lambda: importlib.import_module(name).plots_of(self))
