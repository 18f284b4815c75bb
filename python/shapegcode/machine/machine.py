"""The machine file (TOML): description of a machine tool and its controller.

:class:`Machine` and its tables define all defaults; ``docs/reference/machine.md`` is generated from the descriptions
of the keys.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, overload

from pydantic import Field, PrivateAttr, Strict, model_validator

from shapegcode._core import Mode
from shapegcode.errors import ArgumentError, MachineError, Problem
from shapegcode.machine.axes import Axes, as_mode
from shapegcode.machine.controller import Controller, FeedControl, PowerOn, Times
from shapegcode.machine.dialects import CODE, code_name, dialect_of, fanuc_meaning
from shapegcode.machine.programs import Emission, Input, Price, Shaping, Tolerance, Verdict
from shapegcode.settings.keys import (
    DEFAULT,
    ORIGIN_TEXT,
    KeyValue,
    Text,
    TomlTable,
    inherited,
    key,
    origin_of,
    remark_of,
    remarks_in_comments,
    take_origins,
    toml,
    values_of,
)
from shapegcode.settings.load import (
    MAX_PROBLEMS,
    KeyProblem,
    further_problems,
    line_of,
    parsed,
    read_text,
    validated,
    with_values,
)

_LOWEST_HZ = 0.1  # of a mode, in `Machine.simple`
_ASSUMED_DAMPING_RATIO = 0.02  # structures with guides have 0.01 to 0.05
# Limits of every axis of `Machine.simple`
_SIMPLE_LIMITS = {"max_feed_mm_per_min": 12_000.0, "rapid_mm_per_min": 24_000.0, "max_acceleration_mm_s2": 3000.0}
_VARIABLE = re.compile(r"#\d+")
_LOCK_LINES = ("lock_lines", "unlock_lines")
_USUAL_DIAL_PERCENT = (70.0, 120.0)  # range that operators usually set


class Machine(TomlTable):
    """A machine tool and its controller, as a machine file describes them."""

    name: Annotated[str, Strict(), Field(min_length=1, max_length=60, pattern=r"^[\x20-\x7e]+$")] = key(
        "short name, in plain ASCII for the header of programs"
    )
    description: Text = key("description of the machine and origin of its values", default="")
    axes: Axes = key("limits and vibration modes of the axes")
    controller: Controller = key("how the controller moves the axes; its limits", default={})
    times: Times = key("times in addition to the motion", default={})
    power_on: PowerOn = key("modal state before the first block", default={})
    input: Input = key("how programs are read", default={})
    feed_control: FeedControl = key("how the controller follows changes of the feed", default={})
    emission: Emission = key("how shaped programs are written", default={})
    shaping: Shaping = key("what is shaped, and how", default={})
    tolerance: Tolerance = key("tolerances of an emitted program", default={})
    price: Price = key("limits of the time added by shaping", default={})
    verdict: Verdict = key("operating conditions in which the tolerances must be kept", default={})

    def __new__(cls, *args: object, **values: object) -> Machine:
        """Refuse arguments: values come from TOML, so that errors name lines."""
        if args or values:
            raise ArgumentError("use Machine.load(name or file), Machine.simple(modes) or Machine.from_toml(text)")
        return super().__new__(cls)

    def __repr__(self) -> str:
        return f"<Machine {self.name!r}: values() lists its keys>"

    __str__ = __repr__

    @model_validator(mode="after")
    def _block_period_fits(self) -> Machine:
        period = self.emission.block_period_s
        if period is None:
            return self
        tick = self.controller.interpolation_period_s
        ratio = period / tick
        if round(ratio) < 1 or not math.isclose(ratio, round(ratio), rel_tol=0, abs_tol=1e-6):
            limit = f"must be a whole multiple of controller.interpolation_period_s = {toml(tick)}"
            raise KeyProblem("emission.block_period_s", period, limit)
        shortest = self.controller.block_time_s
        if period < shortest * (1 - 1e-9):
            limit = f"must not be below controller.block_time_s = {toml(shortest)}"
            raise KeyProblem("emission.block_period_s", period, limit)
        return self

    @model_validator(mode="after")
    def _dialect_runs_the_blocks(self) -> Machine:
        emission, given_s = self.emission, self.controller.block_time_s
        own, dialect = dialect_of(emission.dialect), f"emission.dialect = {toml(emission.dialect)}"
        if own is None:
            return self
        shortest = own.min_block_s
        if shortest is not None and given_s < shortest * (1 - 1e-9):
            limit = f"must not be below {toml(shortest)} with {dialect}: {own.facts['shortest block'].text}"
            raise KeyProblem("controller.block_time_s", given_s, limit)
        for name, lines in zip(("prologue", "epilogue", *_LOCK_LINES), emission.around_cuts.values(), strict=True):
            for code in map(code_name, CODE.findall(" ".join(lines))):
                if code in own.means:
                    meanings = f"{fanuc_meaning(code)} on FANUC, and {own.means[code]} on {own.control}"
                    limit = f"{code} is {meanings}: these lines are written for {dialect}"
                    raise KeyProblem(f"emission.{name}", list(lines), limit)
        return self

    @model_validator(mode="after")
    def _modes_stand_where_they_are_excited(self) -> Machine:
        for index, (letter, axis) in enumerate(zip("xyz", self.axes.as_tuple(), strict=True)):
            for number, mode in enumerate(axis.modes, start=1):
                if not mode.excitation(index)[index]:
                    shares = mode.excited_by.model_dump() if mode.excited_by else {}
                    limit = f"must have a component along {letter}: a mode is listed under an axis that excites it"
                    raise KeyProblem(f"axes.{letter}.modes.{number}.excited_by", shares, limit)
        return self

    @model_validator(mode="after")
    def _override_can_be_locked(self) -> Machine:
        emission, controller = self.emission, self.controller
        if emission.override != "lock":
            return self
        own, (*_, lock, unlock) = dialect_of(emission.dialect), emission.around_cuts.values()
        if own is None or not own.lock_word:
            for name, lines in zip(_LOCK_LINES, (lock, unlock), strict=True):
                if not lines:
                    none = f": no word that switches the feed override of {own.control} off is known" if own else ""
                    limit = f'must not be empty with emission.override = "lock"{none}'
                    raise KeyProblem(f"emission.{name}", [], limit)
        variables = set(_VARIABLE.findall(" ".join((*lock, *unlock))))
        kept = variables - {"#3003", "#3004"}
        for name, lines in (("prologue", emission.prologue), ("epilogue", emission.epilogue)):
            if used := kept & set(_VARIABLE.findall(" ".join(lines))):
                limit = f"uses {min(used)}, in which emission.lock_lines store the switch"
                raise KeyProblem(f"emission.{name}", list(lines), limit)
        if variables and self.shaping.rapids:
            raise KeyProblem(
                "shaping.rapids",
                True,
                'does not go with emission.override = "lock" and variables in emission.lock_lines: use the builder\'s '
                'own codes there, such as ["M49"] and ["M48"], or use "any"',
            )
        if variables and not controller.holds_macros:
            why = f"controller.dnc_baud = {controller.dnc_baud}" if controller.macros else "controller.macros = false"
            raise KeyProblem(
                "emission.override",
                "lock",
                f"emission.lock_lines set a variable, but none can be set with {why}: use the builder's own codes "
                'there, such as ["M49"] and ["M48"], or use "any"',
            )
        return self

    @model_validator(mode="after")
    def _planner_knows_the_jerk(self) -> Machine:
        if self.shaping.planner == "optimal" and self.controller.kind == "fanuc":
            missing = [f"axes.{a}.max_jerk_mm_s3" for a in "xyz" if getattr(self.axes, a).max_jerk_mm_s3 is None]
            if missing:
                limit = f'needs {", ".join(missing)}: set the largest jerk of each axis, or use "look-ahead"'
                raise KeyProblem("shaping.planner", "optimal", limit)
        return self

    _remarks: dict[str, str] = PrivateAttr(default_factory=dict)
    _origins_in_comments: bool = PrivateAttr(default=False)

    def __eq__(self, other: object) -> bool:
        """True if the values are the same; origins are not compared."""
        return self.__dict__ == other.__dict__ if isinstance(other, Machine) else NotImplemented

    def __hash__(self) -> int:
        """Hash of the name: equal machines have the same one."""
        return hash(self.name)

    @property
    def remarks(self) -> Mapping[str, str]:
        """Provenance of the values in the file, by dotted key."""
        return self._remarks

    @property
    def origin_warning(self) -> str:
        """Hint for an older file with origins in comments; empty for others."""
        if not self._origins_in_comments:
            return ""
        return (
            "the origins of its values are read from comments, as in files before [origin]: "
            "shapegcode machine show FILE --write-origins writes it as a table"
        )

    def all_remarks(self) -> dict[str, str]:
        """The remarks, with one for every default that has a value, so that a written default keeps its origin.

        Returns:
            By dotted key, for keys of the machine.
        """
        held = self.values()
        remarks = {value.key: value.remark for value in held if value.remark}
        for value in held:
            if value.origin == "default" and value.value not in ("not set", "[]", "{}"):
                remarks[value.key] = f"assumed: {DEFAULT}" if value.assumed else DEFAULT
        return remarks

    def with_remarks(self, remarks: Mapping[str, str]) -> Machine:
        """Copy the machine with other provenance of its values.

        Args:
            remarks: by dotted key; those of other keys are kept; see `shapegcode.settings.keys` for their form.

        Returns:
            A new machine; this one is unchanged.
        """
        copy = self.model_copy()
        copy._remarks = {**self._remarks, **remarks}
        return copy

    @property
    def bears_override(self) -> bool:
        """True if emitted blocks are override-tolerant: emission.override any, or ask with verdict.override_percent."""
        stated = self.verdict.override_percent != (100.0, 100.0)
        return self.emission.override == "any" or (self.emission.override == "ask" and stated)

    @property
    def dial_positions(self) -> tuple[float, ...]:
        """Feed overrides to be tolerated: limits of [verdict] (if both are 100 %: .7, 1.2), multiples of .1 between."""
        low, high = self.verdict.override_percent
        if low == high == 100.0:
            low, high = _USUAL_DIAL_PERCENT
        steps = {10.0 * step for step in range(math.ceil(low / 10.0), math.floor(high / 10.0) + 1)}
        return tuple(percent / 100.0 for percent in sorted({low, *steps, high}))

    @classmethod
    def load(cls, path_or_name: str | Path) -> Machine:
        """Load a machine file, or a built-in machine by its name.

        The name of a built-in machine, a string without folder or ``.toml``, stands for that machine; everything else
        is a path.

        Args:
            path_or_name: the file, or the name.

        Returns:
            The machine with its defaults.

        Raises:
            MachineError: the file is not TOML or has wrong keys or values; every problem is listed. Also for a name
                without folder and suffix that is neither a file nor a built-in machine.
            OSError: the file cannot be read.
        """
        if isinstance(path_or_name, str) and path_or_name in cls.builtin_names():
            return cls.from_toml(cls.builtin_text(path_or_name), path_or_name)
        path = Path(path_or_name)
        if not path.suffix and path.name == str(path_or_name) and not path.exists():
            limit = f"no such file and no built-in machine; built in: {', '.join(cls.builtin_names())}"
            raise MachineError(str(path), (Problem("", "", limit),))
        return cls.from_toml(read_text(path, MachineError), str(path))

    @classmethod
    def of(cls, machine: Machine | str | Path) -> Machine:
        """Return a machine unchanged, or load it from its file or by its built-in name.

        Args:
            machine: the machine, its file or its name.

        Returns:
            The machine.

        Raises:
            ArgumentError: it is none of these.
            MachineError, OSError: as `load` does.
        """
        if isinstance(machine, cls):
            return machine
        if not isinstance(machine, str | Path):
            raise ArgumentError(f"machine: must be a Machine, a file or a built-in name, not {type(machine).__name__}")
        if isinstance(machine, str) and "\n" in machine:
            raise ArgumentError("machine: must be a Machine, a file or a built-in name, not the text of a program")
        return cls.load(machine)

    @classmethod
    def simple(
        cls,
        modes: Mapping[str, float | Mode | Sequence[float | Mode]],
        *,
        name: str = "simple",
        max_feed_mm_per_min: float | None = None,
        rapid_mm_per_min: float | None = None,
        max_acceleration_mm_per_s2: float | None = None,
    ) -> Machine:
        """Make a machine from its modes and limits common to all axes.

        Everything else is a default of the machine file.

        Args:
            modes: by axis ("x", "y", "z"): natural frequencies in Hz (damping ratio 0.02 assumed) or modes, also
                those that `identify` found, one or several; an axis without an entry is simulated as rigid.
            name: of the machine.
            max_feed_mm_per_min: largest cutting feed of an axis, mm/min; None: 12 000 is assumed.
            rapid_mm_per_min: rapid traverse of an axis, mm/min; None: 24 000 is assumed.
            max_acceleration_mm_per_s2: largest acceleration while cutting, mm/s²; None: 3000 is assumed.

        Returns:
            The machine; `with_values` changes keys, `to_toml` returns its file.

        Raises:
            ArgumentError: an axis other than x, y, z; a frequency below 0.1 Hz, such as a damping ratio.
            MachineError: a value that is invalid in a machine file.
        """
        if unknown := set(modes) - set("xyz"):
            raise ArgumentError(f"modes: {min(unknown)!r} is not an axis: x, y, z are")
        stated = {
            "max_feed_mm_per_min": max_feed_mm_per_min,
            "rapid_mm_per_min": rapid_mm_per_min,
            "max_acceleration_mm_s2": max_acceleration_mm_per_s2,
        }
        assumed = {name: value for name, value in _SIMPLE_LIMITS.items() if stated[name] is None}
        limits = {**stated, **assumed}
        axes = {}
        for axis in "xyz":
            given = modes.get(axis, ())
            several = given if isinstance(given, Sequence) else [given]
            if any(isinstance(each, int | float) and 0.0 < each < _LOWEST_HZ for each in several):
                raise ArgumentError(f"modes of {axis}: {given}: a frequency with a damping ratio is Mode(46, 0.02)")
            axes[axis] = {**limits, "modes": [_table_of(mode) for mode in several]}
        machine = validated(cls, {"name": name, "axes": axes}, "Machine.simple", "", MachineError)
        return machine.with_remarks({f"axes.{axis}.{limit}": "assumed" for axis in "xyz" for limit in assumed})

    @classmethod
    def from_toml(cls, text: str, source: str = "<text>") -> Machine:
        """Read the text of a machine file.

        Args:
            text: TOML.
            source: its name in messages.

        Returns:
            The machine with its defaults.

        Raises:
            MachineError: not TOML, or wrong keys or values; every problem is listed.
        """
        return cls.from_data(parsed(text, source, MachineError), source, text)

    @classmethod
    def from_data(cls, data: dict[str, Any], source: str = "<data>", text: str = "") -> Machine:
        """Validate the tables of a machine file.

        Args:
            data: tables of the file, as parsed from TOML.
            source: their name in messages.
            text: the file, for line numbers and origins in comments.

        Returns:
            The machine with its defaults.

        Raises:
            MachineError: wrong keys or values; every problem is listed.
        """
        plain, stated = take_origins(data)
        machine = validated(cls, plain, source, text, MachineError)
        if stated is None:
            machine._remarks = remarks_in_comments(text)
            machine._origins_in_comments = any(origin_of(origin) != "file" for origin in machine._remarks.values())
            return machine
        keys = {value.key: value.value for value in machine.values()}
        wrong = [(key, origin, limit) for key, origin in stated.items() if (limit := _wrong_origin(key, origin, keys))]
        if wrong:
            problems = (
                Problem(f"origin.{key}", toml(origin), limit, line_of(f"origin.{key}", text) or line_of(key, text))
                for key, origin, limit in wrong[:MAX_PROBLEMS]
            )
            raise MachineError(source, (*problems, *further_problems(len(wrong))))
        machine._remarks = {key: remark_of(origin) for key, origin in stated.items()}
        return machine

    @staticmethod
    def builtin_names() -> tuple[str, ...]:
        """Names of the machines that come with shapegcode, sorted."""
        names = (entry.name for entry in (resources.files("shapegcode") / "data").iterdir())
        return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))

    @classmethod
    def builtin_text(cls, name: str) -> str:
        """Text of a built-in machine's file, with its comments.

        Args:
            name: one of `builtin_names`.

        Returns:
            The unchanged file.

        Raises:
            MachineError: no built-in machine of that name.
        """
        names = cls.builtin_names()
        if name not in names:
            raise MachineError(name, (Problem("", "", f"no built-in machine; built in: {', '.join(names)}"),))
        return (resources.files("shapegcode") / "data" / f"{name}.toml").read_text(encoding="utf-8")

    def to_toml(self, remarks: Mapping[str, str] | None = None, *, short: bool = False) -> str:
        """Write the machine as a commented machine file, which loads as an equal machine with the same origins.

        Args:
            remarks: origin of a value by dotted key (modes count from 1: ``axes.x.modes.1.frequency_hz``), written
                after the key and into [origin]; each replaces the machine's own.
            short: leave out defaults and the descriptions of keys.

        Returns:
            The text of the file.

        Raises:
            KeyError: a remark for a key that does not exist, unless `short`.
            ArgumentError: a file name: the text is returned.
        """
        if isinstance(remarks, str | Path):
            raise ArgumentError(f"to_toml returns the text: Path({str(remarks)!r}).write_text(machine.to_toml())")
        from shapegcode.settings.describe import write_toml

        if short:
            held = {value.key: value.remark for value in self.values() if value.remark}
            return write_toml(self, held | dict(remarks or {}), short=True)
        return write_toml(self, self.all_remarks() | dict(remarks or {}))

    @overload
    def with_values(self, key: str, value: object, /, *, source: str = "") -> Machine: ...
    @overload
    def with_values(self, values: Mapping[str, object], /, *, source: str = "") -> Machine: ...
    def with_values(self, key: str | Mapping[str, object], value: object = None, /, *, source: str = "") -> Machine:
        """Copy the machine with other values for some keys, checked as in a machine file.

        >>> machine.with_values("tolerance.contour_um", 5)
        >>> machine.with_values({"shaping.family": "zvd", "axes.x.modes.1.frequency_hz": 44.5})

        Args:
            key: dotted name of a key (modes count from 1, as `shapegcode machine show` prints them), or values by key.
            value: of the key, in its unit; None deletes the key, so that its default applies.
            source: names the machine in messages; default: its name.

        Returns:
            A new machine; this one is unchanged.

        Raises:
            MachineError: no such key, or a value that is invalid in a machine file; every problem is listed.
        """
        values = {key: value} if isinstance(key, str) else key
        changed = with_values(self, values, source or self.name, MachineError)
        below = tuple(f"{name}." for name in values)
        changed._remarks = {
            name: remark for name, remark in self._remarks.items() if name not in values and not name.startswith(below)
        }
        return changed

    def values(self) -> list[KeyValue]:
        """Every key with its value and origin, in the order of the file."""
        return list(values_of(self, remarks=self._remarks))


def _wrong_origin(key: str, origin: object, keys: Mapping[str, str]) -> str:
    """Rule that an origin violates; empty if it is valid."""
    if key not in keys and not any(key.startswith(f"{each}.") and keys[each].startswith("{") for each in keys):
        return "no such key of this machine (modes count from 1): delete the line"
    if isinstance(origin, str) and re.match(ORIGIN_TEXT, origin):
        return ""
    if isinstance(origin, list):
        return "must be one: this value has two, in [origin] and next to it, or in two spellings of its key"
    return (
        "must be measured, parameters (of the control), inherited, assumed, choice, default or stated; a note may "
        'follow: "measured: tap of 3 May"'
    )


_OF_A_MACHINE = ("axes.", "controller.", "times.", "power_on.", "feed_control.")


def inherited_text(name: str) -> str:
    """A built-in machine's file as a template: values of the machine that are not assumed become inherited."""
    from shapegcode.settings.edit import with_remarks

    text = Machine.builtin_text(name)
    whose = Machine.load(name).name

    def remark(key: str, remark: str) -> str:
        return inherited(whose, remark) if remark and key.startswith(_OF_A_MACHINE) else remark

    return with_remarks(text, remark)


def _table_of(given: float | Mode | tuple[float, float]) -> dict[str, float | dict[str, float]]:
    mode: float | Mode = as_mode(given)
    if not isinstance(mode, Mode):
        return {"frequency_hz": mode, "damping_ratio": _ASSUMED_DAMPING_RATIO}
    directions = {"excited_by": dict(zip("xyz", mode.excited_by, strict=True))} if any(mode.excited_by) else {}
    return {
        "frequency_hz": mode.frequency_hz,
        "damping_ratio": mode.damping_ratio,
        "participation": mode.participation,
        **directions,
    }
