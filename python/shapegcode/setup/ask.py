"""Ask the questions about a machine at a terminal; `answers` defines them."""

import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, get_args

import questionary

from shapegcode.errors import FileError
from shapegcode.settings.keys import facts
from shapegcode.setup.answers import EXPLAINED, Answers, is_mode, read_answers
from shapegcode.setup.build import dump_lacks_rapids, dump_problem, tap_problem

_UNKNOWN, _BACK = "unknown", "<"
_TITLES = {
    _UNKNOWN: "not known yet",
    _BACK: "(back to the previous question)",
    "fanuc": "FANUC (0i, 16i, 18i, 21i, 30i, 31i, 32i)",
    "linuxcnc": "LinuxCNC",
    "other": "another one that reads FANUC programs",
    "memory": "loaded into the memory",
    "dnc": "sent over a line while it runs (DNC)",
    "data server": "from a data server, a memory card or a network",
    "none": "none, or never on",
    "G05.1": "G05.1 Q1 (AI contour control, AI advanced preview control: 0i, 30i)",
    "G08": "G08 P1 (advanced preview control)",
}
_UNITS = {"m/min": ("mm/min", 1000.0), "m/s²": ("mm/s²", 1000.0), "MB": ("kB", 1024.0), "mm": ("µm", 1000.0)}
"""Other usual units: for each the unit into which it is converted, and the factor."""
_OF_AXES = ("rapid_mm_per_min", "max_feed_mm_per_min", "max_acceleration_mm_s2")
_FILES = {
    "dump": "parameter file, such as CNC-PARA.TXT, or LinuxCNC's INI file",
    "file": "record of a tap test: CSV, UFF or WAV",
}
_TYPED_MODES = {
    "file": ("Which file?", _FILES["file"]),
    "known": ("Which frequency and damping ratio?", "Hz and ratio, such as 46:0.02"),
}
_VIBRATION = {
    "file": "tapped: I have the record of a tap test",
    "known": "from a data sheet or an earlier test: I know frequency and damping",
    "rigid": "rigid: no significant vibration",
}


def ask_all() -> Answers:
    """Ask every question that previous answers leave open; `<` goes back to the previous one."""
    given: dict[str, Any] = {}
    asked: list[str] = []
    questions = [name for name in Answers.model_fields if name != "modes"] + [f"modes.{axis}" for axis in "xyz"]
    while True:
        needless = set(_left_out(given))
        behind = questions[questions.index(asked[-1]) + 1 :] if asked else questions
        name = next((name for name in behind if name not in needless), None)
        if name is None:
            return read_answers(given)
        answer = _vibration(name[-1]) if name.startswith("modes.") else _asked(name, given)
        if answer == _BACK:
            if asked:
                given.pop(asked.pop(), None)
            continue
        asked.append(name)
        if answer is not None:
            given[name] = answer
        if name == questions[-1]:
            given["modes"] = {key[-1]: given.pop(key) for key in questions[-3:] if key in given}
        if not name.startswith("modes.") or "modes" in given:
            name = name.partition(".")[0]
            print(f"  {EXPLAINED[name](getattr(read_answers(_alone(name, given)), name))}")


def _alone(name: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """One answer, together with those without which it cannot be evaluated."""
    needed = {"delivery", "dnc_baud"} if name == "dnc_baud" else {name}
    return {key: given[key] for key in needed if key in given}


def _left_out(given: Mapping[str, Any]) -> Iterator[str]:
    """Yield questions that are unnecessary after the answers so far."""
    if given.get("control") == "other":
        yield "dump"
    if given.get("control") == "linuxcnc":
        yield from ("look_ahead", "least_increment_mm", "delivery")
    if given.get("dump"):
        yield from ("max_feed_mm_per_min", "max_acceleration_mm_s2", "least_increment_mm")
        if given.get("control") == "linuxcnc" or not dump_lacks_rapids(given["dump"]):
            yield "rapid_mm_per_min"
    if given.get("delivery") != "dnc":
        yield "dnc_baud"
    if given.get("delivery") != "memory":
        yield "program_memory_kb"


def _asked(name: str, given: Mapping[str, Any]) -> Any:
    """Ask one question; None: not known yet."""
    field = Answers.model_fields[name]
    question = field.description or ""
    if choices := _choices(field.annotation):
        reply = _chosen(question, {each: _TITLES[each] for each in choices})
        return None if reply == _UNKNOWN else reply
    unit = _unit(name)
    kind = _FILES.get(name, f"{unit}, or x, y, z" if name in _OF_AXES else unit)
    typed = _typed(question, kind, lambda text: _problem(name, text, given))
    return typed if typed == _BACK else _parsed(name, typed)


def _chosen(question: str, titles: Mapping[str, str]) -> str:
    """Ask to choose an answer; the first is `not known yet`, the last goes back."""
    shown = {_UNKNOWN: _TITLES[_UNKNOWN], **titles, _BACK: _TITLES[_BACK]}
    choices = [questionary.Choice(title, value) for value, title in shown.items()]
    return str(questionary.select(question, choices=choices).unsafe_ask())


def _typed(question: str, kind: str, check: Callable[[str], bool | str]) -> str:
    """Ask for one line, checked at Enter and repeated until it is valid. Empty: not known yet."""

    def checked(text: str) -> bool | str:
        return text.strip() in ("", _BACK) or check(text)

    hint = "; ".join(filter(None, (kind, "Enter: not known yet", f"{_BACK}: back")))
    reply = questionary.text(f"{question} [{hint}]", validate=checked, validate_while_typing=False).unsafe_ask()
    return str(reply).strip()


def _unit(name: str) -> str:
    """Unit of a question; empty: none."""
    return str(facts(Answers.model_fields[name]).get("unit", ""))


def _choices(annotation: Any) -> list[str]:
    """Choices of a question; empty if it has none."""
    words = [each for option in (annotation, *get_args(annotation)) for each in get_args(option)]
    return list(dict.fromkeys(each for each in words if isinstance(each, str)))


def _parsed(name: str, typed: str) -> Any:
    """Parse a text, a number, or one number per axis, with an optional unit."""
    text = typed.strip()
    if not text:
        return None
    if name in ("name", "dump"):
        return text
    found = re.fullmatch(r"([-+.\d\s,;/]*\d\.?)\s*([^\d\s].*)?", text)
    if found is None:
        raise ValueError(text)
    numbers = [float(part) for part in re.split(r"[\s,;/]+", found[1])]
    unit, reply = _unit(name), (found[2] or "").replace("s2", "s²").replace("um", "µm")
    if reply not in ("", unit):
        into, factor = _UNITS.get(reply, ("", 0.0))
        if into != unit:
            raise ValueError(reply)
        numbers = [number * factor for number in numbers]
    if len(numbers) == 3:
        return dict(zip("xyz", numbers, strict=True))
    if len(numbers) != 1:
        raise ValueError(f"{len(numbers)} numbers")
    return int(numbers[0]) if name == "dnc_baud" else numbers[0]


def _problem(name: str, typed: str, given: Mapping[str, Any]) -> bool | str:
    """True if an answer can be used, else its problem: the question is then repeated."""
    try:
        value = _parsed(name, typed)
    except ValueError:
        of_axes = ", or three with commas between (X, Y, Z)" if name in _OF_AXES else ""
        return f"{typed}: must be a number in {_unit(name)}{of_axes}"
    if name == "dump":
        return _of_file(str(value), lambda file: dump_problem(file, given.get("control")))
    try:
        read_answers(_alone(name, {**given, name: value}))
    except FileError as error:
        return "; ".join(f"{problem.value}: {problem.limit}" for problem in error.problems)
    return True


def _of_file(file: str, problem: Callable[[str], str]) -> bool | str:
    """True if a file exists and has no problem, else the problem."""
    return problem(file).replace("\n", "; ") or True if Path(file).is_file() else f"{file}: no such file"


def _vibration(axis: str) -> str | None:
    """Ask for the modes of an axis: tapped, known, rigid; None: not known yet."""
    while True:
        kind = _chosen(f"{axis.upper()}: tapped, from a data sheet, or rigid?", _VIBRATION)
        if kind not in _TYPED_MODES:
            return None if kind == _UNKNOWN else kind
        reply = _typed(*_TYPED_MODES[kind], _tap if kind == "file" else _mode)
        if reply != _BACK:
            return reply or None


def _tap(typed: str) -> bool | str:
    return _of_file(typed.strip(), tap_problem)


def _mode(typed: str) -> bool | str:
    if not is_mode(typed.strip()):
        return f"{typed}: must be FREQUENCY:DAMPING in Hz, such as 46:0.02"
    try:
        read_answers({"modes": {"x": typed.strip()}})
    except FileError as error:
        return "; ".join(problem.limit for problem in error.problems)
    return True
