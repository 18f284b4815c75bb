"""Base of every result: page, pictures, tables for pandas and xarray, BibTeX entries of its methods (``--cite``).

The entries are in ``data/references.bib``, as text in docs/evidence/references.md.
"""

from __future__ import annotations

import dataclasses
import functools
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from shapegcode._core import ArgumentError
from shapegcode.results.json import FORMAT, Provenance, plain, this_version
from shapegcode.results.outcome import NotKeptError, Outcome
from shapegcode.results.page.model import Figure, Light, Page, Script, Section, page_of, sections_of, short_html

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes

    from shapegcode.results.page.scene import Scene

_UNITS = {
    "_mm_per_min": "mm/min", "_mm_per_s2": "mm/s²", "_mm_per_s": "mm/s", "_percent": "%", "_um": "µm", "_mm": "mm",
    "_ms": "ms", "_s": "s", "_hz": "Hz", "_n": "N", "_kg": "kg", "_rad": "rad", "_deg": "°",
}  # fmt: skip
_AXES = ("x", "y", "z")


class Simulatable(Protocol):
    """Interface to simulate one or two programs on a machine again for a page."""

    def scene(self, on_progress: Callable[[float], None] = ...) -> Scene | None:
        """Simulate the programs."""


class Result(Outcome):
    """Base of every result. A derived class is a frozen dataclass and implements the abstract members of `Outcome`."""

    published: ClassVar[tuple[str, ...]] = ()
    """Published methods on which every result of the class is based."""

    main_list: ClassVar[str] = ""
    """The list that `to_pandas` takes unless another one is named; empty: the first one."""

    @property
    def methods(self) -> tuple[str, ...]:
        """Published methods on which it is based, by their names in `METHODS`."""
        return self.published

    @property
    def citations(self) -> tuple[str, ...]:
        """BibTeX entries of this program and of the papers on its methods, printed by ``--cite``."""
        if self.is_read_back:
            raise NotKeptError("citations: the JSON of a result does not contain its methods; use --cite")
        return entries_of(self.methods)

    @property
    def simulated(self) -> Simulatable | None:
        """Handle to simulate the programs again for a page; overridden by a field in results of programs."""
        return None

    @property
    def light(self) -> tuple[Light, str]:
        """Colour of the traffic light on its page, and the reason."""
        if not self.ok:
            return "red", self.next_step
        if count := len(self.warnings):
            return "amber", f"{count} warning{'s' if count > 1 else ''} to resolve first"
        return "green", "done, without a warning"

    def key_figures(self) -> tuple[Figure, ...]:
        """The main figures at the top of its page; usually none."""
        return ()

    def page_sections(self, provenance: Provenance | None = None) -> tuple[Section, ...]:
        """Sections of its page between verdict and provenance.

        Args:
            provenance: command, version and files of the result; None: unknown.

        Returns:
            Main figures, warnings, next step, tables and pictures, unless the class overrides this.
        """
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
            motion: simulate the programs again for the rotatable picture of the motion; False: without it.
            provenance: command, version and files of the result; None: unknown, as from Python.
            problems: problems of the page, such as a program that was changed since.
            on_progress: called with the finished fraction, 0 to 1.

        Returns:
            The page, as data.

        Raises:
            MachineError, NumericError: a program cannot be simulated.
        """
        simulated = self.simulated if motion else None
        scene = None if simulated is None else simulated.scene(on_progress)
        if scene is not None and not self.is_read_back:
            scene = self._completed(scene)
        return page_of(self, self.light, self.page_sections(provenance), scene, provenance, problems)

    def _completed(self, scene: Scene) -> Scene:
        """Add data of the result to the motion for a page; here none, overridden by results that have such data."""
        return scene

    def to_json(self) -> dict[str, Any]:
        """`to_dict` with class and version, so that a file of it is read by `load_result`; `json.dump` can write it."""
        provenance = Provenance(type(self).__name__, this_version(), FORMAT, "", ())
        return {**self._to_write(), "provenance": plain(provenance)}

    def report(self, path: str | Path, script: Script = "inline") -> list[str]:
        """Write the page of the result: one HTML file, readable offline.

        Args:
            path: path of the file.
            script: "inline": all in one file; "beside": Plotly's script in a file of the same folder, shared by pages.

        Returns:
            The files written.

        Raises:
            ArgumentError: another word for `script`, or a file name that ends otherwise, such as .json.
            MachineError, NumericError: a program cannot be simulated.
            OSError: a file cannot be written.
        """
        from shapegcode.results.page.html import save

        if Path(path).suffix.lower() in {".json", ".nc", ".csv", ".png", ".pdf", ".svg", ".md", ".txt"}:
            raise ArgumentError(f"{path}: report() writes an HTML page; JSON: to_json(), pictures: plot()")
        return save(self.page(), path, script)

    def plot(self, name: str = "", ax: Axes | None = None) -> Axes:
        """Draw one of its pictures.

        Args:
            name: one of `plots()`; empty: the first of them.
            ax: axes to draw into; None: a new figure.

        Returns:
            The axes.

        Raises:
            ArgumentError: there is no such picture; the message lists the existing ones.
        """
        plots = self.plots()
        if not plots or (name and name not in plots):
            there = f"one of {', '.join(plots)}" if plots else "this result has no picture"
            raise ArgumentError(f"plot {name}: {there}" if name else there)
        return plots[name or next(iter(plots))](ax)

    def to_pandas(self, what: str = "") -> pd.DataFrame:
        """One of its lists as a pandas table, one row per entry, units in the names; needs `shapegcode[study]`.

        Args:
            what: name of a list attribute, such as "regions" or "cases"; empty: `main_list`.

        Returns:
            The table; columns of nested values have dots in their names.

        Raises:
            ArgumentError: the result has no such list; the message lists the existing ones.
            ModuleNotFoundError: pandas is not installed.
        """
        import pandas as pd

        lists = {field.name: getattr(self, field.name) for field in _fields(self)}
        lists = {name: rows for name, rows in lists.items() if _is_list_of_rows(rows)}
        name = _chosen(what or self.main_list, lists, "a list of rows")
        table = pd.json_normalize([plain(row) for row in lists[name]])
        table.attrs = {"of": name, "units": {str(column): unit for column in table if (unit := _unit(str(column)))}}
        return table

    def to_xarray(self, what: str = "") -> xr.Dataset:
        """Arrays of the result, or of one of its attributes, for xarray; needs `shapegcode[study]`.

        Args:
            what: name of the attribute with arrays, or of the result's class for its own; empty: the first with any.

        Returns:
            The arrays, with dimensions and units.

        Raises:
            ArgumentError: no such attribute with arrays; the message lists those that exist.
            ModuleNotFoundError: xarray is not installed.
        """
        import xarray as xr

        holders = {type(self).__name__: self} | {field.name: getattr(self, field.name) for field in _fields(self)}
        parts = {name: found for name, held in holders.items() if (found := _arrays(held))}
        name = _chosen(what, parts, "arrays")
        arrays = parts[name]
        # The common dimension has the length of times or frequencies; a dimension of length three is the axis.
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
        """Answer, warnings, tables and next step, for notebooks."""
        return short_html(self)


def _fields(value: object) -> Sequence[dataclasses.Field[Any]]:
    return dataclasses.fields(value) if dataclasses.is_dataclass(value) and not isinstance(value, type) else ()


def _is_list_of_rows(value: object) -> bool:
    if not isinstance(value, Sequence) or isinstance(value, str | bytes) or not value:
        return False
    return all(dataclasses.is_dataclass(row) or isinstance(row, Mapping) for row in value)


def _arrays(value: object) -> dict[str, np.ndarray[Any, Any]]:
    """Arrays among the fields, also those that are not in the JSON."""
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
    """Unit by the ending of the name; of a nested name by its innermost part with a unit."""
    parts = reversed(name.split("."))
    return next((unit for part in parts for ending, unit in _UNITS.items() if part.endswith(ending)), "")


#: Keys of the BibTeX entries of each method; empty: a method of this program or of the user.
METHODS: Mapping[str, tuple[str, ...]] = {
    "shaper zv": ("smith1958", "park2009"),
    "shaper zvd": ("singer1990",),
    "shaper zvdd": ("singer1990",),
    "shaper mzv": ("klipper",),
    "shaper ei": ("singhose1994vector",),
    "shaper ei2": ("singhose1997",),
    "shaper ei3": ("singhose1997",),
    "shaper si": ("singhose1996",),
    "shaper negative-zv": ("singhose1994negative",),
    "shaper minimal": ("park2009",),
    **{f"shaper smooth-{name}": ("kalico",) for name in ("zv", "mzv", "ei", "ei2", "si", "zvd-ei")},
    "rounding of block ends": ("jelinek1971",),
    "comparison of programs": ("myers1986",),
    "block overlap": ("lee2022",),
    "junction deviation": ("jeon2011",),
    "LuGre friction": ("canudas1995",),
    "cutting force": ("kim2001",),
    "modes from records": ("back2003", "steiglitz1965", "roy1989", "golub2003"),
    "modes from frequency responses": ("guillaume2003", "ewins", "golub2003"),
    "circle fit": ("chernov2010",),
    "path of paper 000": ("ko2023",),
    "modes from a sweep": (),
    **{f"shaper {name}": () for name in ("simultaneous", "polynomial", "non-negative", "robust", "mirrored", "taps")},
}


@functools.cache
def bibliography() -> Mapping[str, str]:
    """Every entry of references.bib by its key, that of shapegcode itself first."""
    text = (resources.files("shapegcode") / "data" / "references.bib").read_text(encoding="utf-8")
    return {re.split(r"[{,]", entry, maxsplit=2)[1]: entry for entry in text.strip().split("\n\n")}


def entries_of(methods: Iterable[str]) -> tuple[str, ...]:
    """The entries of the program and of the methods, each once, in the order of the file."""
    keys = {"shapegcode", *(key for name in methods for key in METHODS[name])}
    return tuple(entry for key, entry in bibliography().items() if key in keys)
