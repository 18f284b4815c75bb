"""Programs and the machine they are simulated on, kept so that a page can simulate them again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from shapegcode.machine import Machine
from shapegcode.program import Program

if TYPE_CHECKING:
    from shapegcode.results.page.scene import Scene


@dataclass(frozen=True, eq=False)
class SimulatedPrograms:
    """A program, and the one that was made of it.

    Attributes:
        original: what is simulated.
        machine: controller and plant.
        emitted: made of it; None: none.
        labels: of both, for people.
        plant: "modal" or "feed-drive".
    """

    original: Program
    machine: Machine
    emitted: Program | None = None
    labels: tuple[str, str] = ("original", "emitted")
    plant: str = "modal"

    @property
    def methods(self) -> tuple[str, ...]:
        """Published methods of the controller and the plant that play them; see `Result.methods`."""
        control, drives = self.machine.controller, [axis.drive for axis in self.machine.axes.as_tuple()]
        used = {
            "block overlap": control.motion == "after_interpolation",
            "junction deviation": control.motion == "look_ahead" and control.corner_rule == "junction_deviation",
            "LuGre friction": self.plant != "modal"
            and any(drive is not None and drive.friction_model == "lugre" for drive in drives),
        }
        return tuple(name for name, is_used in used.items() if is_used)

    def scene(self, on_progress: Callable[[float], None] = lambda _done: None) -> Scene | None:
        """Simulate them."""
        from shapegcode.model.scene import scene_of

        return scene_of(
            self.original, self.machine, self.emitted, labels=self.labels, plant=self.plant, on_progress=on_progress
        )
