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
    )
    from shapegcode._core import (
        DesignError as DesignError,
    )
    from shapegcode._core import (
        Fir as Fir,
    )
    from shapegcode._core import (
        FirStream as FirStream,
    )
    from shapegcode._core import (
        LinearPlant as LinearPlant,
    )
    from shapegcode._core import (
        Mode as Mode,
    )
    from shapegcode._core import (
        NumericError as NumericError,
    )
    from shapegcode._core import (
        Path as Path,
    )
    from shapegcode._core import (
        ProgramError as ProgramError,
    )
    from shapegcode._core import (
        Segment as Segment,
    )
    from shapegcode._core import (
        ShapegcodeError as ShapegcodeError,
    )
    from shapegcode._core import (
        Shaper as Shaper,
    )
    from shapegcode._core import (
        __version__ as __version__,
    )
    from shapegcode._core import (
        convolved_zv as convolved_zv,
    )
    from shapegcode._core import (
        grid_polynomial as grid_polynomial,
    )
    from shapegcode._core import (
        minimal_two_mode as minimal_two_mode,
    )
    from shapegcode._core import (
        zv as zv,
    )
    from shapegcode.block_grid import choose_grid as choose_grid
    from shapegcode.budget import Budget as Budget
    from shapegcode.checker import Check as Check
    from shapegcode.checker import Finding as Finding
    from shapegcode.checker import check as check
    from shapegcode.converter import Conversion as Conversion
    from shapegcode.converter import convert as convert
    from shapegcode.identification.read import ReadOptions as ReadOptions
    from shapegcode.identification.record import Record as Record
    from shapegcode.identification.record import RecordError as RecordError
    from shapegcode.identification.results import Identification as Identification
    from shapegcode.identification.tap_test import identify as identify
    from shapegcode.linear_response import plant_response as plant_response
    from shapegcode.machine import Machine as Machine
    from shapegcode.machine import MachineError as MachineError
    from shapegcode.metrology import Measurement as Measurement
    from shapegcode.metrology import measure as measure
    from shapegcode.milling.schedule import FeedSchedule as FeedSchedule
    from shapegcode.milling.schedule import schedule_feed as schedule_feed
    from shapegcode.milling.shaped_schedule import ScheduledConversion as ScheduledConversion
    from shapegcode.milling.shaped_schedule import convert_scheduled as convert_scheduled
    from shapegcode.milling.stock_file import Stock as Stock
    from shapegcode.milling.stock_file import StockError as StockError
    from shapegcode.milling.tool_file import Tool as Tool
    from shapegcode.milling.tool_file import ToolError as ToolError
    from shapegcode.played import stream as stream
    from shapegcode.program import Program as Program
    from shapegcode.shaping import (
        ModeBand as ModeBand,
    )
    from shapegcode.shaping import (
        Recommendation as Recommendation,
    )
    from shapegcode.shaping import (
        choose_block_period as choose_block_period,
    )
    from shapegcode.shaping import (
        choose_shaper as choose_shaper,
    )
    from shapegcode.shaping import (
        shortest_non_negative as shortest_non_negative,
    )
    from shapegcode.simulator import Simulation as Simulation
    from shapegcode.simulator import simulate as simulate
    from shapegcode.timing import CycleTime as CycleTime
    from shapegcode.timing import cycle_time as cycle_time
    from shapegcode.verify import RoundTripError as RoundTripError

_HOME = {
    **dict.fromkeys(
        (
            "ArgumentError", "DesignError", "Fir", "FirStream", "LinearPlant", "Mode", "NumericError", "Path",
            "ProgramError", "Segment", "ShapegcodeError", "Shaper", "__version__", "convolved_zv", "grid_polynomial",
            "minimal_two_mode", "zv",
        ),
        "_core",
    ),
    **dict.fromkeys(("Check", "Finding", "check"), "checker"),
    "Budget": "budget",
    "choose_grid": "block_grid",
    **dict.fromkeys(("Conversion", "convert"), "converter"),
    "Identification": "identification.results",
    **dict.fromkeys(("Machine", "MachineError"), "machine"),
    **dict.fromkeys(("Measurement", "measure"), "metrology"),
    "Program": "program",
    "ReadOptions": "identification.read",
    **dict.fromkeys(("Record", "RecordError"), "identification.record"),
    "identify": "identification.tap_test",
    **dict.fromkeys(("FeedSchedule", "schedule_feed"), "milling.schedule"),
    **dict.fromkeys(("ScheduledConversion", "convert_scheduled"), "milling.shaped_schedule"),
    **dict.fromkeys(("Stock", "StockError"), "milling.stock_file"),
    **dict.fromkeys(("Tool", "ToolError"), "milling.tool_file"),
    "RoundTripError": "verify",
    "plant_response": "linear_response",
    **dict.fromkeys(
        ("ModeBand", "Recommendation", "choose_block_period", "choose_shaper", "shortest_non_negative"), "shaping"
    ),
    **dict.fromkeys(("Simulation", "simulate"), "simulator"),
    "stream": "played",
    **dict.fromkeys(("CycleTime", "cycle_time"), "timing"),
}  # fmt: skip

__all__ = sorted(_HOME)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'shapegcode' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"shapegcode.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return __all__
