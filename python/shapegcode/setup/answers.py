"""Questions about a machine in their order, and the file of answers.

    name = "VMC-3"
    rapid_mm_per_min = 24000
    delivery = "dnc"
    dnc_baud = 9600
    modes = { x = "46:0.02", y = "taps/y.csv", z = "rigid" }

Every question may be left open: a limit of the axes is then assumed, any other key has its default.
"""

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, Strict, field_validator, model_validator

from shapegcode.errors import FileError, Problem
from shapegcode.io.data_file import DataFile
from shapegcode.settings.keys import InlineTable, Positive, PositiveAxisValues, Text, TomlTable, key, toml
from shapegcode.settings.load import KeyProblem, line_of, parsed, read_text, validated

Delivery = Literal["memory", "dnc", "data server"]
LookAhead = Literal["none", "G05.1", "G08"]

_HIGHEST_HZ = 10_000.0
_USUAL_DAMPING = 0.02
_LIKELY = {
    "rapid_mm_per_min": (100.0, 500_000.0, "unit: mm/min; 24 m/min are 24000"),
    "max_feed_mm_per_min": (100.0, 500_000.0, "unit: mm/min; 24 m/min are 24000"),
    "max_acceleration_mm_s2": (50.0, 100_000.0, "unit: mm/s²; 3 m/s² are 3000, 1 g is 9810"),
}
"""Plausible range of an axis value: outside of it the unit is wrong."""
_NOT_A_MODE = ' (nor "FREQUENCY:DAMPING", "rigid" or "unknown")'
_MODE = re.compile(r"\s*\d+(\.\d*)?\s*(:\s*\d*\.?\d+)?\s*")


class AnswersError(FileError):
    """Answers that cannot be used; the message lists every problem."""


class ModesAnswer(InlineTable):
    """Known vibration modes of each axis."""

    x: Text = key('X: a tap test\'s file, "FREQUENCY:DAMPING" in Hz, "rigid", or "unknown"', default="unknown")
    y: Text = key("Y: likewise", default="unknown")
    z: Text = key("Z: likewise", default="unknown")

    @field_validator("x", "y", "z")
    @classmethod
    def _possible(cls, answer: str) -> str:
        if is_mode(answer):
            frequency, damping = mode_of(answer)
            if not 0.0 < frequency <= _HIGHEST_HZ or not 0.0 <= damping < 1.0:
                raise ValueError(
                    f"the frequency must be above 0 and at most {_HIGHEST_HZ:g} (unit: Hz), the damping ratio "
                    "0 or more and below 1"
                )
        return answer


class Answers(TomlTable):
    """A shop's answers about its machine."""

    name: Text = key("What do you call the machine?", default="unnamed")
    control: Literal["fanuc", "linuxcnc", "other"] | None = key("Which control does it have?", default=None)
    dump: Text | None = key("Is there a parameter file of the control?", default=None)
    rapid_mm_per_min: PositiveAxisValues | None = key("How fast are the rapids (G00)?", default=None)
    max_feed_mm_per_min: PositiveAxisValues | None = key("What is the largest cutting feed?", default=None)
    max_acceleration_mm_s2: PositiveAxisValues | None = key("How fast may an axis accelerate in a cut?", default=None)
    least_increment_mm: Annotated[Positive, Field(le=0.1)] | None = key("What is the least increment?", default=None)
    delivery: Delivery | None = key("How does a program get to the machine?", default=None)
    dnc_baud: Annotated[int, Strict(), Field(ge=110, le=10_000_000)] | None = key(
        "What is the speed of the line?", default=None
    )
    program_memory_kb: Annotated[Positive, Field(le=1e9)] | None = key("How large is the program memory?", default=None)
    look_ahead: LookAhead | None = key("Which code switches the look-ahead mode on?", default=None)
    contour_um: Positive | None = key("What is the contour tolerance?", default=None)
    modes: ModesAnswer = key("What is known about its vibration?", default={})

    @field_validator("name")
    @classmethod
    def _plain(cls, answer: str) -> str:
        if not re.fullmatch(r"[\x20-\x7e]{1,60}", answer) or not answer.strip():
            raise ValueError("must be 1 to 60 plain ASCII characters, since it is written into the header of programs")
        return answer

    @model_validator(mode="after")
    def _is_likely(self) -> Self:
        for name, (low, high, example) in _LIKELY.items():
            answer = getattr(self, name)
            if answer is not None and not all(low <= value <= high for value in answer.as_tuple()):
                raise KeyProblem(name, answer, f"must be {low:g} to {high:g} ({example})")
        if self.control == "linuxcnc" and self.look_ahead not in (None, "none"):
            raise KeyProblem("look_ahead", self.look_ahead, 'is a code of FANUC controls, and control is "linuxcnc"')
        if self.dnc_baud is not None and self.delivery != "dnc":
            raise ValueError('dnc_baud is given, and delivery is not "dnc": delete one of them')
        return self


def is_mode(answer: str) -> bool:
    """True if an answer on vibration is a frequency in Hz, with or without a damping ratio."""
    return _MODE.fullmatch(answer) is not None


def mode_of(answer: str) -> tuple[float, float]:
    """Frequency in Hz and damping ratio, 0.02 if none is given, of an answer for which `is_mode` is true."""
    frequency, _, damping = answer.partition(":")
    return float(frequency), float(damping) if damping.strip() else _USUAL_DAMPING


def _is_file(answer: str) -> bool:
    return answer not in ("rigid", "unknown") and not is_mode(answer)


def read_answers(source: str | Path | Mapping[str, Any]) -> Answers:
    """Read answers from a file (TOML, or JSON by its ending) or a mapping.

    Args:
        source: the file, to whose folder relative file names refer; or the answers by key.

    Returns:
        The answers.

    Raises:
        AnswersError: an unknown key, a wrong value, or a file that does not exist; every problem with its line.
        OSError: the file cannot be read.
    """
    if isinstance(source, Mapping):
        return _with_files(validated(Answers, dict(source), "answers", "", AnswersError), "answers", "")
    path = Path(source)
    text = read_text(path, AnswersError)
    if path.suffix.lower() != ".json":
        data = parsed(text, str(path), AnswersError)
    else:
        try:
            with DataFile(path, lambda answer: AnswersError(str(path), (Problem("", "", answer),))) as file:
                data = file.json("the answers", file.read())
        except json.JSONDecodeError as error:
            raise AnswersError(str(path), (Problem("", "", f"not JSON: {error.msg}", error.lineno),)) from None
        if not isinstance(data, dict):
            raise AnswersError(str(path), (Problem("", "", "must be an object"),))
    found = validated(Answers, data, str(path), text, AnswersError)
    modes = {axis: str(path.parent / answer) if _is_file(answer) else answer for axis, answer in found.modes}
    dump = None if found.dump is None else str(path.parent / found.dump)
    found = found.model_copy(update={"dump": dump, "modes": ModesAnswer(**modes)})
    return _with_files(found, str(path), text)


def _with_files(answers: Answers, source: str, text: str) -> Answers:
    """Return the answers if their files exist."""
    named = {"dump": answers.dump} if answers.dump is not None else {}
    named |= {f"modes.{axis}": answer for axis, answer in answers.modes if _is_file(answer)}
    problems = tuple(
        Problem(key, toml(file), "no such file" + (_NOT_A_MODE if key != "dump" else ""), line_of(key, text))
        for key, file in named.items()
        if not Path(file).is_file()
    )
    if problems:
        raise AnswersError(source, problems)
    return answers


def _of_modes(modes: ModesAnswer) -> str:
    answer = modes.model_dump()
    unknown = "".join(axis.upper() for axis in "xyz" if answer[axis] == "unknown")
    if not unknown:
        return "The shaper is designed for these modes; rigid axes are ignored."
    are = "is tapped it is" if len(unknown) == 1 else "are tapped they are"
    return f"Until {', '.join(unknown)} {are} simulated as rigid, and reported if shaped cuts move them."


EXPLAINED: Mapping[str, Callable[[Any], str]] = {
    "name": lambda _: "It is written in the header of every program.",
    "control": lambda answer: {
        "fanuc": "Its parameter file can be read; look-ahead is switched by G05.1 or G08.",
        "linuxcnc": "Its INI file can be read; programs are written in its dialect and simulated with its planner.",
    }.get(answer, "Programs are written for FANUC controls: try one above the part first."),
    "dump": lambda answer: (
        "Limits and other parameters of motion are read from it; it has no vibration modes."
        if answer
        else "Limits and time constants are then your answers, or assumed and marked so."
    ),
    "rapid_mm_per_min": lambda answer: (
        "It determines the time of rapids."
        if answer
        else "24 m/min are assumed, as usual for a machining centre: the time of rapids is a guess."
    ),
    "max_feed_mm_per_min": lambda answer: (
        "Feeds above it are cut down, and cost time." if answer else "The rapid rate is assumed for it."
    ),
    "max_acceleration_mm_s2": lambda answer: (
        "It determines the speed in corners and how much vibration is excited."
        if answer
        else "0.3 g is assumed, as usual for a machining centre: measure it with `shapegcode characterize --runs`."
    ),
    "least_increment_mm": lambda answer: (
        "Block ends are rounded to it: a finer one gives better shaping." if answer else "0.001 mm is assumed (IS-B)."
    ),
    "delivery": lambda answer: {
        "memory": "Emitted programs must fit into the memory; convert checks that.",
        "dnc": "Blocks cannot arrive faster than the line transmits them.",
        "data server": "Size and line speed are not limited.",
        None: "No limit is assumed.",
    }[answer],
    "dnc_baud": lambda answer: (
        f"{answer / 11:.0f} characters, or some {answer / 11 / 25:.0f} short blocks a second: convert warns if that "
        f"is too slow, and `--baud {answer}` fits the program to it."
        if answer
        else "Whether blocks arrive in time cannot be checked: set controller.dnc_baud before you run a shaped program."
    ),
    "program_memory_kb": lambda answer: "A larger program gets a warning." if answer else "256 kB are assumed.",
    "look_ahead": lambda answer: (
        "The mode is switched off before each shaped cut and on after it."
        if answer not in (None, "none")
        else "No code is written: the mode must be off while a shaped program runs."
    ),
    "contour_um": lambda answer: (
        "Larger deviations are not allowed: a smaller tolerance costs time at corners."
        if answer
        else "20 µm apply, for roughing; finishing needs less."
    ),
    "modes": _of_modes,
}
"""Effect of an answer in one sentence, by the name of the question; called with the answer."""
