"""Macro variables: vacant, local by call level, common, and the system variables that a reader can know."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .expressions import Value
from .tape import Alarm

if TYPE_CHECKING:
    from .controller import Controller

#: Argument specification I.
ARGUMENT = {
    "A": 1, "B": 2, "C": 3, "I": 4, "J": 5, "K": 6, "D": 7, "E": 8, "F": 9, "H": 11, "M": 13, "Q": 17, "R": 18,
    "S": 19, "T": 20, "U": 21, "V": 22, "W": 23, "X": 24, "Y": 25, "Z": 26,
}  # fmt: skip
#: Modal groups by the last digits of #4001 ... #4030.
GROUP_VARIABLES = {
    1: "motion", 2: "plane", 3: "distance", 5: "feed_mode", 6: "units", 7: "comp", 8: "length_offset", 9: "cycle",
    10: "return_level", 14: "wcs", 15: "exact_stop",
}  # fmt: skip


def arguments(words: list[tuple[str, float]], line: int) -> dict[int, float]:
    """Local variables from the words of a call. I J K repeat for specification II; of two words for the same variable
    the later one counts."""
    out: dict[int, float] = {}
    row, last = 0, ""
    for letter, value in words:
        if letter in "IJK":
            if last and letter <= last:
                row += 1
            last = letter
            if row > 9:
                raise Alarm(line, "more than ten sets of I J K", 129)
            out[4 + 3 * row + "IJK".index(letter)] = value
        elif letter in ARGUMENT:
            out[ARGUMENT[letter]] = value
        else:
            raise Alarm(line, f"{letter} is no argument", 129)
    return out


class Variables:
    """`read` and `write` by number; the frame of local variables is the caller's business."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.local: dict[int, float] = {}
        self.common: dict[int, float] = {}

    def read(self, number: int, line: int) -> Value:
        if number == 0:
            return None
        if 1 <= number <= 33:
            return self.local.get(number)
        if 100 <= number <= 199 or 500 <= number <= 999:
            return self.common.get(number)
        return self.system(number, line)

    def write(self, number: int, value: Value, line: int) -> None:
        if 1 <= number <= 33 or 100 <= number <= 199 or 500 <= number <= 999:
            store = self.local if number <= 33 else self.common
            if value is None:
                store.pop(number, None)
            else:
                store[number] = value
            return
        amount = 0.0 if value is None else value
        if number == 3000:
            raise Alarm(line, f"the program raises its alarm {3000 + int(amount)}", 3000 + int(amount))
        if number in (3001, 3002, 3003, 3004, 3006):
            return
        if number == 0 or not self.controller.write_offset(number, amount):
            raise Alarm(line, f"#{number} cannot be written", 116 if number == 0 else 115)

    def system(self, number: int, line: int) -> float:
        c = self.controller
        if 4001 <= number <= 4030 and number - 4000 in GROUP_VARIABLES:
            return float(str(c.modal[GROUP_VARIABLES[number - 4000]])[1:])
        plain = {4107: c.d_number, 4109: c.f_word, 4111: c.h_number, 4119: c.spindle}
        if number in plain:
            return float(plain[number])
        for base in (5000, 5040):
            if 1 <= number - base <= 3:
                value = float(c.position[number - base - 1])
                if value != value:
                    raise Alarm(line, f"#{number}: the position is not known", 0)
                return value / c.unit_mm
        offset = c.read_offset(number)
        if offset is not None:
            return offset
        raise Alarm(line, f"#{number} is no variable", 115)
