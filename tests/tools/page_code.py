"""The Python cells of a page of the book, run outside of Sphinx, so that tests hold what the page shows."""

from __future__ import annotations

import contextlib
import functools
import re
import tempfile
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parents[2] / "docs"
CELL = re.compile(r"^```\{code-cell\} ipython3\n(?::.*\n)*(.*?)^```$", re.MULTILINE | re.DOTALL)


@functools.cache
def run_page(name: str) -> dict[str, Any]:
    """What the cells of `docs/NAME` define, those of another language (`%%bash`) left out; run once a process."""
    import matplotlib.pyplot as plt

    text = (DOCS / name).read_text(encoding="utf-8")
    found: dict[str, Any] = {"__name__": "page", "display": lambda *_: None}
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for cell in CELL.finditer(text):
            if not cell[1].startswith("%%"):
                lines_before = "\n" * text.count("\n", 0, cell.start(1))  # so that an error names the page's line
                exec(compile(lines_before + cell[1], str(DOCS / name), "exec"), found)
    plt.close("all")
    return found
