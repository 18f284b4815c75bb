"""Offsets of LinuxCNC in FANUC's words: G10, G28, G30, G43, G49, G52, G53, G92."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from shapegcode.program.foreign.linuxcnc_state import AXES, State, given_axes, system_words
from shapegcode.program.foreign.read import number_text, words_of

_DYNAMIC_NUMBER = 999  # H number under which the plain program holds the length of G43.1


class Offsets:
    """Changes offsets in the state and writes what FANUC's reader must know of it."""

    def __init__(self, state: State, put: Callable[[str], None]) -> None:
        self.state = state
        self._put = put

    def length(self, code: int, values: Mapping[str, float]) -> None:
        """G43, G43.1, G49."""
        state = self.state
        number = int(values.get("h", state.tool))
        if code == 490 or (code == 430 and number == 0):
            state.set_length(0.0, 0)
            self._put("G49")
        elif code == 431:
            _refuse_x_and_y("G43.1", values)
            length = values.get("z", 0.0)
            # Its number is free in the plain program; G49 first, so that the reader knows the change.
            self._put("G49")
            self._put(f"G90G10L10P{_DYNAMIC_NUMBER}R{number_text(length)}")
            if state.modes.distance == 910:
                self._put("G91")
            self._put(f"G43H{_DYNAMIC_NUMBER}")
            state.set_length(length * state.unit_mm, _DYNAMIC_NUMBER)
        else:
            if state.table is not None and number not in state.lengths:
                raise ValueError(f"G43 H{number}: {state.table.file} has no tool {number}")
            if state.table is not None and (tool := state.table.tools.get(number)) and any(tool.offset_mm[:2]):
                raise ValueError(f"G43 H{number}: its offset has X or Y: only that of Z is read")
            state.set_length(state.lengths.get(number), number)
            self._put(f"G43H{number}")

    def one_shot(self, code: int, values: Mapping[str, float]) -> None:
        """G10, G28, G30, G52, G92."""
        if code == 100:
            self._data(values)
        elif code in {281, 301}:
            return  # stores the present position: nothing moves
        elif code in {280, 300}:
            self._reference(code, values)
        elif code == 520:
            self._local(values)
        else:
            self._setting(code, values)

    def in_program(self, values: Mapping[str, float], *, rapid: bool) -> Mapping[str, float]:
        """Axis words of G53 in the program's coordinates; empty: written as FANUC's G53, as no offset is known."""
        state = self.state
        found: dict[str, float] = {letter: value for letter, value in values.items() if letter not in "xyz"}
        for axis in given_axes(values):
            parts = [state.offsets(state.modes.system)[axis], state.g92[axis]]
            if axis == 2:
                parts.append(state.length)
            if None in parts:
                if not rapid:
                    raise ValueError(
                        "G53 G1: a cutting move in machine coordinates needs the work offset (input.work_offsets)"
                    )
                self._in_absolute(f"G53G00{words_of(values)}")
                self._forget(given_axes(values))
                return {}
            found[AXES[axis]] = values[AXES[axis]] - sum(part or 0.0 for part in parts) / state.unit_mm
        return found

    def _forget(self, axes: Sequence[int]) -> None:
        for axis in axes:
            self.state.position[axis] = None

    def _in_absolute(self, text: str) -> None:
        """A line in G90, whatever is in force."""
        if self.state.modes.distance == 910:
            self._put("G90")
            self._put(text)
            self._put("G91")
        else:
            self._put(f"G90{text}")

    def _reference(self, code: int, values: Mapping[str, float]) -> None:
        distance = self.state.modes.distance
        if axes := given_axes(values):
            self._put(f"G{distance // 10}G{code // 10}{words_of(values)}")
        else:
            self._put(f"G91G{code // 10}X0.Y0.Z0.")
            if distance == 900:
                self._put("G90")
        self._forget(axes or range(3))

    def _local(self, values: Mapping[str, float]) -> None:
        """G52: the offset of G92 is what it says."""
        state = self.state
        for axis in (axes := given_axes(values)):
            offset = values[AXES[axis]] * state.unit_mm
            if state.g92[axis] != 0.0 and not state.g52:
                raise ValueError("G52 behind G92: both set one offset on LinuxCNC, and two on FANUC")
            state.shift(axis, state.g92[axis], offset)
            state.g92[axis] = offset
        if axes:
            state.g52 = any(state.g92)
            self._put(f"G52{words_of(values)}")

    def _setting(self, code: int, values: Mapping[str, float]) -> None:
        """G92, G92.1, G92.2, G92.3."""
        state, unit = self.state, self.state.unit_mm
        if code == 920:
            if state.g52:
                raise ValueError("G92 behind G52: both set one offset on LinuxCNC, and two on FANUC")
            for axis in (axes := given_axes(values)):
                to, here, offset = values[AXES[axis]] * unit, state.position[axis], state.g92[axis]
                state.g92[axis] = None if here is None or offset is None else here + offset - to
                state.position[axis] = to
            if not axes:
                raise ValueError("G92 without an axis")
            state.saved_g92 = [*state.g92]
            self._put(f"G92{words_of(values)}")
            return
        wanted: list[float | None] = [*state.saved_g92] if code == 923 else [0.0, 0.0, 0.0]
        if code == 921:
            state.saved_g92 = [0.0, 0.0, 0.0]
        if state.g52 and code != 923:
            self._put("G52X0.Y0.Z0.")
            words = ""
        else:
            words = self._to_offsets(code, wanted)
        for axis in range(3):
            state.shift(axis, state.g92[axis], wanted[axis])
        state.g92 = [*wanted]
        state.g52 = False
        if words:
            self._put(f"G92{words}")

    def _to_offsets(self, code: int, wanted: list[float | None]) -> str:
        """The axis words of the G92 that sets these offsets."""
        state = self.state
        to: dict[str, float] = {}
        for axis in range(3):
            before, after, here = state.g92[axis], wanted[axis], state.position[axis]
            if before == after and before is not None:
                continue
            if before is None or after is None or here is None:
                raise ValueError(
                    f"G92.{code % 10}: the position of {AXES[axis].upper()} was not known at G92 or is not known here, "
                    "so that the offset is not"
                )
            to[AXES[axis]] = (here + before - after) / state.unit_mm
        return words_of(to)

    def _data(self, values: Mapping[str, float]) -> None:
        """G10."""
        state, unit = self.state, self.state.unit_mm
        kind, number = values.get("l", -1.0), int(values.get("p", 0.0))
        if kind == 1:
            if number <= 0:
                raise ValueError("G10 L1 needs P, the number of a tool")
            _refuse_x_and_y("G10 L1", values)
            for letter, table, place in (("z", state.lengths, 10), ("r", state.radii, 12)):
                if letter in values:
                    table[number] = values[letter] * unit
                    self._in_absolute(f"G10L{place}P{number}R{number_text(values[letter])}")
            return
        if kind not in {2, 20}:
            raise ValueError(f"G10 L{kind:g} is not read; L1, L2 and L20 are")
        system = number or state.modes.system
        if not 1 <= system <= 9:
            raise ValueError(f"G10 L{kind:g} P{number}: P is 1 to 9, or 0 for the system in force")
        if kind == 2 and values.get("r", 0.0) != 0.0:
            raise ValueError("G10 L2 R turns the work coordinate system: it is not read")
        offsets, written = state.offsets(system), {}
        for axis in given_axes(values):
            value = values[AXES[axis]] * unit
            if kind == 20:
                value = self._so_that(axis, value)
            if system == state.modes.system:
                state.shift(axis, offsets[axis], value)
            offsets[axis], written[AXES[axis]] = value, value / unit
        if written:
            self._in_absolute(f"G10{f'L2P{system}' if system <= 6 else f'L20P{system - 6}'}{words_of(written)}")

    def _so_that(self, axis: int, value: float) -> float:
        """The offset with which the position has this value."""
        state = self.state
        here, own = state.position[axis], state.offsets(state.modes.system)[axis]
        if here is None or own is None:
            raise ValueError(
                f"G10 L20: the position of {AXES[axis].upper()} or the offset of {system_words(state.modes.system)} is "
                "not known (input.work_offsets)"
            )
        return own + here - value


def _refuse_x_and_y(code: str, values: Mapping[str, float]) -> None:
    if values.get("x", 0.0) or values.get("y", 0.0):
        raise ValueError(f"{code} with an offset of X or Y: only that of Z is read")
