"""Designs of shapers, and the choice among them.

What is to be cancelled, and what a design for it is worth: `bands`. The families, one row each: `registry`, with their
`solvers`, `grid_search` (on a sample grid), `grid_designs` (exact there) and `robust` (within a limit over bands). The
choice: `comparison` designs every family and recommends one by `ranking` in a `result`. For a conversion: `grid`
chooses the block period and the shaper on it for a machine, `track` those that follow moving modes.

Their names can be taken from here too, each loaded on first use.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

_MODULES = (
    "bands", "registry", "robust", "ranking", "result", "comparison", "track", "grid", "plots",
)  # fmt: skip


def __getattr__(name: str) -> Any:
    """Load a name on first use."""
    if not name.startswith("_") and find_spec(f"{__name__}.{name}") is None:
        for module in _MODULES:
            found = getattr(import_module(f"{__name__}.{module}"), name, None)
            if found is not None:
                return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
