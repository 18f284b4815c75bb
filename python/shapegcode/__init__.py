"""shapegcode: CNC programs whose motion no longer excites the machine.

>>> import shapegcode as sg
>>> machine = sg.Machine.load("vx500")
>>> program = sg.Program.read("part.nc", machine)
>>> conversion = sg.convert(program, machine)

Everything heavy is loaded on first use, so that ``import shapegcode`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shapegcode._core import (
        ArgumentError as ArgumentError,
        DesignError as DesignError,
        Fir as Fir,
        FirStream as FirStream,
        Mode as Mode,
        NumericError as NumericError,
        Path as Path,
        ProgramError as ProgramError,
        Segment as Segment,
        ShapegcodeError as ShapegcodeError,
        Shaper as Shaper,
        __version__ as __version__,
        convolved_zv as convolved_zv,
        grid_polynomial as grid_polynomial,
        minimal_two_mode as minimal_two_mode,
        zv as zv,
    )
    from shapegcode.converter import Conversion as Conversion, choose_grid as choose_grid, convert as convert
    from shapegcode.machine import Machine as Machine, MachineError as MachineError
    from shapegcode.program import Program as Program
    from shapegcode.shaping import (
        choose_block_period as choose_block_period,
        shortest_non_negative as shortest_non_negative,
    )
    from shapegcode.simulator import Simulation as Simulation, simulate as simulate

_HOME = {
    **dict.fromkeys(
        (
            "ArgumentError", "DesignError", "Fir", "FirStream", "Mode", "NumericError", "Path", "ProgramError",
            "Segment", "ShapegcodeError", "Shaper", "__version__", "convolved_zv", "grid_polynomial",
            "minimal_two_mode", "zv",
        ),
        "_core",
    ),
    **dict.fromkeys(("Conversion", "choose_grid", "convert"), "converter"),
    **dict.fromkeys(("Machine", "MachineError"), "machine"),
    "Program": "program",
    **dict.fromkeys(("choose_block_period", "shortest_non_negative"), "shaping"),
    **dict.fromkeys(("Simulation", "simulate"), "simulator"),
}  # fmt: skip

__all__ = sorted(_HOME)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'shapegcode' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"shapegcode.{_HOME[name]}"), name)
    globals()[name] = value
    return value
