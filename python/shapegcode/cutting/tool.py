"""The tool file: an end mill, its cutting forces, limits and feed settings."""

import difflib
import math
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, Strict, field_validator, model_validator

from shapegcode import _core
from shapegcode.errors import FileError, ToolError
from shapegcode.settings.keys import Float, NonNegative, Positive, Text, TomlTable, key, toml
from shapegcode.settings.load import KeyProblem, loaded, parsed, validated

_LIBRARY = "materials.toml"

COEFFICIENTS = (
    *("specific_n_per_mm2", "specific_exponent", "ratio", "ratio_exponent"),
    *("tangential_edge_n_per_mm", "radial_edge_n_per_mm"),
)
"""Names of the parameters of a force law."""

Exponent = Annotated[Float, Field(gt=-1, lt=1)]
Name = Annotated[str, Strict(), Field(min_length=1, max_length=60, pattern=r"^[!-$&-'*-~]([ !-$&-'*-~]*[!-$&-'*-~])?$")]


class WorkMaterial(TomlTable):
    """A work material with the cutting forces measured with one cutter."""

    name: Annotated[str, Strict(), Field(pattern=r"^[a-z0-9][a-z0-9-]*$")] = key(
        "name in a tool file: lower-case letters, digits and hyphens"
    )
    description: Text = key("material, its state and hardness")
    specific_n_per_mm2: Positive = key("specific cutting force k1 at a chip 1 mm thick")
    specific_exponent: Exponent = key("exponent of the chip thickness in k1")
    ratio: NonNegative = key("ratio k2 of radial to tangential force at a chip 1 mm thick", unit="1")
    ratio_exponent: Exponent = key("exponent of the chip thickness in k2")
    tangential_edge_n_per_mm: NonNegative = key("tangential edge force per edge length")
    radial_edge_n_per_mm: NonNegative = key("radial edge force per edge length")
    chip_thickness: Literal["mean", "local"] = key("chip thickness of the exponents")
    chip_mm: tuple[Positive, Positive] | None = key(
        "range of valid chip thickness; left out: not in the source", default=None
    )
    cutter: Text = key("cutter of the measurement")
    source: Text = key("source of the values")
    assumed: Text = key("assumed values that are not in the source; empty: none")

    @model_validator(mode="after")
    def _range_ascends(self) -> Self:
        if self.chip_mm is not None and self.chip_mm[0] >= self.chip_mm[1]:
            raise KeyProblem("chip_mm", self.chip_mm, "the first number must be smaller than the second")
        return self


class _Library(TomlTable):
    material: tuple[WorkMaterial, ...] = key("the materials")

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        names = [material.name for material in self.material]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"the name {name} occurs {names.count(name)} times")
        return self


@cache
def materials() -> dict[str, WorkMaterial]:
    """Materials of shapegcode's library by name, in file order."""
    text = (resources.files("shapegcode") / "data" / "milling" / _LIBRARY).read_text(encoding="utf-8")
    library = validated(_Library, parsed(text, _LIBRARY, FileError), _LIBRARY, text, FileError)
    return {material.name: material for material in library.material}


class Cutting(TomlTable):
    """The cutting force: a material of the library, values of your own, or a material with some of them changed."""

    material: Text | None = key(
        "name in the library of materials; keys given with it replace its values. Left out: "
        "specific_n_per_mm2 and ratio are needed",
        default=None,
    )
    specific_n_per_mm2: Positive | None = key(
        "specific cutting force k1 at a chip 1 mm thick; for a law of Kienzle kc1.1", default=None
    )
    specific_exponent: Exponent | None = key(
        "exponent of the chip thickness in k1; for a law of Kienzle -mc. Left out without a material: 0", default=None
    )
    ratio: NonNegative | None = key(
        "ratio k2 of radial to tangential force at a chip 1 mm thick", unit="1", default=None
    )
    ratio_exponent: Exponent | None = key(
        "exponent of the chip thickness in k2. Left out without a material: 0", default=None
    )
    tangential_edge_n_per_mm: NonNegative | None = key(
        "tangential edge force per edge length (K_te). Left out without a material: 0", default=None
    )
    radial_edge_n_per_mm: NonNegative | None = key(
        "radial edge force per edge length (K_re). Left out without a material: 0", default=None
    )
    chip_thickness: Literal["mean", "local"] | None = key(
        'chip thickness of the exponents: "mean" of the whole engagement or "local" at each point of an '
        'edge. Left out without a material: "mean"',
        default=None,
    )

    @field_validator("material")
    @classmethod
    def _known(cls, name: str | None) -> str | None:
        if name is not None and name not in materials():
            close = difflib.get_close_matches(name, materials(), n=1, cutoff=0.5)
            hint = f"; did you mean {close[0]}?" if close else ""
            raise ValueError(f"no such material; known are {', '.join(materials())}{hint}")
        return name

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.material is None:
            for name in ("specific_n_per_mm2", "ratio"):
                if getattr(self, name) is None:
                    raise ValueError(f"needs material, or both specific_n_per_mm2 and ratio: {name} is missing")
        exponent = self._value("specific_exponent") + self._value("ratio_exponent")
        if exponent <= -1:
            raise ValueError(
                f"specific_exponent + ratio_exponent = {toml(exponent)}: must be greater than -1, or the radial force "
                "would not increase with the chip"
            )
        return self

    def library_entry(self) -> WorkMaterial | None:
        """Material of the library, None without one."""
        return None if self.material is None else materials()[self.material]

    def coefficients(self) -> _core.CuttingCoefficients:
        """Coefficients in the form that `_core` takes."""
        entry = self.library_entry()
        thickness = self.chip_thickness or ("mean" if entry is None else entry.chip_thickness)
        values = {name: self._value(name) for name in COEFFICIENTS}
        return _core.CuttingCoefficients(**values, thickness=_core.ChipThickness.__members__[thickness])

    def _value(self, name: str) -> float:
        own, entry = getattr(self, name), self.library_entry()
        return float(own if own is not None else 0.0 if entry is None else getattr(entry, name))


class Cutter(TomlTable):
    """The end mill: flat end, cylindrical."""

    name: Name = key("short name, in plain ASCII because it goes into comments of programs")
    number: Annotated[int, Strict(), Field(ge=0, le=99_999_999)] | None = key(
        "T number; blocks with another tool are left unchanged. Left out: the file is for every tool of the program",
        default=None,
    )
    diameter_mm: Positive = key("diameter of the fluted part")
    flutes: Annotated[int, Strict(), Field(ge=1, le=100)] = key("number of flutes")
    helix_deg: Annotated[NonNegative, Field(le=80)] = key(
        "helix angle of a right-hand helix on a right-hand cutter; 0: straight flutes"
    )
    flute_length_mm: Positive = key("length of the fluted part from the tip")
    overhang_mm: Positive = key("effective length: from the tip to where the tool counts as clamped in its holder")
    shank_diameter_mm: Positive | None = key(
        "diameter of the shank above the flutes; left out: diameter_mm", default=None
    )
    effective_diameter_ratio: Annotated[Positive, Field(le=1)] = key(
        "diameter of a solid cylinder with the bending stiffness of the fluted part, relative to diameter_mm",
        assumed=0.8,
    )
    youngs_modulus_gpa: Positive = key(
        "Young's modulus: about 600 for cemented carbide, 210 for high-speed steel", assumed=600.0
    )
    holder_stiffness_n_per_um: Positive | None = key(
        "radial stiffness of holder and spindle where the tool is clamped; left out: rigid",
        default=None,
    )
    runout_um: tuple[Float, ...] | None = key(
        "radial runout: radius of each flute minus the mean radius, one number per flute in cutting order; "
        "left out: none",
        default=None,
    )
    spindle: Literal["clockwise", "counter_clockwise"] | None = key(
        'sense of rotation of the spindle, "clockwise" (M03) or "counter_clockwise" (M04); left out: as programmed '
        "(M03, M04), else clockwise",
        default=None,
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.flute_length_mm > self.overhang_mm:
            limit = f"must not exceed overhang_mm = {toml(self.overhang_mm)}"
            raise KeyProblem("flute_length_mm", self.flute_length_mm, limit)
        runout = self.runout_um
        if runout is not None and len(runout) != self.flutes:
            limit = f"has {len(runout)} values: must have one per flute, flutes = {self.flutes}"
            raise KeyProblem("runout_um", runout, limit)
        if runout is not None and max(map(abs, runout)) >= 500 * self.diameter_mm:
            raise KeyProblem("runout_um", runout, f"must stay below the radius, {toml(500 * self.diameter_mm)} µm")
        return self


class Limits(TomlTable):
    """Limits of the cut; a maximum that is left out is not applied."""

    resultant_n: Positive | None = key("resultant of the force in the XY plane", default=None)
    resultant: Literal["peak", "mean"] = key(
        'resultant limited by resultant_n: the "peak" over one revolution or the "mean"', default="peak"
    )
    deflection_um: Positive | None = key("peak deflection of the tool at its tip", default=None)
    torque_nm: Positive | None = key("peak torque about the axis of the tool", default=None)
    power_w: Positive | None = key("mean power of the cut", default=None)
    feed_per_tooth_min_mm: Positive | None = key(
        "least feed per tooth: below it the edge rubs. Left out: no feed is below a tenth of the programmed one",
        default=None,
    )
    feed_per_tooth_max_mm: Positive | None = key("largest feed per tooth", default=None)

    @model_validator(mode="after")
    def _band_ascends(self) -> Self:
        low, high = self.feed_per_tooth_min_mm, self.feed_per_tooth_max_mm
        if low is not None and high is not None and low >= high:
            raise KeyProblem("feed_per_tooth_min_mm", low, f"must be less than feed_per_tooth_max_mm = {toml(high)}")
        return self


class Feed(TomlTable):
    """Feed in air, largest feed, and the spindle speed of a program without one."""

    air_feed_mm_per_min: Positive | None = key("feed in air; left out: as programmed", default=None)
    approach_mm: NonNegative = key("distance before material at which the feed is that of the cut again", assumed=1.0)
    max_feed_mm_per_min: Positive | None = key(
        "largest feed written, in material and in air; left out: the machine's", default=None
    )
    spindle_rev_per_min: Positive | None = key(
        "spindle speed if the program has none (S); left out: the program must have one", unit="1/min", default=None
    )

    @model_validator(mode="after")
    def _air_feed_fits(self) -> Self:
        air, most = self.air_feed_mm_per_min, self.max_feed_mm_per_min
        if air is not None and most is not None and air > most:
            raise KeyProblem("air_feed_mm_per_min", air, f"must not exceed max_feed_mm_per_min = {toml(most)}")
        return self


class Tool(TomlTable):
    """An end mill with its cutting force, its limits and its feed, from a tool file."""

    tool: Cutter = key("the end mill: flat end, cylindrical")
    cutting: Cutting = key(
        "the cutting force: a material of the library, values of your own, or a material with some of them changed. "
        "With the chip thickness t in mm, the tangential force per mm of edge is k1 t + K_te and the radial one "
        "k2 k1 t + K_re, where k1 = specific * t^specific_exponent and k2 = ratio * t^ratio_exponent"
    )
    limits: Limits = key("limits of the cut; a limit that is left out is not applied", default={})
    feed: Feed = key("range of the feed", default={})

    @model_validator(mode="after")
    def _least_chip_can_be_reached(self) -> Self:
        least, most = self.limits.feed_per_tooth_min_mm, self.feed.max_feed_mm_per_min
        speed = self.feed.spindle_rev_per_min
        if least is not None and most is not None and speed is not None:
            needed = least * self.tool.flutes * speed
            if needed > most:
                limit = f"needs a feed of {needed:g} mm/min, but feed.max_feed_mm_per_min is {toml(most)}"
                raise KeyProblem("limits.feed_per_tooth_min_mm", least, limit)
        return self

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a tool file.

        Args:
            path: the file.

        Returns:
            The tool, with defaults.

        Raises:
            ToolError: not TOML, or wrong keys or values; every problem is listed.
            OSError: the file cannot be read.
        """
        return loaded(cls, path, ToolError)

    @classmethod
    def from_toml(cls, text: str, source: str = "<text>") -> Self:
        """Read the text of a tool file.

        Args:
            text: TOML.
            source: its name in messages.

        Returns:
            The tool, with defaults.

        Raises:
            ToolError: not TOML, or wrong keys or values; every problem is listed.
        """
        return validated(cls, parsed(text, source, ToolError), source, text, ToolError)

    @property
    def radius_mm(self) -> float:
        """Radius of the fluted part, mm."""
        return 0.5 * self.tool.diameter_mm

    def end_mill(self) -> _core.EndMill:
        """End mill of the core."""
        runout = [0.001 * value for value in self.tool.runout_um or ()]
        return _core.EndMill(self.tool.diameter_mm, self.tool.flutes, math.radians(self.tool.helix_deg), runout)

    def sense(self, programmed: _core.SpindleSense | None = None) -> _core.SpindleSense:
        """Sense of rotation: from the file, else as *programmed*, else clockwise.

        Args:
            programmed: by M03 or M04; None: unknown.

        Returns:
            The sense of rotation.
        """
        if self.tool.spindle is not None:
            return _core.SpindleSense.__members__[self.tool.spindle]
        return _core.SpindleSense.clockwise if programmed is None else programmed

    def coefficients(self) -> _core.CuttingCoefficients:
        """Cutting-force coefficients for the core: from the tool file; those missing there are of the work material."""
        return self.cutting.coefficients()

    def force(
        self, spindle_rev_per_min: float, sense: _core.SpindleSense = _core.SpindleSense.clockwise
    ) -> _core.MillingForce:
        """Model of the tool's cutting force.

        Args:
            spindle_rev_per_min: speed of the spindle, 1/min.
            sense: sense of rotation.

        Returns:
            The model, which computes the force in N from the engagement.

        Raises:
            ArgumentError: a speed that is not positive.
        """
        return _core.MillingForce(self.end_mill(), self.coefficients(), spindle_rev_per_min, sense)

    def beam(self) -> _core.ToolBeam:
        """Beam model of the tool: shank and fluted part, clamped at the overhang."""
        cutter = self.tool
        return _core.ToolBeam(
            overhang_mm=cutter.overhang_mm,
            fluted_length_mm=cutter.flute_length_mm,
            effective_diameter_mm=cutter.effective_diameter_ratio * cutter.diameter_mm,
            shank_diameter_mm=cutter.shank_diameter_mm or cutter.diameter_mm,
            young_modulus_gpa=cutter.youngs_modulus_gpa,
            holder_n_per_um=cutter.holder_stiffness_n_per_um or math.inf,
        )
