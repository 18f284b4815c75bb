"""What every result says of itself: whether it is good, its cautions, what to do next; figures, tables, pictures.

The same fields give JSON, table, picture and page. A result's pictures are drawn by the module `plots` beside it, which
is loaded when somebody asks for them.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from shapegcode.results.json import plain
from shapegcode.results.values import NotKeptError, same_fields

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from shapegcode.results.table import Table


T = TypeVar("T")

Plot = Callable[..., "Axes"]
"""Draws one picture: ``plot(ax=None) -> Axes``, into the caller's axes or into a new figure."""


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
        """X, Y, Z."""
        return iter((self.x, self.y, self.z))

    def __getitem__(self, axis: str) -> T:
        """The value of "x", "y" or "z"."""
        if axis not in ("x", "y", "z"):
            raise KeyError(axis)
        value: T = getattr(self, axis)
        return value


class Outcome:
    """What every result is; see `shapegcode.results.result.Result`, which a class inherits.

    `json_extra` names the properties that the JSON holds beside the fields, with their types.
    """

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
        """What was asked, answered in one line: the first that the command says."""
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
        """What can be drawn of it, by name; each is called as ``plot(ax=None)`` and returns the axes."""
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
