"""What an operator must observe at the control: one sentence for reports and pages, one comment for programs.

Programs that shapegcode emits, its test cuts and its characterization tests say it with the same words.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Habit:
    """One caution."""

    topic: str  # what it is about, in a word or two
    comment: str  # for programs: capitals, 60 characters at most
    sentence: str  # the same for people who read


OVERRIDE = Habit(
    "override",
    "SET FEED OVERRIDE 100 PCT",
    "feed override 100 %: any other setting changes the time of every block, and the blocks no longer fit the modes",
)
OVERRIDE_LOCKED = Habit(
    "override",
    "FEED OVERRIDE IS OFF IN SHAPED MOVES",
    "the program switches the feed override off in shaped moves and gives it back behind them: there only feed hold "
    "acts",
)
OVERRIDE_ANY = Habit(
    "override",
    "BLOCKS OF ONE DURATION FOR ANY FEED OVERRIDE",
    "blocks of one duration: another feed override scales all of them alike; vibration is lowest at 100 %",
)
OVERRIDES = {"ask": OVERRIDE, "lock": OVERRIDE_LOCKED, "any": OVERRIDE_ANY}
"""By `emission.override`."""
SINGLE_BLOCK = Habit(
    "single block",
    "NO SINGLE BLOCK IN SHAPED CUTS",
    "no single block inside of shaped cuts: the control would stop at every block, some milliseconds apart; to look "
    "through the program use the graphic display, machine lock, or dry run above the part, and single block between "
    "the cuts; then the first run above the part",
)
FEED_HOLD = Habit(
    "feed hold",
    "AFTER FEED HOLD GO ON AT 100 PCT",
    "feed hold is safe; the machine may vibrate once, since the control decelerates in its own way; "
    "cycle start resumes the program",
)
RESTART = Habit(
    "restart",
    "RESTART ONLY BEHIND A SHAPED COMMENT OR AT A LISTED N",
    "restart only where a cut begins, or at a restart point: other blocks of a shaped cut are not valid restart points",
)
FIRST_RUN = Habit(
    "first run",
    "FIRST RUN ABOVE THE PART WITHOUT TOOL",
    "first run above the part: shift Z of the work offset by more than the deepest cut, no tool, spindle off, rapid "
    "override 25 %, feed override 100 %",
)


def no_room(room_bytes: int) -> str:
    """What to do with a shaped program that the memory of the control does not hold."""
    return f"convert the original with --max-bytes {room_bytes}; or memory card, data server or drip feed (DNC)"
