"""An independent interpreter of the full dialect: calls, macros, coordinate modes, compensation, cycles.

`play(text)` gives the canonical moves of a program. It shares no code with the converter that it judges.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .compensation import compensate
from .controller import Controller
from .corners import insert_corners
from .flow import Flow
from .items import Item
from .tape import Alarm

__all__ = ["Alarm", "Controller", "Item", "play"]


def play(
    text: str,
    *,
    program: int | None = None,
    switches: frozenset[int] = frozenset(),
    retained: Mapping[int, float] | None = None,
    nesting: int = 10,
    **settings: Any,
) -> list[Item]:
    """Canonical moves of the first program of a file (or of program O`program`), in order.

    `switches`: block-skip switches that are on. `settings` go to `Controller`.

    Raises Alarm with line and alarm number where a control would refuse the program.
    """
    controller = Controller(**settings)
    Flow(text, controller, program=program, switches=switches, retained=retained, nesting=nesting).play()
    return compensate(insert_corners(controller.items))
