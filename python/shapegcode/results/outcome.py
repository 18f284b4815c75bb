"""Answer, equality and pickling of results; figures per axis, in µm. The module `plots` of a folder draws the pictures.

An unpickled result has its paths again; other objects of the core in it keep their figures, but cannot compute.
"""

from __future__ import annotations

import contextlib
import copyreg
import importlib
import math
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

import numpy as np

from shapegcode import _core
from shapegcode.hints import Hinted
from shapegcode.io.units import FloatArray
from shapegcode.results.json import OldNames, plain, sparse

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from shapegcode.results.table import Table


class NotKeptError(_core.ArgumentError):
    """A result that was read back from its JSON or a pickle does not contain the requested data."""


class CoreFigures:
    """Stands for a core object in an unpickled result: contains its figures, and nothing else."""

    def __init__(self, name: str, figures: Mapping[str, Any]) -> None:
        self.__dict__.update(figures)
        self._core_name = name

    def __getattr__(self, attribute: str) -> Any:
        if attribute.startswith("_"):  # requested by Python itself, such as by copy
            raise AttributeError(attribute)
        raise NotKeptError(
            f"{self._core_name}.{attribute}: a pickled result does not contain it; compute the result again"
        )

    def __repr__(self) -> str:
        return f"<figures of {self._core_name}>"


def same_fields(first: Any, second: Any) -> bool:
    """True if two dataclasses of one class have equal data: arrays by value, NaN equals NaN; handles are ignored."""
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
    """True for objects used to simulate or draw again: functions, and core objects without equality."""
    kind = type(value)
    return callable(value) or kind is CoreFigures or (kind.__module__ == _core.__name__ and kind in _HANDLES)


def _reduced(value: Any) -> tuple[Any, ...]:
    figures = {}
    for name, entry in vars(type(value)).items():
        with contextlib.suppress(_core.ShapegcodeError):  # a figure that this object does not have
            if isinstance(entry, property):
                figures[name] = getattr(value, name)
    return CoreFigures, (type(value).__name__, figures)


def _parts(segment: _core.Segment) -> tuple[Any, ...]:
    ends, feed = (segment.start_mm, segment.end_mm), segment.feed_mm_per_s
    if segment.kind == _core.SegmentKind.arc:
        return *ends, segment.centre_mm.copy(), segment.sweep_rad, feed, segment.normal
    return *ends, feed


def _segment(parts: tuple[Any, ...]) -> _core.Segment:
    return _core.Segment.line(*parts) if len(parts) == 3 else _core.Segment.arc(*parts)


_HANDLES = frozenset(
    kind
    for kind in vars(_core).values()
    if isinstance(kind, type) and vars(kind).get("__eq__") is None and not issubclass(kind, BaseException)
)
_IN_RESULTS = (  # in addition to objects made only by the core
    _core.Region, _core.ModalState, _core.Material, _core.MillingForce, _core.EndMill,
    _core.FeedStretch, _core.CuttingCoefficients, _core.ToolBeam, _core.FeedLimits,
)  # fmt: skip
for _kind in _HANDLES:
    if _kind in _IN_RESULTS or isinstance(vars(_kind)["__init__"], types.WrapperDescriptorType):
        copyreg.pickle(_kind, _reduced)
# The same motion; its program lines are not kept in the copy.
copyreg.pickle(_core.Path, lambda path: (_core.Path, ([path[rank] for rank in range(len(path))],)))
copyreg.pickle(_core.Segment, lambda segment: (_segment, (_parts(segment),)))
copyreg.pickle(types.MappingProxyType, lambda mapping: (types.MappingProxyType, (dict(mapping),)))


T = TypeVar("T")

Plot = Callable[..., "Axes"]  # plot one picture: ``plot(ax=None) -> Axes``, into the caller's axes or into a new figure


@dataclass(frozen=True)
class Pair(Generic[T]):
    """A figure before and after.

    Attributes:
        original: figure of the original program.
        emitted: figure of the emitted program.
    """

    original: T
    emitted: T

    def __getitem__(self, key: Any) -> Pair[Any]:
        """The pair of what is inside of both, such as of one axis."""
        original: Any = self.original
        emitted: Any = self.emitted
        return Pair(original[key], emitted[key])

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            inside = hasattr(vars(self).get("original"), name)  # absent while it is copied
            near = f".original.{name} or .emitted.{name}?" if inside else "it has .original and .emitted"
            raise AttributeError(f"a pair of figures has no {name!r}: {near}")


@dataclass(frozen=True)
class Xyz(Generic[T]):
    """One value per axis.

    Attributes:
        x: value of X.
        y: value of Y.
        z: value of Z.
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
    """Interface of every result; `json_extra`: properties written to the JSON in addition to the fields, with types."""

    is_read_back: bool = False
    """True if it was read back from JSON: data that are not in the JSON are missing."""

    json_extra: ClassVar[dict[str, Any]] = {"ok": bool, "warnings": tuple[str, ...], "next_step": str}

    warnings: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """True if it is done and within tolerance."""
        return True

    @property
    def answer(self) -> str:
        """The result in one line or a few, with which the command's output begins."""
        raise NotImplementedError

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        raise NotImplementedError

    def next_step_after(self, file: str) -> str:
        """The next step after a file was written."""
        return self._next_after(file)

    def _next_after(self, _file: str) -> str:
        return self.next_step

    @property
    def exit_code(self) -> int:
        """Exit code of the command: 0 done and within tolerance, 1 done but out of it; in some results 2: refused."""
        return 0 if self.ok else 1

    def to_dict(self) -> dict[str, Any]:
        """The fields and `json_extra` as JSON types: ``--json`` without what the command adds, such as provenance."""
        found: dict[str, Any] = plain(self)
        return found

    def to_json(self) -> dict[str, Any]:
        """The JSON that the command writes, as far as the result knows it."""
        return self._to_write()

    def _to_write(self) -> dict[str, Any]:
        """`to_dict` for immediate writing: very many rows may be `shapegcode.results.json.Streamed`."""
        return self.to_dict()

    def tables(self) -> list[Table]:
        """Tables that the command shows below its answer, in this order."""
        return []

    def plots(self) -> Mapping[str, Plot]:
        """Its pictures by name; each is called as ``plot(ax=None)`` and returns the axes."""
        return {}

    def save_plots(self, folder: str | Path) -> list[str]:
        """Write every picture as PNG and SVG into a folder, which is created if missing."""
        from shapegcode.results.plot import save_all

        return save_all(self.plots(), folder)

    def __eq__(self, other: object) -> bool:
        """True if both have equal data, including programs; handles for simulation and drawing are ignored."""
        return same_fields(self, other) if type(self) is type(other) else NotImplemented

    def __hash__(self) -> int:
        """Hash of class and answer, which are the same for equal results."""
        return hash(repr(self))

    def __repr__(self) -> str:
        """Class and answer: a result may contain millions of samples."""
        return f"<{type(self).__name__}: {self.answer}>"

    def _drawn_beside(self) -> Mapping[str, Plot]:
        """Pictures by the module `plots` of the result's folder, without those that need data not in the JSON."""
        plots_of: Callable[[Outcome], Mapping[str, Plot]] = self._beside("plots").plots_of
        if not self.is_read_back:
            return plots_of(self)
        try:
            return {name: plot for name, plot in plots_of(self).items() if _draws(plot)}
        except NotKeptError:
            return {}

    def _beside(self, name: str) -> Any:
        """Import a module of the folder that contains the result's class; on demand, since it imports that class."""
        return importlib.import_module(f"{type(self).__module__.rpartition('.')[0]}.{name}")


def _draws(plot: Plot) -> bool:
    try:
        plot()
    except NotKeptError:
        return False
    return True


CONTOURS = {"command": "contour error of the command", "response": "contour error of the machine table"}
"""Names of the contour errors of `Tracks`."""


@dataclass(frozen=True)
class Tracks(Hinted, Generic[T]):
    """A figure of the command, and the same figure of the machine table."""

    command: T  # of the set-points
    response: T  # of the table


@dataclass(frozen=True)
class Deviation:
    """Deviation of the command or of the machine table from the programmed path."""

    largest_mm: float  # distance, either side; also from each corner of the path to the motion
    left_mm: float  # to the left of the travel, or above
    right_mm: float  # to the right of it, or below

    @classmethod
    def of(cls, stats: Iterable[_core.DeviationStats]) -> Deviation:
        """Maxima over one or several runs."""
        return cls.largest(cls(each.max_abs_mm, each.most_positive_mm, -each.most_negative_mm) for each in stats)

    @classmethod
    def largest(cls, deviations: Iterable[Deviation]) -> Deviation:
        """Maximum of each field."""
        return cls(
            *map(max, zip(*((each.largest_mm, each.left_mm, each.right_mm) for each in deviations), strict=True))
        )

    def gouge_and_excess_um(self, material_side: str) -> dict[str, float]:
        """Material cut too deep (gouge) and material left (excess)."""
        gouge, excess = (self.left_mm, self.right_mm) if material_side == "left" else (self.right_mm, self.left_mm)
        return {"gouge": gouge * 1e3, "excess": excess * 1e3}


@dataclass(frozen=True)
class ContourError:
    """Deviation of command or table from the programmed path, µm."""

    max: float  # distance, either side; also from each corner of the path to the motion
    rms: float  # root mean square over all samples
    left: float  # largest to the left of the travel, or above
    right: float  # largest to the right of it, or below
    # largest deviation towards the workpiece (too much material removed); only if its side is known
    gouge: float | None = field(default=None, metadata=sparse())
    # largest deviation away from the workpiece (remaining material); likewise only if its side is known
    excess: float | None = field(default=None, metadata=sparse())

    @classmethod
    def of(cls, stats: Iterable[_core.DeviationStats], material_side: str | None = None) -> ContourError:
        """Combine one or several runs; all zero without any."""
        rows = list(stats)
        count = sum(row.count for row in rows)
        squares = sum(row.sum_of_squares_mm2 for row in rows)
        largest = Deviation.of(rows) if rows else Deviation(0.0, 0.0, 0.0)
        beside = {} if material_side is None else largest.gouge_and_excess_um(material_side)
        rms_mm = math.sqrt(squares / count) if count else 0.0
        return cls(largest.largest_mm * 1e3, rms_mm * 1e3, largest.left_mm * 1e3, largest.right_mm * 1e3, **beside)


def largest_xyz_um(vectors: Iterable[FloatArray]) -> Xyz[float]:
    """Maximum of each axis, converted from mm to µm."""
    rows = list(vectors)
    x, y, z = np.max(rows, axis=0) * 1e3 if rows else np.zeros(3)
    return Xyz(float(x), float(y), float(z))
