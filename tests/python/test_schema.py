"""The JSON Schemas of every result: valid themselves, their keys stable."""

import dataclasses
import json
import math
from typing import Any

import jsonschema
import pytest
import write_schemas

from shapegcode.results.json import exact, hidden, plain, schema, sparse, to_text
from shapegcode.results.outcome import Pair, Xyz

RESULTS = write_schemas.results()


def test_keys_are_those_that_were_published() -> None:
    """Whoever reads a JSON relies on them: one that goes or comes is a line of the changelog."""
    assert write_schemas.keys() == write_schemas.KEYS.read_text(encoding="utf-8"), "run `make schemas`"


@pytest.mark.parametrize("name", RESULTS)
def test_schemas_are_schemas_and_say_what_each_key_means(name: str) -> None:
    found = schema(RESULTS[name])
    jsonschema.Draft202012Validator.check_schema(found)
    assert {"ok", "warnings", "next_step"} <= set(found["required"])
    for where in (found, *found.get("$defs", {}).values()):
        silent = [
            key
            for key, entry in where.get("properties", {}).items()
            if "description" not in entry and key not in {"warnings", "plots", "output", "provenance"}
        ]
        assert silent == [], name


@pytest.mark.parametrize("name", RESULTS)
def test_results_are_frozen_dataclasses(name: str) -> None:
    cls = RESULTS[name]
    assert dataclasses.is_dataclass(cls)
    assert cls.__dataclass_params__.frozen  # type: ignore[attr-defined]


@dataclasses.dataclass(frozen=True)
class _Part:
    """A part.

    Attributes:
        error_um: of it.
        taps: of a shaper.
        samples: many.
        before: and after.
        gouge: only where a side is known.
    """

    error_um: Xyz[float]
    taps: tuple[float, ...] = dataclasses.field(metadata=exact())
    samples: tuple[float, ...] = dataclasses.field(metadata=hidden())
    before: Pair[float | None]
    gouge: float | None = dataclasses.field(default=None, metadata=sparse())


@dataclasses.dataclass(frozen=True)
class _Inner:
    """A part that is not public."""

    first_mm: float = 0.0  # behind the field
    # above the field,
    # in two lines
    second: dict[str, float] = dataclasses.field(default_factory=dict)


def test_a_meaning_may_stand_at_its_field() -> None:
    found = schema(_Inner)["properties"]
    meanings = [found[name]["description"] for name in ("first_mm", "second")]
    assert meanings == ["behind the field.", "above the field, in two lines."]


def test_numbers_are_written_as_a_person_would() -> None:
    part = _Part(Xyz(1e-12, -0.0, 1.0 / 3.0), (1.0 / 3.0, -0.0), (1.0,), Pair(math.nan, 1e-12))
    assert plain(part) == {
        "error_um": {"x": 0.0, "y": 0.0, "z": 0.333333333},
        "taps": [1.0 / 3.0, 0.0],
        "before": {"original": None, "emitted": 1e-12},
    }
    assert "-0" not in to_text(plain(part))
    with pytest.raises(TypeError, match="bytes cannot be written as JSON"):
        plain({"a": b"x"})
    with pytest.raises(ValueError, match="not JSON compliant"):
        to_text(math.inf)


def test_a_schema_refuses_what_the_class_has_not() -> None:
    found: dict[str, Any] = schema(_Part)
    assert "gouge" not in found["required"]
    good = json.loads(to_text(plain(_Part(Xyz(1.0, 2.0, 3.0), (1.0,), (), Pair(None, 1.0)))))
    jsonschema.validate(good, found)
    jsonschema.validate(good | {"gouge": 1.0}, found)
    for wrong in (
        {"error_um": {"x": 1.0}},
        {"before": {"original": "a", "emitted": 1.0}},
        {"more": 1},
        {"taps": [None]},
    ):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(good | wrong, found)
    assert found["properties"]["error_um"]["description"] == "of it."
