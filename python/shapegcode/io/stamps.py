"""Time stamps of logs as seconds: ISO 8601 in whatever spelling, dates with points, plain numbers."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta, timezone

__all__ = ["Stamps"]

#: 2017-02-10T18:33: stands before the seconds.
_MINUTE = 17
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_ISO = re.compile(
    r"(\d{4})[-/](\d\d)[-/](\d\d)[T ](\d\d):(\d\d)(?::(\d\d)([.,]\d+)?)? ?(Z|[+-]\d\d(?::?\d\d)?)?", re.IGNORECASE
)
_GERMAN = re.compile(r"(\d\d?)\.(\d\d?)\.(\d{4})[T ](\d\d?):(\d\d)(?::(\d\d)([.,]\d+)?)?")
_CLOCK = re.compile(r"(\d\d?):(\d\d):(\d\d)([.,]\d+)?")
_NUMBER = re.compile(r"\d+(\.\d*)?(e[+-]?\d+)?", re.IGNORECASE)
#: A plain number above it counts milliseconds since 1970: as seconds it would be the year 5138.
_MILLISECONDS_FROM = 1e11
_LATEST = 1e15


class Stamps:
    """Reads time stamps; those of the same minute quickly."""

    def __init__(self) -> None:
        """Nothing is known yet."""
        self._minute = b"-"
        self._base = 0.0

    def seconds(self, stamp: bytes) -> float:
        """A time stamp as seconds."""
        if stamp[:_MINUTE] == self._minute and stamp[-1:] == b"Z":
            try:
                second = float(stamp[_MINUTE:-1])
            except ValueError:  # 02,25 or worse: looked at below
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
    raise ValueError(f"{text!r} is no time")
