"""BibTeX entries of the papers on the methods of a result, printed by ``--cite``.

The entries are in ``data/references.bib``, as text in docs/evidence/references.md.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Mapping
from importlib import resources

__all__ = ["METHODS", "bibliography", "entries_of"]

#: Keys of the entries of each method; empty: own method, or the user's.
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
    """Every entry by its key, the program's own first."""
    text = (resources.files("shapegcode") / "data" / "references.bib").read_text(encoding="utf-8")
    return {re.split(r"[{,]", entry, maxsplit=2)[1]: entry for entry in text.strip().split("\n\n")}


def entries_of(methods: Iterable[str]) -> tuple[str, ...]:
    """The entries of the program and of the methods, each once, in the order of the file."""
    keys = {"shapegcode", *(key for name in methods for key in METHODS[name])}
    return tuple(entry for key, entry in bibliography().items() if key in keys)
