"""What every result is: a frozen dataclass that says whether it is good, caution, before you run, and what to do next.

>>> time = sg.cycle_time("part.nc", machine)
>>> time.ok, time.warnings, time.next_step
>>> time.to_dict()                       # what --json writes
>>> print(time.tables()[0])              # what the command shows
>>> time.plots()["time"](ax)             # draws into the caller's axes
>>> time.report("time.html")             # the page that --html writes
>>> time.to_pandas("regions")            # a table for pandas
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from shapegcode.results.outcome import Outcome, Pair, Plot, Xyz

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes

    from shapegcode.results.json import Made
    from shapegcode.results.page.model import Figure, Light, Page, Script, Section
    from shapegcode.results.page.scene import Scene

__all__ = ["Pair", "Playable", "Plot", "Result", "Xyz"]


class Playable(Protocol):
    """What can be played again for a page: a program, or two of them, on a machine."""

    def scene(self, on_progress: Callable[[float], None] = ...) -> Scene | None:
        """Play it."""


class Result(Outcome):
    """Base of every result. A class that inherits it is a frozen dataclass and says what is abstract in `Outcome`."""

    @property
    def played(self) -> Playable | None:
        """What was played, to play it again for a page; a result of programs has a field of this name."""
        return None

    @property
    def light(self) -> tuple[Light, str]:
        """Colour of the traffic light on its page, and the reason."""
        if not self.ok:
            return "red", self.next_step
        if said := len(self.warnings):
            return "amber", f"{said} warning{'s' if said > 1 else ''} to resolve first"
        return "green", "done, without a warning"

    @property
    def page_title(self) -> str:
        """Heading of its page: what was done with what."""
        from shapegcode.results.page.default import title_of

        return title_of(self)

    def key_figures(self) -> tuple[Figure, ...]:
        """The few figures that stand first on its page; none as a rule."""
        return ()

    def page_sections(self, made: Made | None = None) -> tuple[Section, ...]:
        """What stands on its page between the verdict and what it was made of.

        Args:
            made: of what the result was made; None: it is not known.

        Returns:
            Tables and pictures, unless the class has more to show.
        """
        from shapegcode.results.page.default import sections_of

        return sections_of(self, self.key_figures())

    def page(
        self,
        *,
        motion: bool = True,
        made: Made | None = None,
        problems: Sequence[str] = (),
        on_progress: Callable[[float], None] = lambda _done: None,
    ) -> Page:
        """The result as a page.

        Args:
            motion: play the programs again for the picture that one can turn; else the page has none.
            made: of what the result was made; None: from Python, it is not known.
            problems: what is not as it should be with the page, such as a program that was changed since.
            on_progress: called with the share that is done.

        Returns:
            The page, as data.

        Raises:
            MachineError, NumericError: a program cannot be played.
        """
        from shapegcode.results.page.default import page_of

        played = self.played if motion else None
        return page_of(
            self,
            title=self.page_title,
            light=self.light,
            sections=self.page_sections(made),
            scene=None if played is None else played.scene(on_progress),
            made=made,
            problems=problems,
        )

    def report(self, path: str | Path, script: Script = "inline") -> list[str]:
        """Write the page of the result: one HTML file that opens without a server and without a network.

        Args:
            path: of the file.
            script: "inline": all in one file; "beside": the script in a file beside it, which pages can share.

        Returns:
            The files written.

        Raises:
            ArgumentError: another word for `script`.
            MachineError, NumericError: a program cannot be played.
            OSError: a file cannot be written.
        """
        from shapegcode.results.page.html import save

        return save(self.page(), path, script)

    def plot(self, name: str = "", ax: Axes | None = None) -> Axes:
        """Draw a picture of it.

        Args:
            name: one of `plots()`; empty: the first of them.
            ax: to draw into; None: a new figure.

        Returns:
            The axes.

        Raises:
            ArgumentError: there is no such picture; the message has those that there are.
        """
        plots = self.plots()
        if not plots or (name and name not in plots):
            there = f"one of {', '.join(plots)}" if plots else "there is no picture of this"
            from shapegcode._core import ArgumentError

            raise ArgumentError(f"plot {name}: {there}" if name else there)
        return plots[name or next(iter(plots))](ax)

    def to_pandas(self, what: str = "") -> pd.DataFrame:
        """A table of it for pandas, one row for each entry, units in the names; needs `shapegcode[study]`.

        Args:
            what: name of the attribute that is a list, such as "regions" or "cases"; empty: the first of them.

        Returns:
            The table; columns of nested values have dots in their names.

        Raises:
            ArgumentError: the result has no such list; the message has those that there are.
            ModuleNotFoundError: pandas is not installed.
        """
        from shapegcode.results.study import data_frame

        return data_frame(self, what)

    def to_xarray(self, what: str = "") -> xr.Dataset:
        """Its arrays for xarray, with dimensions and units; needs `shapegcode[study]`.

        Args:
            what: name of the attribute that holds them; empty: the first that has arrays.

        Returns:
            The arrays.

        Raises:
            ArgumentError: the result has no arrays; the message has those attributes that have.
            ModuleNotFoundError: xarray is not installed.
        """
        from shapegcode.results.study import data_set

        return data_set(self, what)

    def _repr_html_(self) -> str:
        """Answer and tables, for notebooks."""
        from shapegcode.results.page.default import short_html

        return short_html(self)
