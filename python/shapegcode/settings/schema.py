"""JSON Schema of a TOML file of settings, so that editors complete and check it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_origin

from shapegcode.settings.keys import InlineTable, TomlTable, facts, item_type, table_type
from shapegcode.settings.remarks import ORIGIN, ORIGIN_TEXT

__all__ = ["keys_schema", "toml_schema"]


def toml_schema(model: type[TomlTable], title: str, *, origins: bool = False) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a file."""
    found = model.model_json_schema(mode="validation")
    for table in (found, *found.get("$defs", {}).values()):
        for entry in table.get("properties", {}).values():
            _describe(entry)
    if origins:
        _allow_origins(model, found, found.get("$defs", {}))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | found | {"title": title}


def _allow_origins(model: type[TomlTable], found: dict[str, Any], defs: dict[str, Any]) -> None:
    """A table of origins, and beside each value its own; such a value is only checked when the file is read."""
    defs["Origin"] = {"type": "string", "pattern": ORIGIN_TEXT, "description": "where the value comes from"}
    stated = {"$ref": "#/$defs/Origin"}
    defs["Origins"] = {"type": "object", "additionalProperties": {"anyOf": [stated, {"$ref": "#/$defs/Origins"}]}}
    both = {"value": {}, ORIGIN: stated}
    defs["WithOrigin"] = {"type": "object", "properties": both, "required": [*both], "additionalProperties": False}
    beside = {"$ref": "#/$defs/WithOrigin"}
    tables = {model: found}
    while tables:
        table, entry = tables.popitem()
        for name, field in table.model_fields.items():
            below = table_type(field)
            if below is not None and not issubclass(below, InlineTable):
                tables[below] = defs[below.__name__]
                continue
            value = entry["properties"][name]
            if beside not in value.get("anyOf", ()):
                said = {key: value.pop(key) for key in ("description", "default") if key in value}
                entry["properties"][name] = {"anyOf": [*value.get("anyOf", [value]), beside]} | said
    found["properties"][ORIGIN] = {"$ref": "#/$defs/Origins", "description": "where values come from, by key"}


def keys_schema(model: type[TomlTable], value: dict[str, Any], kind: str, defs: dict[str, Any]) -> dict[str, Any]:
    """JSON Schema of a table that says something of some keys of a file, by their dotted names or as tables."""
    name = f"{kind}.{model.__name__}"
    if name not in defs:
        defs[name] = {}
        properties: dict[str, Any] = {}
        for key, field in model.model_fields.items():
            found = value
            below = table_type(field)
            if below is not None:
                table = keys_schema(below, value, kind, defs)
                table = _table({"^[1-9][0-9]*$": table}) if item_type(field) else table
                found = {"anyOf": [value, table]}
            elif get_origin(field.annotation) in (dict, Mapping):
                found = {"anyOf": [value, _table({".": value})]}
            properties[key] = found | facts(field) | {"description": field.description or ""}
            _describe(properties[key])
        defs[name] = _table({r"\.": value}) | {"properties": properties}
    return {"$ref": f"#/$defs/{name}"}


def _table(patterns: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "patternProperties": patterns, "additionalProperties": False, "minProperties": 1}


def _describe(entry: dict[str, Any]) -> None:
    unit, fanuc, assumed = (entry.pop(name, "") for name in ("unit", "fanuc", "assumed"))
    said = entry.get("description", "")
    said += f" [{unit}]" if unit and unit != "1" else ""
    said += f" (FANUC parameter {fanuc})" if fanuc else ""
    entry["description"] = said + (" The default is assumed." if assumed else "")
    entry.pop("title", None)
