"""What controls other than FANUC's read: a row of data/control/dialects.toml for each dialect that `convert` writes."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from typing import Any, Literal

CODE = re.compile(r"[GM]\d+(?:\.\d)?")  # a code of a program, as it is written

DialectName = Literal["fanuc", "haas", "mitsubishi", "siemens", "linuxcnc", "klipper", "isg"]


@dataclass(frozen=True)
class Fact:
    """One thing that is known of a control, or assumed."""

    text: str
    source: str = ""  # page or recording; empty: assumed


@dataclass(frozen=True)
class Dialect:
    """How programs for a control are written."""

    control: str  # its name
    facts: Mapping[str, Fact]  # by topic, what holds there and where that is written
    same: frozenset[str]  # words that mean what they mean on a FANUC control
    # words that are written otherwise, and how; empty: left out, as it says nothing there
    becomes: Mapping[str, str] = field(default_factory=dict)
    means: Mapping[str, str] = field(default_factory=dict)  # words that mean something else there, for the refusal
    # words that mean the same as far as the control is set up so
    cautions: Mapping[str, str] = field(default_factory=dict)
    # "tape": `%` and the O number; "percent": `%` alone; "name": `%` and the name in the first line; "none"
    frame: Literal["tape", "percent", "name", "none"] = "tape"
    comment: str = "("  # "(" for comments in brackets, ";" for those that reach to the end of the line
    opening: tuple[str, ...] = ()  # lines before the first block
    dwell: str = "G04P{ms}"  # of one; `{s}` seconds, `{ms}` milliseconds
    arc_radius: str = "R"  # address of the radius of an arc; empty: there is none, as arcs are written as chords
    # largest distance of an arc from the chords that are written for it; 0: arcs stay arcs
    chord_tolerance_mm: float = 0.0
    time_feed: bool = False  # shaped blocks carry their time in seconds, with G93
    one_code: bool = False  # a line holds one code, and each move its own G
    short_codes: bool = False  # codes have no leading zeros
    # digits of positions in mm in shaped blocks; None: as many as `controller.least_increment_mm` has
    decimals: int | None = None
    feed_decimals: int | None = None  # likewise of F; None: `controller.feed_decimals_mm`
    # how far the middle of an arc may be moved so that blocks meet at smaller angles; 0: not at all
    smooth_arcs_um: float = 0.0
    least_block_s: float | None = None  # shortest block that the control runs; None: not known
    # lines that switch the feed override off, and on again; empty: none are known
    lock: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    lock_word: str = ""  # word of every shaped block that does it instead
    # lines before and behind a block with G09, "" behind: the mode in force; None: a word like others
    exact_stop: tuple[str, str] | None = None
    header: tuple[str, ...] = ()  # comments for the operator

    @property
    def assumed(self) -> tuple[str, ...]:
        """Topics for which there is no source."""
        return tuple(topic for topic, fact in self.facts.items() if not fact.source)


@cache
def _rows() -> tuple[Mapping[str, Dialect], Mapping[str, str]]:
    """The dialects by name, and what words say on a FANUC control."""
    file = resources.files("shapegcode") / "data" / "control" / "dialects.toml"
    tables = tomllib.loads(file.read_text(encoding="utf-8"))
    fanuc = {code: text for codes, text in tables.pop("fanuc").items() for code in codes.split()}
    rows = {}
    for name, table in tables.items():
        facts = {topic: Fact(**fact) for topic, fact in table.pop("facts").items()}
        same = frozenset(table.pop("same").split())
        rows[name] = Dialect(facts=facts, same=same, **{key: _tuples(value) for key, value in table.items()})
    return rows, fanuc


def all_dialects() -> Mapping[str, Dialect]:
    """Every dialect but FANUC's own, by name."""
    return _rows()[0]


def dialect_of(name: str) -> Dialect | None:
    """The dialect of `emission.dialect`; None: FANUC's words, which everything else here reads and writes."""
    return None if name == "fanuc" else _rows()[0][name]


def fanuc_meaning(code: str) -> str:
    """What a code says on a FANUC control, for messages."""
    own = "a function of the machine builder" if code.startswith("M") else "a code of its own"
    return _rows()[1].get(code, own)


def code_name(word: str) -> str:
    """A code with two digits: G4 is G04."""
    number, point, decimals = word[1:].partition(".")
    return f"{word[0]}{number.zfill(2)}{point}{decimals}" if number.isdigit() else word


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
