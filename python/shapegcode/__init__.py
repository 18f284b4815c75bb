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
    from shapegcode.checking.check import Check as Check
    from shapegcode.checking.check import Finding as Finding
    from shapegcode.checking.check import check as check
    from shapegcode.conversion.budget import Budget as Budget
    from shapegcode.conversion.convert import Conversion as Conversion
    from shapegcode.conversion.convert import convert as convert
    from shapegcode.cutting.stock import Stock as Stock
    from shapegcode.cutting.tool import Tool as Tool
    from shapegcode.errors import MachineError as MachineError
    from shapegcode.errors import RecordError as RecordError
    from shapegcode.errors import RoundTripError as RoundTripError
    from shapegcode.errors import StockError as StockError
    from shapegcode.errors import ToolError as ToolError
    from shapegcode.feed.result import FeedSchedule as FeedSchedule
    from shapegcode.feed.schedule import schedule_feed as schedule_feed
    from shapegcode.feed.shaped import ScheduledConversion as ScheduledConversion
    from shapegcode.feed.shaped import convert_scheduled as convert_scheduled
    from shapegcode.identification.identify import identify as identify
    from shapegcode.identification.result import Identification as Identification
    from shapegcode.io.read import ReadOptions as ReadOptions
    from shapegcode.io.record import Record as Record
    from shapegcode.machine import Machine as Machine
    from shapegcode.metrology.measure import Measurement as Measurement
    from shapegcode.metrology.measure import measure as measure
    from shapegcode.model.response import plant_response as plant_response
    from shapegcode.model.stream import stream as stream
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
    from shapegcode.shaping.grid import choose_grid as choose_grid
    from shapegcode.simulation.simulate import Simulation as Simulation
    from shapegcode.simulation.simulate import simulate as simulate
    from shapegcode.timing.cycle_time import cycle_time as cycle_time
    from shapegcode.timing.result import CycleTime as CycleTime

_HOME = {
    **dict.fromkeys(
        (
            "ArgumentError", "DesignError", "Fir", "FirStream", "LinearPlant", "Mode", "NumericError", "Path",
            "ProgramError", "Segment", "ShapegcodeError", "Shaper", "__version__", "convolved_zv", "grid_polynomial",
            "minimal_two_mode", "zv",
        ),
        "_core",
    ),
    **dict.fromkeys(("Check", "Finding", "check"), "checking.check"),
    "Budget": "conversion.budget",
    "choose_grid": "shaping.grid",
    **dict.fromkeys(("Conversion", "convert"), "conversion.convert"),
    "Identification": "identification.result",
    "Machine": "machine",
    **dict.fromkeys(("MachineError", "RecordError", "RoundTripError", "StockError", "ToolError"), "errors"),
    **dict.fromkeys(("Measurement", "measure"), "metrology.measure"),
    "Program": "program",
    "ReadOptions": "io.read",
    "Record": "io.record",
    "identify": "identification.identify",
    "FeedSchedule": "feed.result",
    "schedule_feed": "feed.schedule",
    **dict.fromkeys(("ScheduledConversion", "convert_scheduled"), "feed.shaped"),
    "Stock": "cutting.stock",
    "Tool": "cutting.tool",
    "plant_response": "model.response",
    **dict.fromkeys(
        ("ModeBand", "Recommendation", "choose_block_period", "choose_shaper", "shortest_non_negative"), "shaping"
    ),
    **dict.fromkeys(("Simulation", "simulate"), "simulation.simulate"),
    "stream": "model.stream",
    "CycleTime": "timing.result",
    "cycle_time": "timing.cycle_time",
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
