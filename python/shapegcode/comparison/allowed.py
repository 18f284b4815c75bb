"""Which differences between two programs are allowed."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from shapegcode._core import ArgumentError
from shapegcode.io.units import find_unit

KINDS = {
    "cuts": "cuts that one program has and the other has not, or that are not the same length",
    "rapids": "rapids, and moves to a reference point or in machine coordinates",
    "tools": "T, M06",
    "spindle": "S, M03, M04, M05, M19",
    "coolant": "M07, M08, M09",
    "offsets": "G43, G44, G49, H, G54 to G59, G54.1, G10, G52, G92, G40, G41, G42, D",
    "cycles": "blocks of drilling cycles",
    "calls": "M98, M198, G65, G66 and codes that call a program; their blocks are compared as they are executed",
    "functions": "other M and G codes, moves of further axes, macro statements left to the control",
    "dwells": "G04",
    "stops": "M00, M01, M02, M30, M99",
    "modal": "plane, G90 or G91, G94, G61 and the like where a cut begins; exact stops in it",
    "feeds": "feeds of cuts and drilling cycles",
    "blocks": "number of blocks of a cut; the lines of emission.* around the cuts of a shaped program",
    "order": "the same, but elsewhere in the program",
    "shaped-rapids": "rapids as cutting moves, marked (SHAPED RAPID)",
    "compensation": "G41 and G42 worked out: the control's offset no longer acts",
    "units": "G20 or G21",
    "end": "one program ends early",
}
"""What may be allowed beside ``path=LENGTH``, and what it covers."""


@dataclass(frozen=True)
class Allowed:
    """Differences that count as none.

    Attributes:
        kinds: of `KINDS`.
        path_um: distance of the paths that is allowed, µm.
    """

    kinds: frozenset[str] = frozenset()
    path_um: float = 0.0

    @classmethod
    def of(cls, words: str | Iterable[str]) -> Allowed:
        """What words such as ``feeds,blocks,path=20um,calls`` allow.

        Args:
            words: in one text with commas, or one by one.

        Returns:
            What they allow.

        Raises:
            ArgumentError: a word is none of `KINDS` and no ``path=LENGTH`` above 0 with its unit.
        """
        kinds, path_um = set(), 0.0
        for word in (words.split(",") if words else ()) if isinstance(words, str) else words:
            name, sign, length = word.strip().partition("=")
            if name == "path":
                path_um = _length_um(word.strip(), length)
            elif name in KINDS and not sign:
                kinds.add(name)
            else:
                raise ArgumentError(
                    f"allow {word.strip()!r}: no difference of this name; there are {', '.join(KINDS)} and path=20um"
                )
        return cls(frozenset(kinds), path_um)

    def covers(self, kind: str, distance_um: float = 0.0) -> bool:
        """Whether a difference is allowed.

        Args:
            kind: of it.
            distance_um: of the paths, where it is one of these.

        Returns:
            Whether it is.
        """
        return distance_um <= self.path_um if kind == "path" else kind in self.kinds

    @property
    def words(self) -> tuple[str, ...]:
        """As `of` takes them."""
        path = (f"path={self.path_um:g}um",) if self.path_um > 0.0 else ()
        return (*(kind for kind in KINDS if kind in self.kinds), *path)


def _length_um(word: str, length: str) -> float:
    match = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+))\s*([a-zµ]+)", length.strip())
    unit = find_unit(match[2]) if match else None
    if match is None or unit is None or unit.measures != "displacement":
        raise ArgumentError(f"allow {word!r}: path needs a length with its unit (um, mm, inch), for example path=20um")
    value = float(match[1]) * unit.factor * 1e6
    if not 0.0 < value < math.inf:
        raise ArgumentError(f"allow {word!r}: the length must be above 0, for example path=20um")
    return value
