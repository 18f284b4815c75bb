"""The data items of a log of runs, their time stamps, and notes of gaps and ignored data."""

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from typing import Literal, TypeAlias, get_args

from shapegcode.errors import RecordError
from shapegcode.io.units import find_unit, units_of

Role = Literal[
    "time", "block", "sequence", "block_text", "feed", "tool", "spindle", "feed_override", "rapid_override", "status",
    "program", "runtime", "x", "y", "z",
]  # fmt: skip
State = Literal["active", "hold", "stop", "completed", "ended", "unknown"]

#: Names by role, preferred ones first; only letters and digits are compared, without case.
_NAMES: dict[Role, str] = {
    "time": "time timestamp times datetime date zeit t clock",
    "block": "block_number line_number line program_line current_line nc_line block_no line_no block_num "
    "current_block_number active_line satznummer zeile",
    "sequence": "line_label sequence_number seq_number sequence seq n_number",
    "block_text": "block block_text current_block active_block program_block satz",
    "feed": "feed_rate path_feedrate actual_feed_rate actual_feed feed_act feed_actual path_feedrate_actual path_feed "
    "feed fact frt act_feed vorschub",
    "tool": "current_tool tool_number tool_id active_tool tool_no tool_num tool_asset_id tool act_tool "
    "t_number werkzeug",
    "spindle": "spindle_speed rotary_velocity spindle_speed_actual actual_spindle_speed spindle_rpm s_speed speed_act "
    "sspeed s1speed srpm rpm spindle",
    "feed_override": "feed_override path_feedrate_override feedrate_override feed_rate_override fovr feed_ovr fov "
    "frapid_override_feed override",
    "rapid_override": "rapid_override path_feedrate_override_rapid rapid_feed_override rovr rapid_ovr rov",
    "status": "program_status execution execution_state exec execution_status run_status cycle_status program_state "
    "status",
    "program": "program_name_running program program_name running_program active_program current_program main_program "
    "prog programm",
    "runtime": "program_runtime_seconds cycle_time_seconds run_time_seconds",
    "x": "x x_act xact x_actual x_pos xpos x_position actual_x x_abs xabs pos_x x_mm position_x",
    "y": "y y_act yact y_actual y_pos ypos y_position actual_y y_abs yabs pos_y y_mm position_y",
    "z": "z z_act zact z_actual z_pos zpos z_position actual_z z_abs zabs pos_z z_mm position_z",
}

_MAX_NAMES = 1000  # stored names for messages

ROLES: tuple[Role, ...] = get_args(Role)  # roles of an item; the keys of `items`

_STATES: dict[State, str] = {
    "active": "ACTIVE RUNNING RUN EXECUTING IN_CYCLE CYCLE AUTO_RUN START STARTED STRT MSTR",
    "hold": "FEED_HOLD INTERRUPTED HOLD HELD FEEDHOLD PAUSED PAUSE OPTIONAL_STOP PROGRAM_OPTIONAL_STOP WAIT WAITING "
    "PROGRAM_STOPPED",
    "stop": "STOPPED STOP",
    "completed": "PROGRAM_COMPLETED COMPLETED FINISHED DONE PROGRAM_END M30 M02",
    "ended": "READY IDLE RESET ABORTED CANCELLED CANCELED UNAVAILABLE OFF E_STOP EMERGENCY_STOP",
}
STATES: dict[str, State] = {word.replace("_", ""): state for state, words in _STATES.items() for word in words.split()}
"""Meaning of a status, by its words in capitals without blanks, underscores and hyphens."""


def plain_name(name: str) -> str:
    """Letters and digits of a name in lower case: Block_Number and "block number" are the same."""
    return re.sub(r"[\W_]", "", name.lower())


_KNOWN: dict[str, tuple[Role, int]] = {}
for _role, _words in _NAMES.items():
    for _rank, _word in enumerate(_words.split()):
        _KNOWN.setdefault(plain_name(_word), (_role, _rank))


def stated_feed_unit(text: str) -> str:
    """Standard name of a unit of feed given in any spelling; raises for other units."""
    unit = find_unit(text)
    if unit is None or unit.measures != "velocity":
        raise RecordError(f"unit {text!r} of the feed: must be one of {units_of('velocity')}")
    return unit.name


@dataclass(frozen=True, eq=False)
class Item:
    """A data item of a log that has a known role."""

    name: str  # in the file
    role: Role  # its meaning
    rank: int  # preference of its name within its role; the lowest is used


class ItemTable:
    """Identifies the items of a file."""

    def __init__(self, chosen: Mapping[str, str] | None = None) -> None:
        self.chosen = chosen or {}  # names by role, which override the known ones
        self.seen: dict[str, Item | None] = {}  # names found in the file, and their items
        self._chosen: dict[str, tuple[Role, int]] = {}
        self._items: dict[tuple[str, Role], Item] = {}
        for role, name in self.chosen.items():
            if role not in ROLES:
                close = difflib.get_close_matches(role, ROLES, n=1, cutoff=0.5)
                hint = f"; did you mean {close[0]}?" if close else ""
                raise RecordError(f"items: {role!r} is not known{hint}; must be one of {', '.join(ROLES)}")
            if not isinstance(name, str) or not name.strip():
                raise RecordError(f"items: {role} = {name!r}: must be the name of an item in the log")
            self._chosen[name.strip().lower()] = role, 0

    def find(self, *names: str) -> Item | None:
        """Identify an item by its names."""
        found = self._find(names)
        if found is not None:
            # An item that another document contains too is the same object: values are stored by item.
            found = self._items.setdefault((found.name, found.role), found)
        if len(self.seen) < _MAX_NAMES:
            self.seen[names[0]] = found
        return found

    def _find(self, names: tuple[str, ...]) -> Item | None:
        for name in names:
            for text in (name, name.rpartition(":")[2]):
                if chosen := self._chosen.get(text.strip().lower()):
                    return Item(names[0], *chosen)
        for name in names:
            found = _KNOWN.get(plain_name(name.rpartition(":")[2]))
            if found is not None and found[0] not in self.chosen:
                return Item(names[0], *found)
        return None

    def sought(self, role: Role) -> str:
        """The name chosen for a role, or the first six of those that are searched, for messages."""
        return self.chosen.get(role) or ", ".join(_NAMES[role].split()[:6])


Event: TypeAlias = tuple[int, float, bytes, Item, bytes]  # (line, time in s, time stamp, item, value as text)

_SHOWN = 3


class FileNotes:
    """Notes since the last run."""

    def __init__(self) -> None:
        self.feed_unit: str | None = None  # unit of the feed as stated by the file
        self._kinds: dict[str, tuple[list[str], int, int]] = {}

    def add(self, kind: str, line: int, text: str) -> None:
        """Count a note of one kind, and keep the first few."""
        shown, count, _ = self._kinds.get(kind, ([], 0, 0))
        if len(shown) < _SHOWN:
            shown.append(f"line {line}: {text}" if line else text)
        self._kinds[kind] = shown, count + 1, line

    def taken(self) -> tuple[str, ...]:
        """Return the notes and clear them."""
        found: list[str] = []
        for shown, count, line in self._kinds.values():
            found += shown
            if count > len(shown):
                found.append(f"{count - len(shown)} more of the same kind" + (f", up to line {line}" if line else ""))
        self._kinds = {}
        return tuple(found)


_MINUTE = 17  # 2017-02-10T18:33: length of the part before the seconds
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_ISO = re.compile(
    r"(\d{4})[-/](\d\d)[-/](\d\d)[T ](\d\d):(\d\d)(?::(\d\d)([.,]\d+)?)? ?(Z|[+-]\d\d(?::?\d\d)?)?", re.IGNORECASE
)
_GERMAN = re.compile(r"(\d\d?)\.(\d\d?)\.(\d{4})[T ](\d\d?):(\d\d)(?::(\d\d)([.,]\d+)?)?")
_CLOCK = re.compile(r"(\d\d?):(\d\d):(\d\d)([.,]\d+)?")
_NUMBER = re.compile(r"\d+(\.\d*)?(e[+-]?\d+)?", re.IGNORECASE)
#: Larger plain numbers are milliseconds since 1970: in seconds they would be after the year 5138.
_MILLISECONDS_FROM = 1e11
_LATEST = 1e15


class Stamps:
    """Reads time stamps; those of the same minute quickly."""

    def __init__(self) -> None:
        self._minute = b"-"
        self._base = 0.0

    def seconds(self, stamp: bytes) -> float:
        """Convert a time stamp to seconds."""
        if stamp[:_MINUTE] == self._minute and stamp[-1:] == b"Z":
            try:
                second = float(stamp[_MINUTE:-1])
            except ValueError:  # decimal comma or invalid: see below
                second = -1.0
            if 0.0 <= second < 61.0:
                return self._base + second
        text = stamp.decode("latin-1").partition("@")[0].strip()
        found = _ISO.fullmatch(text)
        if found is None:
            return _other(text)
        year, month, day, hour, minute, second_, fraction, zone = found.groups()
        moment = datetime(int(year), int(month), int(day), int(hour), int(minute), tzinfo=_zone(zone))
        base = (moment - _EPOCH).total_seconds()
        if zone in ("Z", "z") and text[_MINUTE - 1 : _MINUTE] == ":":
            self._minute, self._base = text[:_MINUTE].encode(), base
        return base + _second(second_, fraction)


def _second(second: str | None, fraction: str | None) -> float:
    value = float((second or "0") + (fraction or "").replace(",", "."))
    if value >= 61.0:
        raise ValueError(f"second {value:g}")
    return value


def _zone(text: str | None) -> timezone:
    if text is None or text in "Zz":
        return UTC
    digits = text[1:].replace(":", "")
    offset = timedelta(hours=int(digits[:2]), minutes=int(digits[2:] or 0))
    return timezone(-offset if text[0] == "-" else offset)


def _other(text: str) -> float:
    if found := _GERMAN.fullmatch(text):
        day, month, year, hour, minute = (int(word) for word in found.groups()[:5])
        moment = datetime(year, month, day, hour, minute, tzinfo=UTC)
        return (moment - _EPOCH).total_seconds() + _second(found[6], found[7])
    if found := _CLOCK.fullmatch(text):
        return 3600.0 * int(found[1]) + 60.0 * int(found[2]) + _second(found[3], found[4])
    if _NUMBER.fullmatch(text) and (value := float(text)) < _LATEST:
        return value / 1000.0 if value > _MILLISECONDS_FROM else value
    raise ValueError(f"{text!r} is not a time")
