"""Base of every result: what it offers beside its fields: page, pictures, tables for pandas and xarray."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from shapegcode._core import ArgumentError
from shapegcode.results.json import plain
from shapegcode.results.outcome import NotKeptError, Outcome, Pair, Plot, Xyz

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes

    from shapegcode.results.json import Provenance
    from shapegcode.results.page.model import Figure, Light, Page, Script, Section
    from shapegcode.results.page.scene import Scene

__all__ = ["Pair", "Plot", "Result", "Simulatable", "Xyz"]

_UNITS = {
    "_mm_per_min": "mm/min", "_mm_per_s2": "mm/s²", "_mm_per_s": "mm/s", "_percent": "%", "_um": "µm", "_mm": "mm",
    "_ms": "ms", "_s": "s", "_hz": "Hz", "_n": "N", "_kg": "kg", "_rad": "rad", "_deg": "°",
}  # fmt: skip
_AXES = ("x", "y", "z")


class Simulatable(Protocol):
    """What can be simulated again for a page: a program, or two of them, on a machine."""

    def scene(self, on_progress: Callable[[float], None] = ...) -> Scene | None:
        """Simulate it."""


class Result(Outcome):
    """Base of every result. A class that inherits it is a frozen dataclass and says what is abstract in `Outcome`."""

    published: ClassVar[tuple[str, ...]] = ()
    """Methods of others that every result of the class rests on."""

    @property
    def methods(self) -> tuple[str, ...]:
        """Published methods that it rests on, by their names in `shapegcode.results.citations.METHODS`."""
        return self.published

    @property
    def citations(self) -> tuple[str, ...]:
        """BibTeX entries of this program and of the papers behind its methods: what ``--cite`` prints."""
        from shapegcode.results.citations import entries_of

        if self.from_json:
            raise NotKeptError("citations: the JSON of a result does not hold its methods; run the command with --cite")
        return entries_of(self.methods)

    @property
    def simulated(self) -> Simulatable | None:
        """What was simulated, to simulate it again for a page; a result of programs has a field of this name."""
        return None

    @property
    def light(self) -> tuple[Light, str]:
        """Colour of the traffic light on its page, and the reason."""
        if not self.ok:
            return "red", self.next_step
        if count := len(self.warnings):
            return "amber", f"{count} warning{'s' if count > 1 else ''} to resolve first"
        return "green", "done, without a warning"

    @property
    def page_title(self) -> str:
        """Heading of its page: what was done with what."""
        from shapegcode.results.page.default import title_of

        return title_of(self)

    def key_figures(self) -> tuple[Figure, ...]:
        """The main figures at the top of its page; usually none."""
        return ()

    def page_sections(self, provenance: Provenance | None = None) -> tuple[Section, ...]:
        """Sections of its page between verdict and provenance.

        Args:
            provenance: command, version and files of the result; None: it is not known.

        Returns:
            Tables and pictures, unless the class has more to show.
        """
        from shapegcode.results.page.default import sections_of

        return sections_of(self, self.key_figures())

    def page(
        self,
        *,
        motion: bool = True,
        provenance: Provenance | None = None,
        problems: Sequence[str] = (),
        on_progress: Callable[[float], None] = lambda _done: None,
    ) -> Page:
        """The result as a page.

        Args:
            motion: simulate the programs again for the picture that one can turn; else the page has none.
            provenance: command, version and files of the result; None: from Python, it is not known.
            problems: what is not as it should be with the page, such as a program that was changed since.
            on_progress: called with the share that is done.

        Returns:
            The page, as data.

        Raises:
            MachineError, NumericError: a program cannot be simulated.
        """
        from shapegcode.results.page.default import page_of

        simulated = self.simulated if motion else None
        return page_of(
            self,
            title=self.page_title,
            light=self.light,
            sections=self.page_sections(provenance),
            scene=None if simulated is None else simulated.scene(on_progress),
            provenance=provenance,
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
            MachineError, NumericError: a program cannot be simulated.
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
        import pandas as pd

        lists = {field.name: getattr(self, field.name) for field in _fields(self)}
        lists = {name: rows for name, rows in lists.items() if _is_list_of_rows(rows)}
        name = _chosen(what, lists, "a list of rows")
        table = pd.json_normalize([plain(row) for row in lists[name]])
        table.attrs = {"of": name, "units": {str(column): unit for column in table if (unit := _unit(str(column)))}}
        return table

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
        import xarray as xr

        holders = {type(self).__name__: self} | {field.name: getattr(self, field.name) for field in _fields(self)}
        parts = {name: found for name, held in holders.items() if (found := _arrays(held))}
        name = _chosen(what, parts, "arrays")
        arrays = parts[name]
        # They share the dimension that is as long as the times or frequencies; one of length three is the axis.
        index = next((key for key in arrays if key.startswith(("times_", "time_", "frequency_", "frequencies_"))), None)
        length = len(arrays[index]) if index is not None else -1
        variables = {}
        for key, array in arrays.items():
            dimensions = ["axis" if size == len(_AXES) else f"{key}_{rank}" for rank, size in enumerate(array.shape)]
            dimensions[0] = index or key if array.shape[0] == length else dimensions[0]
            variables[key] = xr.DataArray(array, dims=dimensions, attrs={"units": unit} if (unit := _unit(key)) else {})
        whole = xr.Dataset(variables, attrs={"of": name})
        return whole.assign_coords(axis=list(_AXES)) if "axis" in whole.dims else whole

    def _repr_html_(self) -> str:
        """Answer and tables, for notebooks."""
        from shapegcode.results.page.default import short_html

        return short_html(self)


def _fields(value: object) -> Sequence[dataclasses.Field[Any]]:
    return dataclasses.fields(value) if dataclasses.is_dataclass(value) and not isinstance(value, type) else ()


def _is_list_of_rows(value: object) -> bool:
    if not isinstance(value, Sequence) or isinstance(value, str | bytes) or not value:
        return False
    return all(dataclasses.is_dataclass(row) or isinstance(row, Mapping) for row in value)


def _arrays(value: object) -> dict[str, np.ndarray[Any, Any]]:
    """Arrays among the fields, also those that no JSON holds."""
    found = {field.name: getattr(value, field.name) for field in _fields(value)}
    return {name: array for name, array in found.items() if isinstance(array, np.ndarray) and array.ndim > 0}


def _chosen(what: str, there: Mapping[str, object], kind: str) -> str:
    if what in there:
        return what
    if there and not what:
        return next(iter(there))
    has = f"it has {', '.join(there)}" if there else f"it has no {kind}"
    raise ArgumentError(f"{what or 'this result'}: not {kind} of this result; {has}" if what else f"this result: {has}")


def _unit(name: str) -> str:
    """Of a plain number, as its name ends; of a nested one by the name that says it."""
    parts = reversed(name.split("."))
    return next((unit for part in parts for ending, unit in _UNITS.items() if part.endswith(ending)), "")
