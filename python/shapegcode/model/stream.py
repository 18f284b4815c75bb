"""Simulates a program on a model of the machine as one motion in time: cuts, rapids and waits, piece by piece.

The plant is at rest at the start and simulated through the whole program. Memory does not grow with its length.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.hints import Hinted
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel, fanuc_model
from shapegcode.program import Program, given_program

#: Names of the kinds in `Chunk.kind`.
KINDS = tuple(kind.name for kind in sorted(_core.BlockKind.__members__.values(), key=lambda kind: kind.value))
REST_S = 0.25  # rest of the set-points after the end of a program
_CHUNK_SAMPLES = 65536
_OF_EVERY_PLANT = ("line", "kind", "command_mm", "response_mm", "velocity_mm_per_s")
_OF_DRIVES = ("motor_mm", "motor_force_n", "friction_force_n")


@dataclass(frozen=True, eq=False)
class Chunk(Hinted):
    """A section of a simulated program; one row per interpolation period."""

    sample: npt.NDArray[np.int64]  # number of each row since the start of the program, (k,)
    time_s: FloatArray  # since the start of the program, (k,)
    line: npt.NDArray[np.uint32]  # of the block that is being interpolated, (k,)
    # kind of that block, (k,): an index into `KINDS`. Waits for in-position belong to the block before them
    kind: npt.NDArray[np.uint8]
    command_mm: FloatArray  # set-points after all filters, (k, 3)
    response_mm: FloatArray  # the table, (k, 3)
    velocity_mm_per_s: FloatArray  # of the command over the period before, (k, 3)
    motor_mm: FloatArray | None = None  # feed drives only: the motor as travel of the table, (k, 3)
    motor_force_n: FloatArray | None = None  # feed drives only: force of the motor, (k, 3)
    friction_force_n: FloatArray | None = None  # feed drives only: friction of the table, against its motion, (k, 3)

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def error_mm(self) -> FloatArray:
        """Response minus command, (k, 3): vibration, and with feed drives the lag of the servo loop."""
        return self.response_mm - self.command_mm

    def columns(self) -> dict[str, npt.NDArray[np.generic]]:
        """Columns of a file of the motion, by name with unit; each of shape (k,)."""
        named: dict[str, npt.NDArray[np.generic]] = {"time_s": self.time_s, "line": self.line}
        for name in ("command_mm", "response_mm", "error_mm", *_OF_DRIVES):
            if (table := getattr(self, name)) is not None:
                named |= {f"{axis}_{name}": table[:, number] for number, axis in enumerate("xyz")}
        return named

    def rows(self, wanted: npt.NDArray[np.bool_]) -> Chunk:
        """Select the rows where the mask `wanted`, (k,), is true."""
        if wanted.all():
            return self
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return replace(self, **{name: value[wanted] for name, value in values.items() if value is not None})

    def every(self, step: int) -> Chunk:
        """Every `step`-th sample of the program, from the first."""
        return self if step == 1 else self.rows(self.sample % step == 0)


def cuts_of_lines(cuts: Sequence[_core.Region], lines: npt.NDArray[np.integer]) -> npt.NDArray[np.int64]:
    """Index of the cut that contains each line, (k,), -1 outside cuts; cuts are in line order."""
    firsts = np.array([cut.first_line for cut in cuts], dtype=np.int64)
    lasts = np.array([cut.last_line for cut in cuts] or [0], dtype=np.int64)
    found = np.searchsorted(firsts, lines, side="right") - 1
    found[(found >= 0) & (lines > lasts[np.maximum(found, 0)])] = -1
    return found


def stream(
    program: Program | str | Path,
    machine: Machine | str | Path,
    *,
    plant: str = "modal",
    shaped: bool | None = None,
    lines: tuple[int, int] | None = None,
    chunk_samples: int = _CHUNK_SAMPLES,
) -> Iterator[Chunk]:
    """Simulate a whole program and yield its motion piece by piece.

    Regions, other cutting moves, rapids, waits for in-position, dwells, tool changes and M functions follow each other
    as in `sg.cycle_time`; after the end the set-points rest for a quarter of a second. Where coordinates jump
    without motion (work offset, tool length, an axis whose position was not known), command and response jump.

    Args:
        program: the program, or its file.
        machine: controller and plant.
        plant: "modal" or "feed-drive".
        shaped: the cuts are shaped blocks, see `simulate`.
        lines: first and last line (of the expanded program) to yield; the simulation begins at the start of the
            program in any case.
        chunk_samples: largest number of rows of a piece.

    Returns:
        Pieces in the order of time: command, response and their lines, of `chunk_samples` rows at most.

    Raises:
        ProgramError, OSError: the file cannot be read.
        ArgumentError: an invalid plant, line range, chunk size or controller value.
        MachineError: the machine file is invalid, or its feed drives are missing or unstable.
        NumericError: while yielding: the integrator of a feed drive fails.
    """
    machine = Machine.of(machine)
    if chunk_samples < 1:
        raise _core.ArgumentError(f"chunk_samples = {chunk_samples}: must be 1 or more")
    program = given_program(program, machine)
    count = program.core.line_count
    if lines is not None and not 1 <= lines[0] <= lines[1] <= count:
        where = "lines {}-{}".format(*lines)
        raise _core.ArgumentError(f"{where}: must lie within 1-{count} of {program.source}, first to last")
    model = MachineModel(machine)
    of_regions = [model.offset(region) for region in program.regions]
    x, y, z = (None if any(offset[axis] is None for offset in of_regions) else 0.0 for axis in range(3))
    options = model.options(plant=plant, offset=(x, y, z))
    controller = fanuc_model(machine, shaped=shaped)
    offsets = [np.array([value or 0.0 for value in offset]) for offset in of_regions]
    simulated = _core.SimulationStream.of_program(program.core, controller, options, offsets, REST_S)
    return _chunks(simulated, model.period_s, lines, chunk_samples)


def _chunks(
    simulated: _core.SimulationStream, period_s: float, lines: tuple[int, int] | None, chunk_samples: int
) -> Iterator[Chunk]:
    rate_hz = 1.0 / period_s
    # Division by a whole rate is exact: 9 / 1000 is 0.009, 9 * 0.001 is not.
    rate_hz = round(rate_hz) if abs(rate_hz - round(rate_hz)) < 1e-6 else rate_hz
    while len(read := simulated.read(chunk_samples)):
        sample = np.arange(read.first_sample, read.first_sample + len(read), dtype=np.int64)
        names = [*_OF_EVERY_PLANT, *(_OF_DRIVES if len(read.motor_mm) else ())]
        chunk = Chunk(sample, sample / rate_hz, **{name: getattr(read, name) for name in names})
        if lines is None:
            yield chunk
            continue
        inside = (chunk.line >= lines[0]) & (chunk.line <= lines[1])
        if inside.any():
            yield chunk.rows(inside)
        # Lines of an expanded program execute in order.
        if chunk.line[-1] > lines[1]:
            return
