"""The page of the machine file, made of its model; and the tables of keys of any settings file."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic.fields import FieldInfo

from shapegcode.machine import Machine
from shapegcode.settings.keys import InlineTable, TomlTable, facts, item_type, table_type, toml

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


def machine_documentation() -> str:
    """The reference of the machine file's keys as Markdown: what ``docs/reference/machine.md`` holds, word for word."""
    builtin = ", ".join(f"`{name}`" for name in Machine.builtin_names())
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
        "(of the control), `inherited` (from another machine), `assumed`, `choice` (yours, not a machine property),",
        '`default` or `stated`, and a note may follow: `"measured: tap of 3 May"`. A value without an origin counts',
        "as stated. Comments are for people and never read. Older files have neither form: the first",
        "words of their comments count (`# measured ...`), with a warning; `shapegcode machine show FILE",
        "--write-origins` writes the table into the file. `machine show` counts the origins, and a verdict ends",
        "with those that it depends on and that are unverified.",
        "",
        "A default marked **assumed** is a typical value; your machine's may differ: look it up or measure",
        "it. The FANUC column names the parameter that corresponds to a key; numbers differ between series,",
        "so check your manual.",
    ]
    return "\n".join([*lines, *key_tables(Machine)]) + "\n"


def key_tables(model: type[TomlTable], *, fanuc: bool = True, heading: str = "##") -> list[str]:
    """The keys of a file as Markdown: a heading and a table for each of its tables, a line each."""
    lines: list[str] = []
    columns = ("key", "unit", "default", "FANUC", "meaning") if fanuc else ("key", "unit", "default", "meaning")
    for table, meaning, fields in _documented(model, ""):
        lines += ["", f"{heading} {_heading(table)}", ""]
        if meaning:
            lines += [f"{meaning[:1].upper()}{meaning[1:]}.", ""]
        lines += [f"| {' | '.join(columns)} |", "|" + "---|" * len(columns)]
        for name, field in fields:
            noted = facts(field)
            default = "not set" if field.default is None else f"`{toml(field.default)}`"
            default = "required" if field.is_required() else default
            cells = {
                "key": f"`{name}`",
                "unit": noted["unit"] or "–",
                "default": default + (" **assumed**" if noted["assumed"] else ""),
                "FANUC": noted["fanuc"] or "–",
                "meaning": field.description or "",
            }
            lines.append("| " + " | ".join(cells[column].replace("|", "\\|") for column in columns) + " |")
    return lines


def _documented(model: type[TomlTable], prefix: str) -> Iterator[tuple[str, str, list[tuple[str, FieldInfo]]]]:
    """Per table of the file: its name, its meaning, its keys."""
    keys: list[tuple[str, FieldInfo]] = []
    below: list[tuple[str, str, type[TomlTable]]] = []
    for name, field in model.model_fields.items():
        sub, key = table_type(field), f"{prefix}{name}"
        if sub is None or issubclass(sub, InlineTable):
            keys.append((name, field))
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
        for table, text, fields in _documented(sub, sub_prefix):
            yield table, text or meaning, fields


def _heading(table: str) -> str:
    if not table:
        return "Top level"
    return f"`[[{table.removesuffix('[]')}]]`" if table.endswith("[]") else f"`[{table}]`"
