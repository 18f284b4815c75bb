"""shapegcode: CNC programs whose motion no longer excites the machine's vibration modes.

>>> import shapegcode as sg
>>> machine = sg.Machine.load("vx500")
>>> program = sg.Program.read("part.nc", machine)
>>> conversion = sg.convert(program, machine)

The public names are listed in `__init__.pyi`, also for type checkers. Everything is loaded on first use, so that
``import shapegcode`` costs nothing.
"""

import functools
import importlib
from typing import Any

# Former names, still accepted.
_RENAMED = {
    "LearnedClock": "CycleTimeCalibration",
    "LearnedNumber": "CalibratedParameter",
    "LearnedRun": "CalibrationRun",
    "LearnedShare": "CycleTimePart",
    "learn_clock": "calibrate_cycle_time",
    "plot_clock": "plot_cycle_time_calibration",
}


@functools.cache
def _home() -> dict[str, str]:
    """Module of each public name, from the stub."""
    import ast
    from pathlib import Path

    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom) and node.module]
    return {alias.name: str(node.module) for node in imports for alias in node.names}


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name == "__all__":
        return sorted(_home())
    if name in _RENAMED:
        import warnings

        new = _RENAMED[name]
        warnings.warn(f"shapegcode.{name} is shapegcode.{new} now", FutureWarning, stacklevel=2)
        return __getattr__(new)
    # Python itself asks for names such as __path__ and _core, before a public one is used.
    if (name != "__version__" and name.startswith("_")) or name not in _home():
        from shapegcode.hints import hint

        raise AttributeError(f"module 'shapegcode' has no attribute {name!r}{hint(name, _home(), __name__)}")
    value = getattr(importlib.import_module(_home()[name]), name)
    if callable(value):
        value = _with_hints(value, _home()[name] == "shapegcode._core")
    globals()[name] = value
    return value


def _with_hints(value: Any, of_core: bool) -> Any:
    """A function or class whose error on a wrong argument says which was probably meant."""
    if of_core:
        from shapegcode.model.signatures import with_signature

        return with_signature(value)
    from shapegcode.hints import with_hints, with_hints_in

    if isinstance(value, type):
        with_hints_in(value)
        return value
    value = with_hints(value)
    value.__module__ = __name__  # for pickle
    return value


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return sorted(_home())
