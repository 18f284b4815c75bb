"""The stock file: the material before the first block of a program, in program coordinates."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, PrivateAttr, model_validator

from shapegcode.errors import Problem, StockError
from shapegcode.io.units import FloatArray
from shapegcode.settings.keys import Float, NonNegative, Positive, Text, TomlTable, key
from shapegcode.settings.load import KeyProblem, line_of, parsed, read_text, validated

Range = tuple[Float, Float]
Point = tuple[Float, Float]
Ring = Annotated[tuple[Point, ...], Field(min_length=3)]


class Upright(TomlTable):
    """A shape with ranges along the axes."""

    @model_validator(mode="after")
    def _ascend(self) -> Self:
        for name in ("x_mm", "y_mm", "z_mm"):
            low, high = getattr(self, name, (0.0, 1.0))
            if low >= high:
                raise KeyProblem(name, (low, high), "the first number must be smaller than the second")
        return self


class Box(Upright):
    """A cuboid."""

    x_mm: Range = key("from ... to along X")
    y_mm: Range = key("from ... to along Y")
    z_mm: Range = key("bottom and top")


class Polygon(Upright):
    """A prism over a polygon."""

    points_mm: Ring = key("corners [x, y] in order, three or more; the last is joined to the first")
    holes_mm: tuple[Ring, ...] = key("holes that go through, each as its corners", default=())
    z_mm: Range = key("bottom and top")


class Allowance(Upright):
    """Layer left by roughing on the walls finished by this program."""

    allowance_mm: Positive = key("thickness of the layer on the walls")
    corner_radius_mm: NonNegative = key(
        "radius left by roughing in inside corners: that of the roughing tool, or of its path there; wider corners "
        "keep their own. Not below the radius of the finishing tool"
    )
    wall: Literal["left", "right"] = key(
        "side of the tool's travel on which the wall of the part lies: right in climb milling with a clockwise "
        "spindle (as with G41), left in conventional milling"
    )
    z_mm: Range = key("bottom and top")
    width_mm: Positive = key(
        "depth of material considered behind the finished wall: more than the tool could gouge",
        default=5.0,
    )
    lead_in_mm: NonNegative = key(
        "length of the travel before the wall begins, in each sequence of cutting moves that is not closed "
        "(for a closed one the lead-in is found automatically)",
        default=0.0,
    )
    lead_out_mm: NonNegative = key("length of the travel after the wall's end, likewise", default=0.0)


class Solid(TomlTable):
    """A solid: a box or a polygon."""

    box: Box | None = key("a block", default=None)
    polygon: Polygon | None = key("a prism over a polygon", default=None)

    @model_validator(mode="after")
    def _exactly_one(self) -> Self:
        tables = type(self).model_fields
        given = [name for name in tables if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) if given else "none of them"
            raise ValueError(f"must have exactly one of the tables {', '.join(tables)}: has {found}")
        return self


class Rough(TomlTable):
    """Stock left by a program that ran before."""

    file: Text = key("the program that ran before; the name is relative to the folder of the stock file")
    tool: Text = key("file of its tool, likewise")
    on: Solid = key("stock before that program: [program.on.box] or [program.on.polygon]")


class Stock(Solid):
    """The material before the first block, in the work coordinates of the program: one of four kinds."""

    allowance: Allowance | None = key(
        "layer left by roughing on the walls finished by this program: even thickness, and more in the inside "
        "corners. Material on the other side of the tool is assumed gone",
        default=None,
    )
    program: Rough | None = key("stock left by a program that ran before", default=None)

    # Folder of the file, to resolve names in it; its name and text, for messages
    _folder: Path = PrivateAttr(default=Path())
    _source: str = PrivateAttr(default="<text>")
    _text: str = PrivateAttr(default="")

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a stock file.

        Args:
            path: the file; file names in it are relative to its folder.

        Returns:
            The stock.

        Raises:
            StockError: not TOML, or wrong keys or values; every problem is listed.
            OSError: the file cannot be read.
        """
        return cls.from_toml(read_text(Path(path), StockError), str(path), Path(path).parent)

    @classmethod
    def from_toml(cls, text: str, source: str = "<text>", folder: str | Path = ".") -> Self:
        """Read the text of a stock file.

        Args:
            text: the text.
            source: its name in messages.
            folder: folder to which file names in it are relative.

        Returns:
            The stock.

        Raises:
            StockError: not TOML, or wrong keys or values; every problem is listed.
        """
        stock = validated(cls, parsed(text, source, StockError), source, text, StockError)
        stock._folder, stock._source, stock._text = Path(folder), source, text
        return stock

    @property
    def kind(self) -> Literal["box", "polygon", "allowance", "program"]:
        """Which of the four tables the file has, by name."""
        return next(name for name in ("box", "polygon", "allowance", "program") if getattr(self, name) is not None)

    def beside(self, name: str) -> Path:
        """Path of a file named in this one.

        Args:
            name: name in the file.

        Returns:
            The path; a relative name is taken from the folder of this file.
        """
        return self._folder / name

    def error(self, key: str, value: str, limit: str) -> StockError:
        """Error for a key of this file that does not suit the program.

        Args:
            key: dotted name.
            value: its value as TOML.
            limit: the requirement.

        Returns:
            The error, to be raised, with the line of the key.
        """
        return StockError(self._source, (Problem(key, value, limit, line_of(key, self._text)),))


@dataclass(frozen=True)
class StockPiece:
    """A prism."""

    # corners, (n, 2), mm, first not repeated: the outline, counter-clockwise, then holes, clockwise
    rings: tuple[FloatArray, ...]
    bottom_mm: float  # lower end
    top_mm: float  # upper end
