"""JSON Schema of a TOML file of settings, so that editors complete and check it."""

from __future__ import annotations

from typing import Any

from shapegcode.settings.keys import TomlTable

__all__ = ["toml_schema"]


def toml_schema(model: type[TomlTable], title: str) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a file.

    Args:
        model: the table that the file is read as.
        title: of the schema.

    Returns:
        The schema; descriptions have the unit and the numbers of the FANUC parameters. What depends on several keys
        together is only checked when the file is read.
    """
    found = model.model_json_schema(mode="validation")
    for table in (found, *found.get("$defs", {}).values()):
        for entry in table.get("properties", {}).values():
            _describe(entry)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | found | {"title": title}


def _describe(entry: dict[str, Any]) -> None:
    unit, fanuc, assumed = (entry.pop(name, "") for name in ("unit", "fanuc", "assumed"))
    said = entry.get("description", "")
    said += f" [{unit}]" if unit and unit != "1" else ""
    said += f" (FANUC parameter {fanuc})" if fanuc else ""
    entry["description"] = said + (" The default is assumed." if assumed else "")
    entry.pop("title", None)
