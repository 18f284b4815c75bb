"""Shapers: modes (`bands`), families (`registry`), their `comparison`, the choice for a conversion (`grid`).

The names in these modules are also available here, each loaded on first use.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

_MODULES = ("bands", "registry", "robust", "result", "comparison", "track", "grid", "plots")


def __getattr__(name: str) -> Any:
    """Load a name on first use."""
    if not name.startswith("_") and find_spec(f"{__name__}.{name}") is None:
        for module in _MODULES:
            found = getattr(import_module(f"{__name__}.{module}"), name, None)
            if found is not None:
                return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
