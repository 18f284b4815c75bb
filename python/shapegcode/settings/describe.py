"""A machine in words: values with their origin, its file, long and short, its reference and JSON Schema."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, get_origin

from pydantic.fields import FieldInfo

from shapegcode.settings.keys import (
    InlineTable,
    KeyInfo,
    KeyValue,
    TomlTable,
    facts,
    item_type,
    key_info,
    table_type,
    toml,
)  # fmt: skip
from shapegcode.settings.remarks import ORIGIN, ORIGIN_TEXT, origin_lines, origin_of

_LINE_WIDTH = 110


def values_of(
    table: TomlTable, prefix: str = "", given: bool = True, remarks: Mapping[str, str] | None = None
) -> Iterator[KeyValue]:
    """Every key below a table with its value and origin, in the order of the file."""
    for name, field in type(table).model_fields.items():
        value, key = getattr(table, name), f"{prefix}{name}"
        from_file = given and name in table.model_fields_set
        if isinstance(value, TomlTable) and not isinstance(value, InlineTable):
            yield from values_of(value, f"{key}.", from_file, remarks)
        elif item_type(field) and value:
            for number, item in enumerate(value, start=1):
                yield from values_of(item, f"{key}.{number}.", from_file, remarks)
        else:
            info = key_info(field, key)
            remark = (remarks or {}).get(key, "")
            # A key without a value can have a remark that says why: "assumed: not limited", "not measured: rigid".
            says_why = not value and (value is not None or remark.startswith("assumed"))
            origin = origin_of(remark) if from_file or (remark and says_why) else "default"
            assumed = origin == "assumed" or (info.assumed and origin == "default")
            yield KeyValue(
                key=key,
                value="not set" if value is None else toml(value),
                unit=info.unit,
                origin=origin,
                assumed=assumed,
                meaning=info.meaning,
                fanuc=info.fanuc,
                remark=remark,
            )


_HEAD = (
    "Machine file of shapegcode. Keys and defaults: docs/reference/machine.md. A key that is left out has its default; "
    "`shapegcode machine show FILE` prints every value."
)
_SHORT_HEAD = (
    "Machine file of shapegcode, the short form: what is not here has its default. `shapegcode machine show FILE` "
    "prints every value with its meaning; docs/reference/machine.md explains the keys."
)
_TOLD = ("measured", "dump")


def write_toml(machine: TomlTable, remarks: Mapping[str, str], *, short: bool = False) -> str:
    """A machine as a commented file; *short*: what differs from a default, or of which its origin is known."""
    writer = _TomlWriter(dict(remarks), short)
    writer.comment(_SHORT_HEAD if short else _HEAD)
    writer.lines.append("")
    writer.table(machine, "")
    if writer.remarks and not short:
        raise KeyError(f"remarks for unknown keys: {', '.join(sorted(writer.remarks))}")
    if said := origin_lines(writer.said):
        writer.lines += [*([""] if writer.lines[-1] else []), *said]
    return "\n".join(writer.lines).rstrip("\n") + "\n"


class _TomlWriter:
    """Writes a machine as commented TOML."""

    def __init__(self, remarks: dict[str, str], short: bool) -> None:
        self.remarks = remarks  # that are not yet written
        self.said: dict[str, str] = {}
        self.lines: list[str] = []
        self._short = short

    def _add(self, line: str, key: str) -> None:
        """A line, its remark as the comment behind it: for people, what counts is the table of the origins."""
        if remark := self.remarks.pop(key, ""):
            self.said[key] = remark
        self.lines.append(f"{line}  # {remark}" if remark else line)

    def comment(self, text: str) -> None:
        """Words on lines of their own."""
        self.lines += textwrap.wrap(
            text, _LINE_WIDTH, initial_indent="# ", subsequent_indent="# ", break_long_words=False,
            break_on_hyphens=False,
        )  # fmt: skip

    def table(self, table: TomlTable, prefix: str) -> None:
        """Plain keys first, then the tables below, as TOML asks."""
        below: list[tuple[str, FieldInfo, Any]] = []
        for name, field in type(table).model_fields.items():
            value, key = getattr(table, name), f"{prefix}{name}"
            if (isinstance(value, TomlTable) and not isinstance(value, InlineTable)) or item_type(field):
                below.append((key, field, value))
            elif not self._short or self._is_told(key, table, name, field):
                if not self._short:
                    info = key_info(field, key)
                    unit = f" [{info.unit}]" if info.unit and info.unit != "1" else ""
                    fanuc = f" (FANUC parameter {info.fanuc})" if info.fanuc else ""
                    self.comment(f"{info.meaning[:1].upper()}{info.meaning[1:]}{unit}{fanuc}.")
                self._add(f"# {name} = ..." if value is None else f"{name} = {toml(value)}", key)
        for key, field, value in below:
            if item := item_type(field):
                self._list(key, field, item, value)
            else:
                self._below(f"[{key}]", field.description or "", value, f"{key}.")

    def _below(self, head: str, meaning: str, table: TomlTable, prefix: str) -> None:
        """A TOML table with its header, if keys remain in it; else nothing."""
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

    def _list(self, key: str, field: FieldInfo, item: type[TomlTable], tables: tuple[TomlTable, ...]) -> None:
        if not tables and not self._short:
            self.lines.append("")
            self.comment(f"{key}: {field.description}.")
        if not tables and (not self._short or self.remarks.get(key)):
            self._add(f"# [[{key}]]", key)
        if not tables and not self._short:
            self.lines += [f"# {name} = ..." for name, inner in item.model_fields.items() if inner.is_required()]
        for number, table in enumerate(tables, start=1):
            meaning = (item.__doc__ or "").rstrip(".") if number == 1 else ""
            self._below(f"[[{key}]]", meaning, table, f"{key}.{number}.")

    def _is_told(self, key: str, table: TomlTable, name: str, field: FieldInfo) -> bool:
        """Whether the file must hold it, or holds it with a word of where it comes from."""
        value = getattr(table, name)
        if field.is_required():
            return True
        remark, assumed = self.remarks.get(key, ""), bool(facts(field).get("assumed"))
        origin = origin_of(remark)
        # What equals the default goes where nothing is lost: an assumption whose default is marked as one, a statement
        # without a word of where it comes from whose default is not.
        told = {"assumed": not assumed, "inherited": not assumed, "file": bool(remark) or assumed}.get(
            origin, origin in _TOLD
        )
        if value is None:
            return remark.startswith("assumed")
        return name in table.model_fields_set and (told or value != field.get_default(call_default_factory=True))


_EXAMPLE = """\
name = "VMC-3"

[axes.x]
max_feed_mm_per_min = 12000.0
rapid_mm_per_min = 24000.0
max_acceleration_mm_s2 = 3000.0

[[axes.x.modes]]
frequency_hz = 46.0
damping_ratio = 0.02

[axes.y]
max_feed_mm_per_min = 12000.0
rapid_mm_per_min = 24000.0
max_acceleration_mm_s2 = 3000.0

[axes.z]
max_feed_mm_per_min = 12000.0
rapid_mm_per_min = 18000.0
max_acceleration_mm_s2 = 3000.0
rigid = true

[controller]
dnc_baud = 9600  # a comment is for people

[origin]
axes.x.max_acceleration_mm_s2 = "assumed: 0.3 g, usual for a machining centre"
axes.x.modes.1.frequency_hz = "measured: tap test"
axes.x.modes.1.damping_ratio = "measured: tap test"
axes.y.max_acceleration_mm_s2 = "assumed: 0.3 g, usual for a machining centre"
axes.z.max_acceleration_mm_s2 = "assumed: 0.3 g, usual for a machining centre"
axes.z.rapid_mm_per_min = "parameters: FANUC 1420"
axes.z.rigid = "stated: nothing of it was seen in the tap test"
"""


def documentation(model: type[TomlTable], builtin_names: Sequence[str]) -> str:
    """The reference of a machine file's keys as Markdown."""
    builtin = ", ".join(f"`{name}`" for name in builtin_names)
    lines = [
        "# The machine file",
        "",
        "<!-- Generated: make docs -->",
        "",
        "A whole machine file:",
        "",
        "```toml",
        *_EXAMPLE.splitlines(),
        "```",
        "",
        "What is left out has its default. [`shapegcode setup`](../howto/setup.md) writes such a file from answers,",
        "`shapegcode machine init NAME` from a built-in machine; `--full` gives every key with its meaning.",
        "`shapegcode machine show FILE` prints every value with its origin, `machine diff A B` in which values two",
        "machines differ, `machine schema` the JSON Schema of the file, with which editors complete and check it.",
        "",
        "The file is TOML. An unknown key, a number that is not finite or a value outside its limits is an error,",
        "and all errors of a file are listed at once.",
        "",
        f"Built-in machines, usable by name in place of a file: {builtin}.",
        'For one run `--set KEY=VALUE` replaces a value, in Python `machine.with_values("tolerance.contour_um", 5)`;',
        "both are checked as the file is. Modes count from 1 in every key (`machine show`, `--set`, `with_values`,",
        "`study`, `optimize`): `axes.x.modes.1.frequency_hz` is the first mode of X, `axes.x.modes.0` an error.",
        "",
        "Where a value comes from (its provenance) stands in the table `[origin]`, by its key, or beside it:",
        '`frequency_hz = { value = 46.2, origin = "measured" }`. The text begins with `measured`, `parameters`',
        "(of the control), `inherited` (from another machine), `assumed`, `choice` (a property of no machine),",
        '`default` or `stated`, and a note may follow: `"measured: tap of 3 May"`. A value without an origin is',
        "what the file states. Comments are for people and never read. Older files have neither form: the first",
        "words of their comments count (`# measured ...`), with a warning; `shapegcode machine show FILE",
        "--write-origins` writes the table into the file. `machine show` counts the origins, and a verdict ends",
        "with those that it depends on and that are unverified.",
        "",
        "A default marked **assumed** is not known for real controllers in general: look it up or measure",
        "it. The FANUC column names the parameter that corresponds to a key; numbers differ between series,",
        "so check your manual.",
    ]
    return "\n".join([*lines, *key_tables(model)]) + "\n"


def key_tables(model: type[TomlTable], *, fanuc: bool = True, heading: str = "##") -> list[str]:
    """The keys of a file as Markdown: a heading and a table for each of its tables, a line each."""
    lines: list[str] = []
    columns = ("key", "unit", "default", "FANUC", "meaning") if fanuc else ("key", "unit", "default", "meaning")
    for table, meaning, infos in _documented(model, ""):
        lines += ["", f"{heading} {_heading(table)}", ""]
        if meaning:
            lines += [f"{meaning[:1].upper()}{meaning[1:]}.", ""]
        lines += [f"| {' | '.join(columns)} |", "|" + "---|" * len(columns)]
        for info in infos:
            name = info.key.removeprefix(f"{table}.")
            default = info.default if info.default in ("required", "not set") else f"`{info.default}`"
            cells = {
                "key": f"`{name}`",
                "unit": info.unit or "–",
                "default": default + (" **assumed**" if info.assumed else ""),
                "FANUC": info.fanuc or "–",
                "meaning": info.meaning,
            }
            lines.append("| " + " | ".join(cells[column].replace("|", "\\|") for column in columns) + " |")
    return lines


def _documented(model: type[TomlTable], prefix: str) -> Iterator[tuple[str, str, list[KeyInfo]]]:
    """Per table of the file: its name, its meaning, its keys."""
    keys: list[KeyInfo] = []
    below: list[tuple[str, str, type[TomlTable]]] = []
    for name, field in model.model_fields.items():
        sub, key = table_type(field), f"{prefix}{name}"
        if sub is None or issubclass(sub, InlineTable):
            keys.append(key_info(field, key))
            continue
        alike = [other for other, inner in model.model_fields.items() if table_type(inner) is sub]
        if item_type(field):
            below.append((f"{key}[].", field.description or "", sub))
        elif len(alike) == 1:
            below.append((f"{key}.", field.description or "", sub))
        elif name == alike[0]:
            # Tables of one type, such as the axes, are described once, by the words of their type.
            below.append((f"{prefix}<{'|'.join(alike)}>.", (sub.__doc__ or "").rstrip("."), sub))
    if keys:
        yield prefix.rstrip("."), "", keys
    for sub_prefix, meaning, sub in below:
        for table, text, infos in _documented(sub, sub_prefix):
            yield table, text or meaning, infos


def _heading(table: str) -> str:
    if not table:
        return "Top level"
    return f"`[[{table.removesuffix('[]')}]]`" if table.endswith("[]") else f"`[{table}]`"


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
