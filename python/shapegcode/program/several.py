"""A file that holds several programs, as a control punches its memory: what they are called, and which one is meant."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from shapegcode import _core

_PLACE = re.compile(r"#([1-9][0-9]{0,8})")
_NUMBER = re.compile(r"[Oo:]?0*([1-9][0-9]{0,7})")
_COMMENT = re.compile(rb"\([^()\r\n]*\)")
_CALLS = re.compile(rb"(?:M *0*1?98|G *6[56](?: *\. *1)?)(?![0-9.])")
_CALLED = re.compile(rb"P *0*([0-9]+)")
_RETURNS, _ENDS = re.compile(rb"M *0*99(?!\d)"), re.compile(rb"M *0*(?:2|30)(?!\d)")


@dataclass(frozen=True)
class ProgramPlace:
    """One program of a file."""

    index: int  # how many programs stand before it
    # what picks this one and no other: its number ``O0001``, its name ``<PART>``, either behind its folder
    # (``/USER/O0001``) where it stands in several; ``#3``, the third one, where nothing else tells them apart
    address: str
    first_line: int  # from 1
    text_begin: int  # byte at which its lines begin
    text_end: int  # byte behind them


def is_subprogram(text: bytes) -> bool:
    """Whether a program only returns to who called it: M99, and neither M02 nor M30."""
    plain = _COMMENT.sub(b"", text).upper()
    return _RETURNS.search(plain) is not None and _ENDS.search(plain) is None


def programs_of(text: bytes) -> tuple[ProgramPlace, ...]:
    """The programs of a file, in their order."""
    entries = _core.list_programs(text)
    short = [_own_name(entry) for entry in entries]
    long = [f"{entry.folder.rstrip('/')}/{own}" for entry, own in zip(entries, short, strict=True)]
    plain, full = Counter(short), Counter(long)
    # A line that ends with LF CR CR ends behind both.
    begins = [entry.text_begin + _carriage_returns(text, entry.text_begin) for entry in entries]
    ends = [*begins[1:], entries[-1].text_end]
    places = []
    for index, (entry, own, whole) in enumerate(zip(entries, short, long, strict=True)):
        address = own if own and plain[own] == 1 else whole if own and full[whole] == 1 else f"#{index + 1}"
        places.append(ProgramPlace(index, address, entry.first_line, begins[index], ends[index]))
    return tuple(places)


def place_of(text: bytes, wanted: str, source: str) -> int:
    """Which program of a text is meant."""
    entries, places = _core.list_programs(text), programs_of(text)
    if match := _PLACE.fullmatch(wanted):
        found = [index for index in range(len(places)) if index == int(match[1]) - 1]
    else:
        folder, _, name = wanted.rpartition("/")
        own = f"O{int(match[1]):04d}" if (match := _NUMBER.fullmatch(name)) else name
        found = [
            index
            for index, entry in enumerate(entries)
            if _own_name(entry) == own and (not folder or entry.folder.strip("/") == folder.strip("/"))
        ]
    if len(found) == 1:
        return found[0]
    known = ", ".join(places[index].address for index in found) or _listed([place.address for place in places])
    reason = (
        f"holds several programs {wanted}: say which, {known}" if found else f"holds no program {wanted} (but {known})"
    )
    raise _core.ProgramError(f"{source}:1:1: the file {reason}")


def index_of(text: bytes, wanted: int | str, source: str) -> int | None:
    """Position of one of several programs in a file, to read it alone."""
    try:
        entries = _core.list_programs(text)
    except _core.ProgramError:
        if isinstance(wanted, str):
            raise
        return None  # the reading says it, with its place
    if isinstance(wanted, int) and wanted not in [entry.number for entry in entries]:
        return None  # likewise
    index = place_of(text, wanted if isinstance(wanted, str) else f"O{wanted}", source)
    return index if len(entries) > 1 else None


def called_from(text: bytes, index: int, kept: Iterable[int]) -> tuple[ProgramPlace, ...]:
    """Programs of a file that one of them needs on the control, because their calls were not expanded."""
    entries, places = _core.list_programs(text), programs_of(text)
    found: set[int] = set()
    waiting = [(index, number) for number in kept]
    while waiting:
        caller, number = waiting.pop()
        # The reader looks in the folder of the program that calls first.
        same = [at for at, entry in enumerate(entries) if entry.number == number]
        same.sort(key=lambda at: entries[at].folder != entries[caller].folder)
        if not same and number > 9999:
            waiting.append((caller, number % 10000))  # P0030100: three times O0100
        elif same and same[0] not in found | {index}:
            found.add(same[0])
            lines = _COMMENT.sub(b"", text[places[same[0]].text_begin : places[same[0]].text_end]).upper().splitlines()
            calls = (_CALLED.search(line) for line in lines if _CALLS.search(line))
            waiting += [(same[0], int(call[1])) for call in calls if call]
    return tuple(places[at] for at in sorted(found))


def alone_with(program: bytes | memoryview, text: bytes, needed: Sequence[ProgramPlace]) -> bytes | memoryview:
    """A program that stands alone, and behind it others as they are in the file that it comes from."""
    if not needed:
        return program
    whole = bytes(program)
    end = whole.rfind(b"%") if whole.rstrip().endswith(b"%") else len(whole)
    return b"".join([whole[:end], *(text[place.text_begin : place.text_end] for place in needed), whole[end:]])


def _carriage_returns(text: bytes, at: int) -> int:
    return len(text[at : at + 2]) - len(text[at : at + 2].lstrip(b"\r"))


def _own_name(entry: _core.ProgramEntry) -> str:
    return f"O{entry.number:04d}" if entry.number >= 0 else entry.name


def _listed(addresses: list[str], most: int = 20) -> str:
    more = len(addresses) - most
    return ", ".join(addresses[:most]) + (f" and {more} more" if more > 0 else "")
