"""SINUMERIK programs (DIN mode): executed by the core as the control would, and written as expanded programs for FANUC.

Rules without a published source are *assumed*, and marked so in docs/reference/input_siemens.md.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from functools import cache
from importlib import resources
from pathlib import Path

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.program.foreign import read


def read_siemens(source: str, *, file: str, machine: Machine, folder: Path | None = None) -> read.ForeignProgram:
    """Read a SINUMERIK program (DIN mode) as an expanded program."""
    controller, settings, options = machine.controller, machine.input, _core.SiemensOptions()
    options.file = read.shown_name(file)
    options.name = re.sub(r"(?i)^_N_|_(MPF|SPF)$|\.[A-Z0-9]+$", "", re.split(r"[/\\]", options.file)[-1]).upper()
    options.least_increment_mm = controller.least_increment_mm
    options.arc_radius_tolerance_mm = controller.arc_radius_tolerance_mm
    options.max_program_steps = controller.max_program_steps
    options.max_expansion_moves = controller.max_expansion_moves
    options.block_skip = {"unknown": None, "on": True, "off": False}[settings.block_skip]
    options.tool_change_unknown_axes = settings.tool_change_unknown_axes
    options.work_offsets = settings.work_offsets
    options.left_out, options.left_out_addresses, refused = _tables()
    options.refused = lambda word: next((why for pattern, why in refused.items() if pattern.fullmatch(word)), "")
    options.called = _finder(machine, folder)
    with read.located_errors(file):
        program = _core.read_siemens(source, options)
    return read.program_of_core("siemens", program.expanded, read.ForeignSettings(names=dict(program.names)))


@cache
def _tables() -> tuple[dict[str, str], dict[str, str], dict[re.Pattern[str], str]]:
    """Words and addresses that are left out, with their notes, and words that are refused."""
    file = resources.files("shapegcode") / "data" / "control" / "siemens_input.toml"
    tables = tomllib.loads(file.read_text(encoding="utf-8"))
    words, addresses = (
        {word: told for words, told in tables[name].items() for word in words.split()}
        for name in ("left_out", "left_out_addresses")
    )
    return words, addresses, {re.compile(pattern): reason for pattern, reason in tables["refused"].items()}


def _finder(machine: Machine, folder: Path | None) -> Callable[[str], tuple[str, bytes] | None]:
    """Make a finder of called programs' files: it returns name and text."""
    files: dict[str, Path] = {}  # by name in capitals; filled at the first search
    folders = read.program_folders(machine, folder)

    def find(name: str) -> tuple[str, bytes] | None:
        while folders:
            for each in sorted(folders[0].iterdir()) if folders[0].is_dir() else ():
                files.setdefault(each.name.upper(), each)
            folders.pop(0)
        known = (f"{name}.SPF", f"{name}.MPF", f"_N_{name}_SPF", f"_N_{name}_MPF")
        path = next((files[file] for file in known if file in files), None)
        if path is None:
            return None
        file, text = read.called_program(path, machine)
        return file, text.decode("utf-8", "replace").encode()

    return find
