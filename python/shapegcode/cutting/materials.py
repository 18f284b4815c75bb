"""Cutting forces: power laws over the chip thickness, the library of work materials, the table [cutting] of a tool."""

from __future__ import annotations

import difflib
from functools import cache
from importlib import resources
from typing import Annotated, Literal

from pydantic import Field, Strict, field_validator, model_validator

from shapegcode import _core
from shapegcode.errors import FileError
from shapegcode.settings.keys import Float, NonNegative, Positive, Text, TomlTable, key, toml
from shapegcode.settings.load import parsed, validated
from shapegcode.settings.problems import KeyProblem

_LIBRARY = "materials.toml"

Exponent = Annotated[Float, Field(gt=-1, lt=1)]
Name = Annotated[str, Strict(), Field(min_length=1, max_length=60, pattern=r"^[!-$&-'*-~]([ !-$&-'*-~]*[!-$&-'*-~])?$")]


class WorkMaterial(TomlTable):
    """A work material with the forces that one cutter was measured to need in it."""

    name: Annotated[str, Strict(), Field(pattern=r"^[a-z0-9][a-z0-9-]*$")] = key(
        "name by which a tool file chooses it: small letters, digits and hyphens"
    )
    description: Text = key("material, its state and hardness")
    specific_n_per_mm2: Positive = key("specific cutting force k1 at a chip 1 mm thick", unit="N/mm²")
    specific_exponent: Exponent = key("exponent of the chip thickness in k1", unit="1")
    ratio: NonNegative = key("ratio k2 of radial to tangential force at a chip 1 mm thick", unit="1")
    ratio_exponent: Exponent = key("exponent of the chip thickness in k2", unit="1")
    tangential_edge_n_per_mm: NonNegative = key("tangential force of the edge per length of it", unit="N/mm")
    radial_edge_n_per_mm: NonNegative = key("radial force of the edge per length of it", unit="N/mm")
    chip_thickness: Literal["mean", "local"] = key("which chip thickness the exponents belong to")
    chip_mm: tuple[Positive, Positive] | None = key(
        "chip thickness from ... to for which this holds; left out: the source does not say", unit="mm", default=None
    )
    cutter: Text = key("what cut it")
    source: Text = key("where the values come from")
    assumed: Text = key("what the source does not say and is assumed here; empty: nothing")

    @model_validator(mode="after")
    def _range_ascends(self) -> WorkMaterial:
        if self.chip_mm is not None and self.chip_mm[0] >= self.chip_mm[1]:
            raise KeyProblem("chip_mm", self.chip_mm, "the lower end comes first")
        return self


class _Library(TomlTable):
    """The materials that come with shapegcode."""

    material: tuple[WorkMaterial, ...] = key("the materials")

    @model_validator(mode="after")
    def _names_differ(self) -> _Library:
        names = [material.name for material in self.material]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"the name {name} stands {names.count(name)} times")
        return self


@cache
def materials() -> dict[str, WorkMaterial]:
    """The materials that come with shapegcode, by name, in the order of their file."""
    text = (resources.files("shapegcode") / "data" / "milling" / _LIBRARY).read_text(encoding="utf-8")
    library = validated(_Library, parsed(text, _LIBRARY, FileError), _LIBRARY, text, FileError)
    return {material.name: material for material in library.material}


class Cutting(TomlTable):
    """The cutting force: a material of the library, values of your own, or a material with some of them changed.

    With the chip thickness t in mm: tangential force per length of edge k1 t + tangential_edge, radial force
    k2 k1 t + radial_edge, where k1 = specific * t^specific_exponent and k2 = ratio * t^ratio_exponent.
    """

    material: Text | None = key(
        "name in the library of materials; keys given beside it take the place of its values. Left out: "
        "specific_n_per_mm2 and ratio are needed",
        default=None,
    )
    specific_n_per_mm2: Positive | None = key(
        "specific cutting force k1 at a chip 1 mm thick; for a law of Kienzle kc1.1", unit="N/mm²", default=None
    )
    specific_exponent: Exponent | None = key(
        "exponent of the chip thickness in k1; for a law of Kienzle -mc. Left out without a material: 0",
        unit="1",
        default=None,
    )
    ratio: NonNegative | None = key(
        "ratio k2 of radial to tangential force at a chip 1 mm thick", unit="1", default=None
    )
    ratio_exponent: Exponent | None = key(
        "exponent of the chip thickness in k2. Left out without a material: 0", unit="1", default=None
    )
    tangential_edge_n_per_mm: NonNegative | None = key(
        "tangential force of the edge per length of it (K_te). Left out without a material: 0",
        unit="N/mm",
        default=None,
    )
    radial_edge_n_per_mm: NonNegative | None = key(
        "radial force of the edge per length of it (K_re). Left out without a material: 0", unit="N/mm", default=None
    )
    chip_thickness: Literal["mean", "local"] | None = key(
        'which chip thickness the exponents belong to: "mean" of the whole engagement or "local" at each point of an '
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
    def _complete(self) -> Cutting:
        if self.material is None:
            for name in ("specific_n_per_mm2", "ratio"):
                if getattr(self, name) is None:
                    raise ValueError(f"needs material, or both specific_n_per_mm2 and ratio: {name} is missing")
        exponent = self._value("specific_exponent", 0.0) + self._value("ratio_exponent", 0.0)
        if exponent <= -1:
            raise ValueError(
                f"specific_exponent + ratio_exponent = {toml(exponent)}: must be greater than -1, or the radial force "
                "would not grow with the chip"
            )
        return self

    def library_entry(self) -> WorkMaterial | None:
        """The material of the library, None without one."""
        return None if self.material is None else materials()[self.material]

    def coefficients(self) -> _core.CuttingCoefficients:
        """The cutting force as the core takes it."""
        entry = self.library_entry()
        thickness = self.chip_thickness or ("mean" if entry is None else entry.chip_thickness)
        return _core.CuttingCoefficients(
            specific_n_per_mm2=self._value("specific_n_per_mm2", 0.0),
            specific_exponent=self._value("specific_exponent", 0.0),
            ratio=self._value("ratio", 0.0),
            ratio_exponent=self._value("ratio_exponent", 0.0),
            tangential_edge_n_per_mm=self._value("tangential_edge_n_per_mm", 0.0),
            radial_edge_n_per_mm=self._value("radial_edge_n_per_mm", 0.0),
            thickness=_core.ChipThickness.__members__[thickness],
        )

    def _value(self, name: str, otherwise: float) -> float:
        """A coefficient: as given here, else of the material, else a value."""
        own = getattr(self, name)
        if own is not None:
            return float(own)
        entry = self.library_entry()
        return otherwise if entry is None else float(getattr(entry, name))
