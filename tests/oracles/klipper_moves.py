"""Moves and dwells of a program as Klipper's host reads them: program on stdin, JSON on stdout.

It runs in the environment of tests/tools/fetch_peers.sh and imports nothing of this package. Klipper's own dispatcher,
`GCodeMove` and `cmd_G4` read; what they would move is written down. A command that Klipper does not know is an error.
With an argument there is a section [gcode_arcs] with this resolution in mm.
"""

from __future__ import annotations

import json
import sys
from types import SimpleNamespace
from typing import Any

from klippy import gcode, toolhead
from klippy.extras import gcode_arcs, gcode_move


class Printer:
    """What the dispatcher and `GCodeMove` ask of a printer, and a tool head that writes down."""

    command_error = gcode.CommandError
    config_error = ValueError

    def __init__(self) -> None:
        self.handlers: dict[str, list[Any]] = {}
        self.objects: dict[str, Any] = {"toolhead": self}
        self.moves: list[dict[str, Any]] = []
        self.position = [0.0, 0.0, 0.0, 0.0]

    def get_printer(self) -> Printer:
        return self

    def get_start_args(self) -> dict[str, str]:
        return {"debuginput": "a file"}

    def get_reactor(self) -> Any:
        return SimpleNamespace(mutex=lambda: None)

    def register_event_handler(self, event: str, handler: Any) -> None:
        self.handlers.setdefault(event, []).append(handler)

    def send_event(self, event: str, *_: Any) -> None:
        for handler in self.handlers.get(event, ()):
            handler()

    def lookup_object(self, name: str, default: Any = None) -> Any:
        return self.objects.get(name, default)

    def load_object(self, _config: Any, name: str) -> Any:
        return self.objects[name]

    def get_position(self) -> list[float]:
        return list(self.position)

    def move(self, position: list[float], speed: float) -> None:
        self.moves.append({"end": position[:3], "speed_mm_per_s": speed})
        self.position = list(position)

    def dwell(self, time_s: float) -> None:
        self.moves.append({"dwell_s": time_s})


class Section:
    """[gcode_arcs] of a configuration."""

    def __init__(self, printer: Printer, resolution_mm: float) -> None:
        self.printer, self.resolution_mm = printer, resolution_mm

    def get_printer(self) -> Printer:
        return self.printer

    def getfloat(self, _name: str, _default: float, **_limits: float) -> float:
        return self.resolution_mm


def main() -> None:
    printer = Printer()
    dispatch = printer.objects["gcode"] = gcode.GCodeDispatch(printer)
    printer.objects["gcode_move"] = gcode_move.GCodeMove(printer)
    for resolution_mm in map(float, sys.argv[1:]):
        gcode_arcs.ArcSupport(Section(printer, resolution_mm))
    dispatch.register_command("G4", lambda command: toolhead.ToolHead.cmd_G4(printer, command))
    dispatch.register_command("M400", lambda _command: None)
    said: list[str] = []
    dispatch.register_output_handler(said.append)
    printer.send_event("klippy:ready")
    dispatch.run_script_from_command(sys.stdin.read())
    unknown = [line for line in said if "Unknown" in line or line.startswith("!!")]
    json.dump({"moves": printer.moves, "unknown": unknown}, sys.stdout)


if __name__ == "__main__":
    main()
