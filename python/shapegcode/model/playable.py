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
class PlayedPrograms:
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

    def scene(self, on_progress: Callable[[float], None] = lambda _done: None) -> Scene | None:
        """Simulate them."""
        from shapegcode.model.scene import scene_of

        return scene_of(
            self.original, self.machine, self.emitted, labels=self.labels, plant=self.plant, on_progress=on_progress
        )
