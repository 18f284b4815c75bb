"""Write a settings file with comments, long or short; its JSON Schema."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any, get_origin

from pydantic.fields import FieldInfo

from shapegcode.settings import keys
from shapegcode.settings.edit import origin_lines

_LINE_WIDTH = 110


_HEAD = (
    "Machine file of shapegcode. Keys and defaults: docs/reference/machine.md. A key that is left out has its default; "
    "`shapegcode machine show FILE` prints every value."
)
_SHORT_HEAD = (
    "Machine file of shapegcode, the short form: what is not here has its default. `shapegcode machine show FILE` "
    "prints every value with its meaning; docs/reference/machine.md explains the keys."
)
_FOUND = ("measured", "dump")


def write_toml(machine: keys.TomlTable, remarks: Mapping[str, str], *, short: bool = False) -> str:
    """Write a machine as a commented file; *short*: only required keys, and those not default or with an origin."""
    writer = _TomlWriter(dict(remarks), short)
    writer.comment(_SHORT_HEAD if short else _HEAD)
    writer.lines.append("")
    writer.table(machine, "")
    if writer.remarks and not short:
        raise KeyError(f"remarks for unknown keys: {', '.join(sorted(writer.remarks))}")
    if origins := origin_lines(writer.written):
        writer.lines += [*([""] if writer.lines[-1] else []), *origins]
    return "\n".join(writer.lines).rstrip("\n") + "\n"


class _TomlWriter:
    def __init__(self, remarks: dict[str, str], short: bool) -> None:
        self.remarks = remarks  # not yet written
        self.written: dict[str, str] = {}
        self.lines: list[str] = []
        self._short = short
        self._explains = not short

    def _add(self, line: str, key: str) -> None:
        """Add a line with its remark as a comment for readers; programs read the table of origins."""
        if remark := self.remarks.pop(key, ""):
            self.written[key] = remark
        self.lines.append(f"{line}  # {remark}" if remark else line)

    def comment(self, text: str) -> None:
        self.lines += textwrap.wrap(
            text, _LINE_WIDTH, initial_indent="# ", subsequent_indent="# ", break_long_words=False,
            break_on_hyphens=False,
        )  # fmt: skip

    def table(self, table: keys.TomlTable, prefix: str) -> None:
        """Write plain keys first, then nested tables, as TOML requires."""
        below: list[tuple[str, FieldInfo, Any]] = []
        for name, field in type(table).model_fields.items():
            value, key = getattr(table, name), f"{prefix}{name}"
            if (isinstance(value, keys.TomlTable) and not isinstance(value, keys.InlineTable)) or keys.item_type(field):
                below.append((key, field, value))
            elif not self._short or self._is_kept(key, table, name, field):
                if self._explains:
                    meaning = _with_facts(field.description or "", keys.facts(field))
                    self.comment(f"{meaning[:1].upper()}{meaning[1:]}.")
                self._add(f"# {name} = ..." if value is None else f"{name} = {keys.toml(value)}", key)
        for key, field, value in below:
            if item := keys.item_type(field):
                self._list(key, field, item, value)
            else:
                self._below(f"[{key}]", field.description or "", value, f"{key}.")

    def _below(self, head: str, meaning: str, table: keys.TomlTable, prefix: str) -> None:
        """Write a nested table with its header, if keys remain in it."""
        before = list(self.lines)
        if self.lines and self.lines[-1]:
            self.lines.append("")
        self.lines.append(f"{head}  # {meaning}" if meaning and not self._short else head)
        headed = len(self.lines)
        self.table(table, prefix)
        if len(self.lines) == headed:
            self.lines = before
        elif self.lines[headed] == "":
            self.lines = [*before, *self.lines[headed:]]

    def _list(self, key: str, field: FieldInfo, item: type[keys.TomlTable], tables: tuple[keys.TomlTable, ...]) -> None:
        if not tables and not self._short:
            self.lines.append("")
            self.comment(f"{key}: {field.description}.")
            self._add(f"# [[{key}]]", key)
            self.lines += [f"# {name} = ..." for name, inner in item.model_fields.items() if inner.is_required()]
        elif not tables and self.remarks.get(key):
            self._add(f"# [[{key}]]", key)
        for number, table in enumerate(tables, start=1):
            # Only the first table of a list explains the keys.
            self._explains = not self._short and number == 1
            meaning = (item.__doc__ or "").rstrip(".") if number == 1 else ""
            self._below(f"[[{key}]]", meaning, table, f"{key}.{number}.")
        self._explains = not self._short

    def _is_kept(self, key: str, table: keys.TomlTable, name: str, field: FieldInfo) -> bool:
        """True if the short file needs the key: mandatory, not the default, or with an origin to keep."""
        value = getattr(table, name)
        if field.is_required():
            return True
        remark, assumed = self.remarks.get(key, ""), bool(keys.facts(field).get("assumed"))
        origin = keys.origin_of(remark)
        # A value equal to the default is left out if no information is lost: an assumption whose default is assumed, a
        # value without an origin whose default is not.
        kept = {"assumed": not assumed, "inherited": not assumed, "file": bool(remark) or assumed}.get(
            origin, origin in _FOUND
        )
        if value is None:
            return remark.startswith("assumed")
        return name in table.model_fields_set and (kept or value != field.get_default(call_default_factory=True))


def toml_schema(model: type[keys.TomlTable], title: str, *, origins: bool = False) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a file."""
    found = model.model_json_schema(mode="validation")
    for table in (found, *found.get("$defs", {}).values()):
        for entry in table.get("properties", {}).values():
            _describe(entry)
    if origins:
        _allow_origins(model, found, found.get("$defs", {}))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | found | {"title": title}


def _allow_origins(model: type[keys.TomlTable], found: dict[str, Any], defs: dict[str, Any]) -> None:
    """Allow a table of origins, or an origin at each value (values with an origin are checked only on load)."""
    defs["Origin"] = {"type": "string", "pattern": keys.ORIGIN_TEXT, "description": "origin of the value"}
    stated = {"$ref": "#/$defs/Origin"}
    defs["Origins"] = {"type": "object", "additionalProperties": {"anyOf": [stated, {"$ref": "#/$defs/Origins"}]}}
    both = {"value": {}, keys.ORIGIN: stated}
    defs["WithOrigin"] = {"type": "object", "properties": both, "required": [*both], "additionalProperties": False}
    beside = {"$ref": "#/$defs/WithOrigin"}
    tables = {model: found}
    while tables:
        table, entry = tables.popitem()
        for name, field in table.model_fields.items():
            below = keys.table_type(field)
            if below is not None and not issubclass(below, keys.InlineTable):
                tables[below] = defs[below.__name__]
                continue
            value = entry["properties"][name]
            if beside not in value.get("anyOf", ()):
                text = {key: value.pop(key) for key in ("description", "default") if key in value}
                entry["properties"][name] = {"anyOf": [*value.get("anyOf", [value]), beside]} | text
    found["properties"][keys.ORIGIN] = {"$ref": "#/$defs/Origins", "description": "origins of values, by key"}


def keys_schema(model: type[keys.TomlTable], value: dict[str, Any], kind: str, defs: dict[str, Any]) -> dict[str, Any]:
    """JSON Schema of a table that describes some keys of a file, by their dotted names or as tables."""
    name = f"{kind}.{model.__name__}"
    if name not in defs:
        defs[name] = {}
        properties: dict[str, Any] = {}
        for key, field in model.model_fields.items():
            found = value
            if (below := keys.table_type(field)) is not None:
                table = keys_schema(below, value, kind, defs)
                found = {"anyOf": [value, _table({"^[1-9][0-9]*$": table}) if keys.item_type(field) else table]}
            elif get_origin(field.annotation) in (dict, Mapping):
                found = {"anyOf": [value, _table({".": value})]}
            properties[key] = found | keys.facts(field) | {"description": field.description or ""}
            _describe(properties[key])
        defs[name] = _table({r"\.": value}) | {"properties": properties}
    return {"$ref": f"#/$defs/{name}"}


def _table(patterns: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "patternProperties": patterns, "additionalProperties": False, "minProperties": 1}


def _describe(entry: dict[str, Any]) -> None:
    text = _with_facts(entry.get("description", ""), entry)
    entry["description"] = text + (" The default is assumed." if entry.get("assumed") else "")
    for name in ("title", "unit", "fanuc", "assumed"):
        entry.pop(name, None)


def _with_facts(meaning: str, facts: Mapping[str, Any]) -> str:
    """Meaning of a key with its unit and FANUC parameters."""
    unit, fanuc = facts.get("unit"), facts.get("fanuc")
    meaning += f" [{unit}]" if unit and unit != "1" else ""
    return meaning + (f" (FANUC parameter {fanuc})" if fanuc else "")
