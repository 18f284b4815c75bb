"""Cutting forces of work materials: power laws over the chip thickness, and the library that comes with shapegcode."""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Annotated, Literal

from pydantic import Field, Strict, model_validator

from shapegcode.errors import FileError
from shapegcode.settings.keys import Float, NonNegative, Positive, Text, TomlTable, key
from shapegcode.settings.load import parsed, validated
from shapegcode.settings.problems import KeyProblem

__all__ = ["WorkMaterial", "materials"]

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
