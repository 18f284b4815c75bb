"""Result of `shapegcode report`: pages of results, and the problems found with each."""

from __future__ import annotations

from dataclasses import dataclass

from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table


@dataclass(frozen=True)
class ReportPage:
    """A page that was written."""

    source: str  # JSON from which it was made
    page: str  # file that was written
    result: str  # class of the result; empty: it could not be read back
    motion: bool  # the programs were found unchanged and simulated again
    problems: tuple[str, ...]  # also listed on the page


@dataclass(frozen=True, repr=False, eq=False)
class Reports(Result):
    """Pages of results that were written earlier.

    Attributes:
        pages: in the order of the files.
        warnings: problems of all pages, each with its file.
    """

    pages: tuple[ReportPage, ...]
    warnings: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """True if every page shows its result without a problem."""
        return not self.warnings

    @property
    def answer(self) -> str:
        """Number of pages, and of those with a caution."""
        count = len(self.pages)
        sentence = f"{count} page{'s' if count > 1 else ''} written"
        bad = sum(bool(page.problems) for page in self.pages)
        return f"{sentence}, {bad} with a caution" if bad else sentence

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if not self.ok:
            return "run the command again for the present program: its page then has no such remark."
        return f"open {self.pages[0].page} in a browser."

    def tables(self) -> list[Table]:
        """The pages."""
        columns = (
            Column("result", left=True),
            Column("page", left=True),
            Column("motion", value=lambda page: "yes" if page.motion else "no"),
        )
        return [Table("", columns, self.pages)]
