"""Results as values: what of them travels in a pickle, and when two of them are the same.

The core's objects are handles. A path is built again; of any other one its figures travel, and what it computes is
missing in the copy and says so.
"""

from __future__ import annotations

import copyreg
import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from shapegcode import _core


class NotKeptError(_core.ArgumentError):
    """Something was asked of a result that was read back, from its JSON or a pickle, which does not hold it."""


class CoreFigures:
    """The figures of an object of the core, in a result that was pickled.

    Args:
        name: of its class.
        figures: by the name of the property.
    """

    def __init__(self, name: str, figures: Mapping[str, Any]) -> None:
        self.__dict__.update(figures)
        self._core_name = name

    def __getattr__(self, attribute: str) -> Any:
        """What the figures do not hold."""
        if attribute.startswith("_"):  # asked for by Python itself, such as by copy
            raise AttributeError(attribute)
        raise NotKeptError(
            f"{self._core_name}.{attribute}: a pickled result does not hold it; compute the result again to have it"
        )

    def __repr__(self) -> str:
        """Of what."""
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
    if is_dataclass(first) and _compares_fields(type(first)):
        return same_fields(first, second)
    if isinstance(first, Mapping):
        return first.keys() == second.keys() and all(_same(value, second[key]) for key, value in first.items())
    if isinstance(first, list | tuple):
        return len(first) == len(second) and all(map(_same, first, second))
    return bool(first == second) or bool(first != first and second != second)


def _compares_fields(kind: Any) -> bool:
    return kind.__eq__ is object.__eq__ or bool(kind.__dataclass_params__.eq)


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


def _reduced_path(path: _core.Path) -> tuple[Any, ...]:
    return _path, ([_parts(path[rank]) for rank in range(len(path))],)


def _parts(segment: _core.Segment) -> tuple[Any, ...]:
    if segment.kind == _core.SegmentKind.arc:
        centre, sweep = segment.centre_mm.copy(), segment.sweep_rad
        return segment.start_mm, segment.end_mm, centre, sweep, segment.feed_mm_per_s, segment.normal
    return segment.start_mm, segment.end_mm, segment.feed_mm_per_s


def _path(parts: list[tuple[Any, ...]]) -> _core.Path:
    """A path of the same motion; which lines it comes from is not known."""
    return _core.Path([_segment(each) for each in parts])


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
copyreg.pickle(_core.Path, _reduced_path)
copyreg.pickle(_core.Segment, lambda segment: (_segment, (_parts(segment),)))
copyreg.pickle(types.MappingProxyType, lambda mapping: (types.MappingProxyType, (dict(mapping),)))
