"""The tool file: an end mill, the forces that it needs, the limits that it must keep and how its feed may be set.

A tool file is TOML. :class:`Tool` is its model; it and its tables are the only place that holds defaults for it.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, Strict, model_validator

from shapegcode import _core
from shapegcode.cutting.materials import Cutting, Name
from shapegcode.errors import ToolError
from shapegcode.settings.keys import Float, NonNegative, Positive, TomlTable, key, toml
from shapegcode.settings.load import loaded, parsed, validated
from shapegcode.settings.problems import KeyProblem


class Cutter(TomlTable):
    """The end mill: flat end, cylindrical."""

    name: Name = key("short name, in plain ASCII because it goes into comments of programs")
    number: Annotated[int, Strict(), Field(ge=0, le=99_999_999)] | None = key(
        "T number; blocks that run with another tool are left as they are. Left out: the file speaks of every tool "
        "of the program",
        default=None,
    )
    diameter_mm: Positive = key("diameter of the fluted part", unit="mm")
    flutes: Annotated[int, Strict(), Field(ge=1, le=100)] = key("number of flutes")
    helix_deg: Annotated[NonNegative, Field(le=80)] = key(
        "helix angle of a right-hand helix on a right-hand cutter; 0: straight flutes", unit="degrees"
    )
    flute_length_mm: Positive = key("length of the fluted part from the tip", unit="mm")
    overhang_mm: Positive = key(
        "effective length: from the tip to where the tool may be taken as clamped in its holder", unit="mm"
    )
    shank_diameter_mm: Positive | None = key(
        "diameter of the shank above the flutes; left out: diameter_mm", unit="mm", default=None
    )
    effective_diameter_ratio: Annotated[Positive, Field(le=1)] = key(
        "diameter of the solid cylinder that bends as the fluted part does, as a share of diameter_mm",
        unit="1",
        default=0.8,
        assumed=True,
    )
    youngs_modulus_gpa: Positive = key(
        "Young's modulus: about 600 for cemented carbide, 210 for high-speed steel",
        unit="GPa",
        default=600.0,
        assumed=True,
    )
    holder_stiffness_n_per_um: Positive | None = key(
        "stiffness of holder and spindle against a force across the axis where the tool is clamped; left out: rigid",
        unit="N/µm",
        default=None,
    )
    runout_um: tuple[Float, ...] | None = key(
        "how far each flute stands out beyond the mean radius, one number per flute in the order in which they cut; "
        "left out: none",
        unit="µm",
        default=None,
    )
    spindle: Literal["clockwise", "counter_clockwise"] | None = key(
        'sense in which the spindle turns, "clockwise" (M03) or "counter_clockwise" (M04); left out: as the program '
        "says, clockwise where it does not",
        default=None,
    )

    @model_validator(mode="after")
    def _fits(self) -> Cutter:
        if self.flute_length_mm > self.overhang_mm:
            raise KeyProblem(
                "flute_length_mm", self.flute_length_mm, f"must not exceed overhang_mm = {toml(self.overhang_mm)}"
            )
        if self.runout_um is not None:
            if len(self.runout_um) != self.flutes:
                raise KeyProblem(
                    "runout_um",
                    self.runout_um,
                    f"has {len(self.runout_um)} values: must have one per flute, flutes = {self.flutes}",
                )
            largest = max(abs(value) for value in self.runout_um)
            if largest >= 500 * self.diameter_mm:
                raise KeyProblem(
                    "runout_um", self.runout_um, f"must stay below the radius, {toml(500 * self.diameter_mm)} µm"
                )
        return self


class Limits(TomlTable):
    """What must not be exceeded; a limit that is left out does not act."""

    resultant_n: Positive | None = key("resultant of the force in the XY plane", unit="N", default=None)
    resultant: Literal["peak", "mean"] = key(
        'what resultant_n limits: the "peak" of the resultant over one revolution or its "mean"', default="peak"
    )
    deflection_um: Positive | None = key("peak deflection of the tool at its tip", unit="µm", default=None)
    torque_nm: Positive | None = key("peak torque about the axis of the tool", unit="N m", default=None)
    power_w: Positive | None = key("mean power of the cut", unit="W", default=None)
    feed_per_tooth_min_mm: Positive | None = key(
        "least feed per tooth: below it the edge rubs. Left out: no feed goes below a tenth of the programmed one",
        unit="mm",
        default=None,
    )
    feed_per_tooth_max_mm: Positive | None = key("largest feed per tooth", unit="mm", default=None)

    @model_validator(mode="after")
    def _band_ascends(self) -> Limits:
        low, high = self.feed_per_tooth_min_mm, self.feed_per_tooth_max_mm
        if low is not None and high is not None and low >= high:
            raise KeyProblem("feed_per_tooth_min_mm", low, f"must be less than feed_per_tooth_max_mm = {toml(high)}")
        return self


class Feed(TomlTable):
    """How the feed may be set."""

    air_feed_mm_per_min: Positive | None = key(
        "feed where the tool meets no material; left out: as programmed", unit="mm/min", default=None
    )
    approach_mm: NonNegative = key(
        "distance before the tool meets material at which the feed is that of the cut again",
        unit="mm",
        default=1.0,
        assumed=True,
    )
    max_feed_mm_per_min: Positive | None = key(
        "largest feed that is written, in material and in air; left out: as the machine allows",
        unit="mm/min",
        default=None,
    )
    spindle_rev_per_min: Positive | None = key(
        "speed of the spindle where the program gives none (S); left out: the program must", unit="1/min", default=None
    )

    @model_validator(mode="after")
    def _air_feed_fits(self) -> Feed:
        air, most = self.air_feed_mm_per_min, self.max_feed_mm_per_min
        if air is not None and most is not None and air > most:
            raise KeyProblem("air_feed_mm_per_min", air, f"must not exceed max_feed_mm_per_min = {toml(most)}")
        return self


class Tool(TomlTable):
    """An end mill with its cutting force, its limits and its feed, as a tool file describes them."""

    tool: Cutter = key("the end mill: flat end, cylindrical")
    cutting: Cutting = key(
        "the cutting force: a material of the library, values of your own, or a material with some of them changed. "
        "With the chip thickness t in mm, the tangential force per mm of edge is k1 t + K_te and the radial one "
        "k2 k1 t + K_re, where k1 = specific * t^specific_exponent and k2 = ratio * t^ratio_exponent"
    )
    limits: Limits = key("what must not be exceeded; a limit that is left out does not act", default={})
    feed: Feed = key("how the feed may be set", default={})

    @model_validator(mode="after")
    def _least_chip_can_be_reached(self) -> Tool:
        least, most = self.limits.feed_per_tooth_min_mm, self.feed.max_feed_mm_per_min
        speed = self.feed.spindle_rev_per_min
        if least is not None and most is not None and speed is not None:
            needed = least * self.tool.flutes * speed
            if needed > most:
                raise KeyProblem(
                    "limits.feed_per_tooth_min_mm",
                    least,
                    f"asks for a feed of {needed:g} mm/min, feed.max_feed_mm_per_min is {toml(most)}",
                )
        return self

    @classmethod
    def load(cls, path: str | Path) -> Tool:
        """Read a tool file.

        Args:
            path: the file.

        Returns:
            The tool, its defaults filled in.

        Raises:
            ToolError: not TOML, or wrong keys or values; every problem is listed.
            OSError: the file cannot be read.
        """
        return loaded(cls, path, ToolError)

    @classmethod
    def from_toml(cls, text: str, source: str = "<text>") -> Tool:
        """Read the text of a tool file.

        Args:
            text: TOML.
            source: its name in messages.

        Returns:
            The tool, its defaults filled in.

        Raises:
            ToolError: not TOML, or wrong keys or values; every problem is listed.
        """
        return validated(cls, parsed(text, source, ToolError), source, text, ToolError)

    @property
    def radius_mm(self) -> float:
        """Radius of the fluted part, mm."""
        return 0.5 * self.tool.diameter_mm

    def end_mill(self) -> _core.EndMill:
        """The tool as the core takes it."""
        runout = [0.001 * value for value in self.tool.runout_um or ()]
        return _core.EndMill(self.tool.diameter_mm, self.tool.flutes, math.radians(self.tool.helix_deg), runout)

    def sense(self, programmed: _core.SpindleSense | None = None) -> _core.SpindleSense:
        """Sense of the spindle: as the file says, else as *programmed*, else clockwise.

        Args:
            programmed: by M03 or M04; None: not known.

        Returns:
            The sense in which the tool turns.
        """
        match self.tool.spindle:
            case "clockwise":
                return _core.SpindleSense.clockwise
            case "counter_clockwise":
                return _core.SpindleSense.counter_clockwise
            case _:
                return _core.SpindleSense.clockwise if programmed is None else programmed

    def coefficients(self) -> _core.CuttingCoefficients:
        """The cutting force as the core takes it: the file's values, then those of its material."""
        return self.cutting.coefficients()

    def force(
        self, spindle_rev_per_min: float, sense: _core.SpindleSense = _core.SpindleSense.clockwise
    ) -> _core.MillingForce:
        """The model of its cutting force.

        Args:
            spindle_rev_per_min: speed of the spindle, 1/min.
            sense: in which it turns.

        Returns:
            The model, which gives the force in N from the engagement.

        Raises:
            ArgumentError: a speed that is not positive.
        """
        return _core.MillingForce(self.end_mill(), self.coefficients(), spindle_rev_per_min, sense)

    def beam(self) -> _core.ToolBeam:
        """The tool as the beam that bends: shank and fluted part, clamped at the overhang."""
        cutter = self.tool
        return _core.ToolBeam(
            overhang_mm=cutter.overhang_mm,
            fluted_length_mm=cutter.flute_length_mm,
            effective_diameter_mm=cutter.effective_diameter_ratio * cutter.diameter_mm,
            shank_diameter_mm=cutter.shank_diameter_mm or cutter.diameter_mm,
            young_modulus_gpa=cutter.youngs_modulus_gpa,
            holder_n_per_um=cutter.holder_stiffness_n_per_um or math.inf,
        )
