"""Dialects of controls other than FANUC's: data/control/dialects.toml has a row for each that `convert` writes."""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from typing import Any, Literal

CODE = re.compile(r"[GM]\d+(?:\.\d)?")  # a code as written in a program

DialectName = Literal["fanuc", "haas", "mitsubishi", "siemens", "linuxcnc", "klipper", "isg"]


@dataclass(frozen=True)
class Fact:
    """A known or assumed property of a control."""

    text: str
    source: str = ""  # page or recording; empty: assumed


@dataclass(frozen=True)
class Dialect:
    """Rules for writing programs for a control."""

    control: str  # its name
    facts: Mapping[str, Fact]  # by topic
    same: frozenset[str]  # words with the same meaning as on a FANUC control
    # replacements of words; "": the word is left out
    becomes: Mapping[str, str] = field(default_factory=dict)
    means: Mapping[str, str] = field(default_factory=dict)  # words with another meaning, for the error message
    # words whose meaning depends on the setup of the control
    cautions: Mapping[str, str] = field(default_factory=dict)
    # "tape": `%` and the O number; "percent": `%` alone; "name": `%` and the name in the first line; "none"
    frame: Literal["tape", "percent", "name", "none"] = "tape"
    comment: str = "("  # "(": comments in brackets, ";": to the end of the line
    opening: tuple[str, ...] = ()  # lines before the first block
    dwell: str = "G04P{ms}"  # format of a dwell; `{s}` seconds, `{ms}` milliseconds
    arc_radius: str = "R"  # address of the radius of an arc; empty: arcs are written as chords
    # largest distance of an arc from its chords; 0: arcs stay arcs
    chord_tolerance_mm: float = 0.0
    arc_radius_ratio: float = 0.0  # largest relative difference of the radii at both ends of an arc; 0: no such limit
    time_feed: bool = False  # F of shaped blocks is their time in seconds, with G93
    one_code: bool = False  # one code per line, and G in every move
    short_codes: bool = False  # codes have no leading zeros
    # decimals of positions in mm in shaped blocks; None: those of `controller.least_increment_mm`
    decimals: int | None = None
    feed_decimals: int | None = None  # decimals of F; None: `controller.feed_decimals_mm`
    # largest distance by which the middle of an arc may move to reduce the angle between blocks; 0: none
    smooth_arcs_um: float = 0.0
    min_block_s: float | None = None  # shortest block of the control; None: not known
    # lines that switch the feed override off, and on again; empty: none are known
    lock: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    lock_word: str = ""  # word that switches the override off, written in each shaped block instead of these lines
    # lines before and after a block with G09 ("" after: the word of the active path mode); None: G09 is a plain word
    exact_stop: tuple[str, str] | None = None
    header: tuple[str, ...] = ()  # comments for the operator

    @property
    def assumed(self) -> tuple[str, ...]:
        """Topics whose rule is assumed, because no page or recording states it."""
        return tuple(topic for topic, fact in self.facts.items() if not fact.source)


@cache
def _rows() -> tuple[Mapping[str, Dialect], Mapping[str, str]]:
    """The dialects by name, and the meanings of words on a FANUC control."""
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
    """The dialect of `emission.dialect`; None for FANUC."""
    return None if name == "fanuc" else _rows()[0][name]


def fanuc_meaning(code: str) -> str:
    """Meaning of a code on a FANUC control, for messages."""
    own = "a function of the machine builder" if code.startswith("M") else "a code of its own"
    return _rows()[1].get(code, own)


def code_name(word: str) -> str:
    """Write a code with two digits: G4 becomes G04."""
    number, point, decimals = word[1:].partition(".")
    return f"{word[0]}{number.zfill(2)}{point}{decimals}" if number.isdigit() else word


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
