"""The machine file: what shapegcode knows about a machine tool and its controller.

A machine file is TOML. :class:`Machine` is its model; it and its tables, one file each, are the only place that holds
defaults for it: every other module takes the values from here. Each key carries its unit, its meaning and, where the
number is not known for real machines, the remark *assumed*; :func:`key_documentation` turns that into
``docs/machine.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, overload

from pydantic import Field, Strict, model_validator

from shapegcode.errors import MachineError, Problem
from shapegcode.machine.axes import Axes, Axis, AxisMode
from shapegcode.machine.controller import Controller, PowerOn, Times
from shapegcode.machine.drive import Drive
from shapegcode.machine.feed import FeedControl
from shapegcode.machine.input import Input
from shapegcode.machine.output import Emission, Shaping, Tolerance, Verdict
from shapegcode.settings import change
from shapegcode.settings.describe import documentation, values_of, write_toml
from shapegcode.settings.keys import KeyInfo, KeyValue, PerAxis, Text, TomlTable, key, toml
from shapegcode.settings.load import parsed, read_text, validated
from shapegcode.settings.problems import KeyProblem

__all__ = [
    "Axes",
    "Axis",
    "AxisMode",
    "Controller",
    "Drive",
    "Emission",
    "FeedControl",
    "Input",
    "KeyInfo",
    "KeyValue",
    "Machine",
    "PerAxis",
    "PowerOn",
    "Shaping",
    "Times",
    "Tolerance",
    "Verdict",
    "key_documentation",
]


class Machine(TomlTable):
    """A machine tool and its controller, as a machine file describes them."""

    name: Annotated[str, Strict(), Field(min_length=1, max_length=60, pattern=r"^[\x20-\x7e]+$")] = key(
        "short name, in plain ASCII because it goes into the header of programs"
    )
    description: Text = key("what machine this is and where its numbers come from", default="")
    axes: Axes = key("limits and vibration modes of the axes")
    controller: Controller = key("how the controller moves the axes and what it accepts", default={})
    times: Times = key("what takes time beside the motion", default={})
    power_on: PowerOn = key("modal state before the first block", default={})
    input: Input = key("how programs are read", default={})
    feed_control: FeedControl = key("how the controller follows changes of the feed", default={})
    emission: Emission = key("how shaped programs are written", default={})
    shaping: Shaping = key("what is shaped, and how", default={})
    tolerance: Tolerance = key("when an emitted program is good", default={})
    verdict: Verdict = key("under which conditions it must be good", default={})

    @model_validator(mode="after")
    def _block_period_fits(self) -> Machine:
        period = self.emission.block_period_s
        if period is None:
            return self
        tick = self.controller.interpolation_period_s
        ratio = period / tick
        if round(ratio) < 1 or not math.isclose(ratio, round(ratio), rel_tol=0, abs_tol=1e-6):
            raise KeyProblem(
                "emission.block_period_s",
                period,
                f"must be a whole multiple of controller.interpolation_period_s = {toml(tick)}",
            )
        shortest = self.controller.block_time_s
        if period < shortest * (1 - 1e-9):
            raise KeyProblem(
                "emission.block_period_s", period, f"must not be below controller.block_time_s = {toml(shortest)}"
            )
        return self

    @classmethod
    def load(cls, path_or_name: str | Path) -> Machine:
        """Load a machine file, or a built-in machine by its name.

        A string without a folder and without ``.toml`` that names a built-in machine is that machine;
        everything else is a path.

        Args:
            path_or_name: the file, or the name.

        Returns:
            The machine, its defaults filled in.

        Raises:
            MachineError: the file is not TOML or has wrong keys or values; every problem is listed.
            OSError: the file cannot be read.
        """
        if isinstance(path_or_name, str) and path_or_name in cls.builtin_names():
            return cls.from_toml(cls.builtin_text(path_or_name), path_or_name)
        path = Path(path_or_name)
        if not path.suffix and path.name == str(path_or_name) and not path.exists():
            names = ", ".join(cls.builtin_names())
            problem = Problem("", "", f"no such file and no built-in machine; built in: {names}")
            raise MachineError(str(path), (problem,))
        return cls.from_toml(read_text(path, MachineError), str(path))

    @classmethod
    def from_toml(cls, text: str, source: str = "<text>") -> Machine:
        """Read the text of a machine file; *source* names it in messages.

        Args:
            text: TOML.
            source: its name in messages.

        Returns:
            The machine, its defaults filled in.

        Raises:
            MachineError: not TOML, or wrong keys or values; every problem is listed.
        """
        return cls.from_data(parsed(text, source, MachineError), source, text)

    @classmethod
    def from_data(cls, data: dict[str, Any], source: str = "<data>", text: str = "") -> Machine:
        """Validate the tables of a machine file; *source* names it in messages, *text* gives them line numbers.

        Args:
            data: tables of the file, as TOML gives them.
            source: their name in messages.
            text: the file, for line numbers.

        Returns:
            The machine, its defaults filled in.

        Raises:
            MachineError: wrong keys or values; every problem is listed.
        """
        return validated(cls, data, source, text, MachineError)

    @staticmethod
    def builtin_names() -> tuple[str, ...]:
        """Names of the machines that come with shapegcode, sorted."""
        folder = resources.files("shapegcode") / "data"
        return tuple(
            sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))
        )

    @classmethod
    def builtin_text(cls, name: str) -> str:
        """Text of a built-in machine's file, with its comments.

        Args:
            name: one of `builtin_names`.

        Returns:
            The file, word for word.

        Raises:
            MachineError: no built-in machine of that name.
        """
        names = cls.builtin_names()
        if name not in names:
            raise MachineError(name, (Problem("", "", f"no built-in machine; built in: {', '.join(names)}"),))
        return (resources.files("shapegcode") / "data" / f"{name}.toml").read_text(encoding="utf-8")

    def to_toml(self, remarks: Mapping[str, str] | None = None) -> str:
        """The machine as a commented machine file, which loads back to an equal machine.

        Args:
            remarks: text for the end of a key's line by its dotted key (modes count from 1:
                ``axes.x.modes.1.frequency_hz``), for example where the value comes from.

        Returns:
            The text of the file.

        Raises:
            KeyError: a remark for a key that does not exist.
        """
        return write_toml(self, remarks or {})

    @overload
    def with_values(self, key: str, value: object, /, *, source: str = "") -> Machine: ...
    @overload
    def with_values(self, values: Mapping[str, object], /, *, source: str = "") -> Machine: ...
    def with_values(self, key: str | Mapping[str, object], value: object = None, /, *, source: str = "") -> Machine:
        """The machine with other values for some keys, checked as those of a machine file are.

        >>> machine.with_values("tolerance.contour_um", 5)
        >>> machine.with_values({"shaping.family": "zvd", "axes.x.modes.1.frequency_hz": 44.5})

        Args:
            key: dotted name of a key (modes count from 1, as `shapegcode machine show` prints them), or values by key.
            value: of the key, in its unit; None takes the key out, so that its default holds.
            source: names the machine in messages; its name where this is left out.

        Returns:
            A new machine; this one stays as it is.

        Raises:
            MachineError: no such key, or a value that a machine file could not have; every problem is listed.
        """
        values = {key: value} if isinstance(key, str) else key
        return change.with_values(self, values, source or self.name, MachineError)

    def values(self) -> list[KeyValue]:
        """Every key with its value and origin, in the order of the file."""
        return list(values_of(self))


def key_documentation() -> str:
    """The reference of the machine file's keys as Markdown: what ``docs/machine.md`` holds, word for word.

    Returns:
        The page; ``make docs`` writes it.
    """
    return documentation(Machine, Machine.builtin_names())
