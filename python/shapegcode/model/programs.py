"""Programs and their machine: header data of emitted programs, and simulation for a page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from shapegcode.machine import Machine
from shapegcode.model.modes import axis_modes
from shapegcode.program import Program
from shapegcode.program.stamp import Stamp, text_mark

if TYPE_CHECKING:
    from shapegcode.results.page.scene import Scene

_WHOLE = 1e-6


@dataclass(frozen=True, eq=False)
class SimulatedPrograms:
    """A program and its emitted program."""

    original: Program  # program to simulate
    machine: Machine  # controller and plant
    emitted: Program | None = None  # its emitted program; None: none
    labels: tuple[str, str] = ("original", "emitted")  # display names of both
    plant: str = "modal"  # "modal" or "feed-drive"

    @property
    def methods(self) -> tuple[str, ...]:
        """Published methods behind controller and plant models; see `Result.methods`."""
        control, drives = self.machine.controller, [axis.drive for axis in self.machine.axes.as_tuple()]
        look_ahead = control.kind == "fanuc" and control.motion == "look_ahead"
        lugre = any(drive is not None and drive.friction_model == "lugre" for drive in drives)
        used = {
            "block overlap": control.kind == "fanuc" and control.motion == "after_interpolation",
            "junction deviation": control.kind == "grbl"
            or (look_ahead and control.corner_rule == "junction_deviation"),
            "LuGre friction": self.plant != "modal" and lugre,
        }
        return tuple(name for name, is_used in used.items() if is_used)

    def scene(self, on_progress: Callable[[float], None] = lambda _done: None) -> Scene | None:
        """Simulate both programs."""
        from shapegcode.model.scene import scene_of

        return scene_of(
            self.original, self.machine, self.emitted, labels=self.labels, plant=self.plant, on_progress=on_progress
        )


def stamp_of_machine(machine: Machine, *, version: str = "") -> Stamp:
    """The part of a header that depends only on the machine."""
    modes = [
        f"{axis} {mode.frequency_hz:g} HZ {mode.damping_ratio:g}"
        for axis, modes in zip("XYZ", axis_modes(machine), strict=True)
        for mode in modes
    ]
    controller = machine.controller
    time_s, bell_s = controller.shaped_time_constant_s, controller.shaped_bell_time_s
    exponential = " EXPONENTIAL" if controller.shaped_filter_shape == "exponential" and time_s else ""
    bell = f" BELL {bell_s * 1e3:g} MS" if bell_s else ""
    return Stamp(version, machine.name, tuple(modes), "", "", "", f"{time_s * 1e3:g} MS{exponential}{bell}")


def shaped_warnings(program: Program, machine: Machine) -> list[tuple[str, str]]:
    """Why the verdict in the header of an emitted program is not valid here: key and sentence of each reason."""
    stamp = program.stamp
    if stamp is None:
        return []
    found = {}
    if (mark := text_mark(program.own_text)) != stamp.mark:
        found["edited"] = (
            f"the program was changed since it was shaped (checksum in its header: {stamp.mark}, computed: {mark}): "
            "the verdict in its header is not valid; convert the original again"
        )
    if difference := stamp.difference(stamp_of_machine(machine)):
        why = f"shaped for another machine ({difference}): it does not reduce this machine's vibration"
        found["other_machine"] = why
    if why := _other_period(stamp, machine):
        found["other_period"] = why
    if not program.shaped_regions:
        found["unmarked"] = (
            "its header marks it as shaped, but no cut is marked (SHAPED): simulated as an ordinary program "
            "(simulate --shaped simulates all of it as shaped blocks)"
        )
    return list(found.items())


def _other_period(stamp: Stamp, machine: Machine) -> str:
    controller, stated_s = machine.controller, machine.emission.block_period_s
    try:
        period_s = float(stamp.block_period_ms) * 1e-3
    except ValueError:
        return f"its header states no valid block period: {stamp.block_period_ms!r}"
    ticks = period_s / controller.interpolation_period_s
    blocks = f"its blocks take {stamp.block_period_ms} ms"
    if abs(ticks - round(ticks)) > _WHOLE:
        tick_ms = controller.interpolation_period_s * 1e3
        return f"{blocks}, not a whole number of this control's periods of {tick_ms:g} ms"
    if period_s < controller.block_time_s * (1.0 - _WHOLE):
        return f"{blocks}, this control needs {controller.block_time_s * 1e3:g} ms for a block: buffer underrun"
    if stated_s is not None and abs(stated_s - period_s) > _WHOLE * period_s:
        return f"{blocks}, emission.block_period_s is {stated_s * 1e3:g} ms here"
    return ""


def shaped_note(program: Program) -> str:
    """How a program is simulated, in one sentence; empty without shaped regions."""
    shaped, whole = program.shaped_regions, len(program.regions)
    if not shaped:
        return ""
    others = "" if shaped == whole else f"; the other {whole - shaped} as in an ordinary program"
    how = f"{shaped} of {whole} regions are simulated as shaped blocks"
    return f"its header marks it as shaped: {how}{others}"
