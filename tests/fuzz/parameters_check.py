"""What must hold for every parameter dump, shared by the fuzzer and by the test that replays its corpus."""

from __future__ import annotations

import math
import tomllib

from shapegcode.errors import MachineError
from shapegcode.machine import Machine
from shapegcode.machine.control_import import import_parameters

_BASE = Machine.load("vx500")


def check_import(data: bytes) -> str:
    """Import a dump: a machine that its own file gives back, or a MachineError. Returns which."""
    # The last byte says whether the built-in machine stands in for what is missing.
    base = _BASE if data[-1:] != b"\x01" else None
    try:
        result = import_parameters(data, base)
    except MachineError as error:
        assert str(error).strip(), "a refusal has words"
        return "refused"
    text = result.to_toml()
    again = Machine.from_data(tomllib.loads(text), "again")
    assert again.model_dump() == result.machine.model_dump(), "the machine file gives the machine back"
    for axis in (result.machine.axes.x, result.machine.axes.y, result.machine.axes.z):
        assert math.isfinite(axis.max_feed_mm_per_min)
        assert axis.max_feed_mm_per_min > 0.0
    lines = data.count(b"\n") + data.count(b"\r") + 1
    for entry in result.read:
        assert 1 <= entry.line <= lines, entry
    return "imported"
