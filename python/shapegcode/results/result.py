"""Base of every result: what it says of itself, when two are equal, and what it offers beside its fields: page,
pictures (of the module `plots` beside its class), tables for pandas and xarray. Figures per axis, in µm.

In a pickle a path is built again; of other objects of the core the figures travel, and what they compute is missing.
"""

from __future__ import annotations

import copyreg
import dataclasses
import importlib
import math
import types
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Protocol, TypeVar

import numpy as np

from shapegcode import _core
from shapegcode._core import ArgumentError
from shapegcode.io.units import FloatArray
from shapegcode.results.json import OldNames, plain, sparse

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes

    from shapegcode.results.json import Made
    from shapegcode.results.page.model import Figure, Light, Page, Script, Section
    from shapegcode.results.page.scene import Scene
    from shapegcode.results.table import Table


class NotKeptError(_core.ArgumentError):
    """A result that was read back from its JSON or a pickle does not hold the requested data."""


class CoreFigures:
    """The figures of an object of the core, in a result that was pickled."""

    def __init__(self, name: str, figures: Mapping[str, Any]) -> None:
        self.__dict__.update(figures)
        self._core_name = name

    def __getattr__(self, attribute: str) -> Any:
        if attribute.startswith("_"):  # asked for by Python itself, such as by copy
            raise AttributeError(attribute)
        raise NotKeptError(
            f"{self._core_name}.{attribute}: a pickled result does not hold it; compute the result again to have it"
        )

    def __repr__(self) -> str:
        return f"<figures of {self._core_name}>"


def same_fields(first: Any, second: Any) -> bool:
    """Whether two dataclasses of one class hold the same data: arrays by value, NaN like NaN; handles are no data."""
    return all(_same(getattr(first, each.name), getattr(second, each.name)) for each in fields(first) if each.compare)


def _same(first: Any, second: Any) -> bool:
    if first is second or (_is_handle(first) and _is_handle(second)):
        return True
    if isinstance(first, np.ndarray) and isinstance(second, np.ndarray):
        return np.array_equal(first, second, equal_nan=first.dtype.kind in "fc" and second.dtype.kind in "fc")
    if type(first) is not type(second):
        return False
    kind: Any = type(first)
    if is_dataclass(first) and (kind.__eq__ is object.__eq__ or kind.__dataclass_params__.eq):
        return same_fields(first, second)
    if isinstance(first, Mapping):
        return first.keys() == second.keys() and all(_same(value, second[key]) for key, value in first.items())
    if isinstance(first, list | tuple):
        return len(first) == len(second) and all(map(_same, first, second))
    return bool(first == second) or bool(first != first and second != second)


def _is_handle(value: Any) -> bool:
    """What is there to simulate or draw again: a function, or an object of the core that has no equality."""
    kind = type(value)
    return callable(value) or kind is CoreFigures or (kind.__module__ == _core.__name__ and kind in _HANDLES)


def _reduced(value: Any) -> tuple[Any, ...]:
    figures = {}
    for name, entry in vars(type(value)).items():
        if isinstance(entry, property):
            try:
                figures[name] = getattr(value, name)
            except _core.ShapegcodeError:
                continue  # a figure that this one does not have
    return CoreFigures, (type(value).__name__, figures)


def _parts(segment: _core.Segment) -> tuple[Any, ...]:
    if segment.kind == _core.SegmentKind.arc:
        centre, sweep = segment.centre_mm.copy(), segment.sweep_rad
        return segment.start_mm, segment.end_mm, centre, sweep, segment.feed_mm_per_s, segment.normal
    return segment.start_mm, segment.end_mm, segment.feed_mm_per_s


def _segment(parts: tuple[Any, ...]) -> _core.Segment:
    return _core.Segment.line(*parts) if len(parts) == 3 else _core.Segment.arc(*parts)


_HANDLES = frozenset(
    kind
    for kind in vars(_core).values()
    if isinstance(kind, type) and vars(kind).get("__eq__") is None and not issubclass(kind, BaseException)
)
_IN_RESULTS = (  # beside what only the core makes
    _core.Region, _core.ModalState, _core.Material, _core.MillingForce, _core.EndMill,
    _core.FeedStretch, _core.CuttingCoefficients, _core.ToolBeam, _core.FeedLimits,
)  # fmt: skip
for _kind in _HANDLES:
    if _kind in _IN_RESULTS or isinstance(vars(_kind)["__init__"], types.WrapperDescriptorType):
        copyreg.pickle(_kind, _reduced)
# Of the same motion; which lines it comes from is not known in the copy.
copyreg.pickle(_core.Path, lambda path: (_core.Path, ([path[rank] for rank in range(len(path))],)))
copyreg.pickle(_core.Segment, lambda segment: (_segment, (_parts(segment),)))
copyreg.pickle(types.MappingProxyType, lambda mapping: (types.MappingProxyType, (dict(mapping),)))


T = TypeVar("T")

Plot = Callable[..., "Axes"]
"""Plot one picture: ``plot(ax=None) -> Axes``, into the caller's axes or into a new figure."""


@dataclass(frozen=True)
class Pair(Generic[T]):
    """A figure before and after.

    Attributes:
        original: of the program as it was.
        emitted: of the program as it was written.
    """

    original: T
    emitted: T


@dataclass(frozen=True)
class Xyz(Generic[T]):
    """One value per axis.

    Attributes:
        x: of X.
        y: of Y.
        z: of Z.
    """

    x: T
    y: T
    z: T

    def __iter__(self) -> Iterator[T]:
        return iter((self.x, self.y, self.z))

    def __getitem__(self, axis: str) -> T:
        if axis not in ("x", "y", "z"):
            raise KeyError(axis)
        value: T = getattr(self, axis)
        return value


class Outcome(OldNames):
    """What every result is; `json_extra` names properties that the JSON holds beside the fields, with their types."""

    from_json: bool = False
    """It was read back from its JSON: what no JSON holds is missing."""

    json_extra: ClassVar[dict[str, Any]] = {"ok": bool, "warnings": tuple[str, ...], "next_step": str}

    warnings: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether it is done and within tolerance."""
        raise NotImplementedError

    @property
    def answer(self) -> str:
        """The result in one line: the first line of the command's output."""
        raise NotImplementedError

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        raise NotImplementedError

    def next_step_after(self, file: str) -> str:
        """The one thing to do next once a file was written with it."""
        del file
        return self.next_step

    @property
    def exit_code(self) -> int:
        """Of the command: 0 done and within tolerance, 1 done but out of tolerance, 2 refused."""
        return 0 if self.ok else 1

    def to_dict(self) -> dict[str, Any]:
        """What ``--json`` writes: the fields and `json_extra`, as JSON knows them; see `shapegcode.results.json`."""
        found: dict[str, Any] = plain(self)
        return found

    def to_json(self) -> dict[str, Any]:
        """`to_dict` for who writes it at once: very many rows may be `shapegcode.results.json.Streamed`."""
        return self.to_dict()

    def tables(self) -> list[Table]:
        """What the command shows below its answer, in this order."""
        return []

    def plots(self) -> Mapping[str, Plot]:
        """Its pictures by name; each is called as ``plot(ax=None)`` and returns the axes."""
        return {}

    def save_plots(self, folder: str | Path) -> list[str]:
        """Write every picture as PNG and SVG into a folder, which is made where it is missing."""
        from shapegcode.results.plot import save_all

        return save_all(self.plots(), folder)

    def __eq__(self, other: object) -> bool:
        """Whether both hold the same data; programs count, what there is to simulate and draw again does not."""
        return same_fields(self, other) if type(self) is type(other) else NotImplemented

    def __hash__(self) -> int:
        """By class and answer: equal results have the same ones."""
        return hash(repr(self))

    def __repr__(self) -> str:
        """Class and answer: a result may hold millions of samples."""
        return f"<{type(self).__name__}: {self.answer}>"

    def _drawn_beside(self) -> Mapping[str, Plot]:
        """The pictures that the module `plots` of the result's folder offers for it: its `plots_of(result)`."""
        return self._drawable(lambda: self._beside("plots").plots_of(self))

    def _drawable(self, plots_of: Callable[[], Mapping[str, Plot]]) -> Mapping[str, Plot]:
        """Pictures, without those that need what is missing in a result that was read back from its JSON."""
        if not self.from_json:
            return plots_of()
        try:
            return {name: plot for name, plot in plots_of().items() if _draws(plot)}
        except NotKeptError:
            return {}

    def _beside(self, name: str) -> Any:
        """A module of the result's folder, which imports the result and is loaded when somebody asks for it."""
        return importlib.import_module(f"{type(self).__module__.rpartition('.')[0]}.{name}")


def _draws(plot: Plot) -> bool:
    try:
        plot()
    except NotKeptError:
        return False
    return True


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

    def page_sections(self, made: Made | None = None) -> tuple[Section, ...]:
        """Sections of its page between verdict and provenance.

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
            motion: simulate the programs again for the picture that one can turn; else the page has none.
            made: of what the result was made; None: from Python, it is not known.
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
            sections=self.page_sections(made),
            scene=None if simulated is None else simulated.scene(on_progress),
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

        parts: dict[str, dict[str, np.ndarray[Any, Any]]] = {}
        own = _arrays(self)
        if own:
            parts[type(self).__name__] = own
        for each in _fields(self):
            value = getattr(self, each.name)
            if dataclasses.is_dataclass(value) and not isinstance(value, type) and (found := _arrays(value)):
                parts[each.name] = found
        name = _chosen(what, parts, "arrays")
        arrays = parts[name]
        # They share the dimension that is as long as the times or frequencies; one of length three is the axis.
        index = next((key for key in arrays if key.startswith(("times_", "time_", "frequency_", "frequencies_"))), None)
        length = len(arrays[index]) if index is not None else -1
        variables = {}
        for key, array in arrays.items():
            dimensions = [
                (index or key) if size == length and rank == 0 else ("axis" if size == len(_AXES) else f"{key}_{rank}")
                for rank, size in enumerate(array.shape)
            ]
            variables[key] = xr.DataArray(array, dims=dimensions, attrs={"units": unit} if (unit := _unit(key)) else {})
        whole = xr.Dataset(variables, attrs={"of": name})
        return whole.assign_coords(axis=list(_AXES)) if "axis" in whole.dims else whole

    def _repr_html_(self) -> str:
        """Answer and tables, for notebooks."""
        from shapegcode.results.page.default import short_html

        return short_html(self)


def _fields(value: object) -> Sequence[dataclasses.Field[Any]]:
    return dataclasses.fields(value) if dataclasses.is_dataclass(value) else ()


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
    for part in reversed(name.split(".")):
        for ending, unit in _UNITS.items():
            if part.endswith(ending):
                return unit
    return ""


CONTOURS = {"command": "contour error of the command", "response": "contour error of the machine table"}
"""What the contour errors of `Tracks` are called."""


@dataclass(frozen=True)
class Tracks(Generic[T]):
    """A figure of both tracks that a machine makes."""

    command: T  # of the set-points
    response: T  # of the table


@dataclass(frozen=True)
class Deviation:
    """How far a track leaves the programmed path."""

    largest_mm: float  # distance, either side; corners that the track cuts short count too
    left_mm: float  # to the left of the travel, or above
    right_mm: float  # to the right of it, or below

    @classmethod
    def of(cls, stats: Iterable[_core.DeviationStats]) -> Deviation:
        """The largest of one or several runs."""
        return cls.largest(cls(each.max_abs_mm, each.most_positive_mm, -each.most_negative_mm) for each in stats)

    @classmethod
    def largest(cls, deviations: Iterable[Deviation]) -> Deviation:
        """The largest of each."""
        rows = list(deviations)
        return cls(
            max(each.largest_mm for each in rows),
            max(each.left_mm for each in rows),
            max(each.right_mm for each in rows),
        )

    def gouge_and_excess_um(self, material_side: str) -> dict[str, float]:
        """Material cut too deep (gouge) and material left (excess)."""
        gouge, excess = (self.left_mm, self.right_mm) if material_side == "left" else (self.right_mm, self.left_mm)
        return {"gouge": gouge * 1e3, "excess": excess * 1e3}


@dataclass(frozen=True)
class ContourError:
    """How far a track leaves the programmed path, in µm."""

    max: float  # distance, either side; corners that the track cuts short count too
    rms: float  # root mean square over all samples
    left: float  # largest to the left of the travel, or above
    right: float  # largest to the right of it, or below
    # largest towards the workpiece, which cuts too much; only where the side of the workpiece is known
    gouge: float | None = field(default=None, metadata=sparse())
    # largest away from it, which leaves material standing; likewise
    excess: float | None = field(default=None, metadata=sparse())

    @classmethod
    def of(cls, stats: Iterable[_core.DeviationStats], material_side: str | None = None) -> ContourError:
        """Of one or several runs together; all zero without any."""
        rows = list(stats)
        count = sum(row.count for row in rows)
        squares = sum(row.sum_of_squares_mm2 for row in rows)
        largest = Deviation.of(rows) if rows else Deviation(0.0, 0.0, 0.0)
        beside = {} if material_side is None else largest.gouge_and_excess_um(material_side)
        return cls(
            largest.largest_mm * 1e3,
            math.sqrt(squares / count) * 1e3 if count else 0.0,
            largest.left_mm * 1e3,
            largest.right_mm * 1e3,
            **beside,
        )


def largest_xyz_um(vectors: Iterable[FloatArray]) -> Xyz[float]:
    """Largest of each axis, mm to µm."""
    rows = list(vectors)
    x, y, z = np.max(rows, axis=0) * 1e3 if rows else np.zeros(3)
    return Xyz(float(x), float(y), float(z))
