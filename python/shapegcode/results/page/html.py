"""A page as one HTML file, readable offline; its parts are readable without scripts. Every text is escaped here.

Its Content-Security-Policy forbids every connection and allows only scripts with the listed hashes; if `script` is
"beside", also scripts in files.
"""

import base64
import gzip
import hashlib
import io
import json
import re
from collections.abc import Mapping
from functools import cache, partial
from html import escape
from importlib import metadata, resources
from operator import attrgetter
from pathlib import Path
from string import Template
from typing import Any
from urllib.parse import quote

from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import write_bytes, write_text
from shapegcode.results.json import Streamed, plain, this_version
from shapegcode.results.page import model
from shapegcode.results.page.model import Page, Script
from shapegcode.results.page.scene import packed
from shapegcode.results.plot import svg_text
from shapegcode.results.table import NO_BREAK, Column, Table

SCRIPTS = tuple(
    f"{name}.js"
    for name in ("page", "cuts", "decode", "view", "pixels", "axes", "stage", "programs", "charts", "scene")
)
STYLES = ("page.css", "scene.css", "print.css")
"""Files of `shapegcode/data/page`, in the order in which they are joined."""


_IDS = ("top", "theme", "print", "save-json", "result", "scene-head", "scene-data", "plotly-data")


def to_html(page: Page, script: Script = "inline") -> str:
    """Convert a page to the text of its file."""
    if script not in ("inline", "beside"):
        raise ArgumentError(f'script must be "inline" or "beside", not {script!r}')
    own = _assets(SCRIPTS)
    taken = {section.key for section in page.sections} & {*_IDS, *re.findall(r'\bid="([^"]+)"', _asset("scene.html"))}
    if taken:
        raise ValueError(f"{', '.join(sorted(taken))}: a section cannot have the key of a part of the page")
    before, after = page.sections[: page.before_scene], page.sections[page.before_scene :]
    parts = [section_of(section) for section in before]
    scripts = [json_script("result", page.report)]
    start = _asset("start.js")
    allowed = [_hash(start), _hash(own)]
    if page.scene is not None:
        head, data = packed(page.scene)
        head["plotly"] = "" if script == "inline" else plotly_name()
        parts.append(_asset("scene.html"))
        scripts.append(json_script("scene-head", head))
        scripts.append(f'<script type="text/plain" id="scene-data">{data}</script>')
        if script == "inline":
            text, source = _plotly()
            allowed.append(text)
            scripts.append(f'<script type="text/plain" id="plotly-data">{source}</script>')
        else:
            allowed += ["'self'", "file:"]
    parts += [section_of(section) for section in after]
    policy = (
        f"default-src 'none'; script-src {' '.join(allowed)}; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )
    motion = [("scene", "Motion")] if page.scene is not None else []
    named = [*((each.key, each.title) for each in before), *motion, *((each.key, each.title) for each in after)]
    links = "".join(f'<li><a href="#{escape(key)}">{escape(title)}</a></li>' for key, title in named)
    return Template(_asset("page.html")).substitute(
        policy=policy, version=this_version(), title=escape(page.title), styles=_assets(STYLES), start=start,
        light=light_sign(page.light), verdict=prose(page.verdict), reason=prose(page.reason),
        problems=_problems(page), links=links, body="\n".join(parts), scripts="\n".join(scripts), own=own,
    )  # fmt: skip


def _problems(page: Page) -> str:
    rows = "".join(f"<li>{prose(problem)}</li>" for problem in page.problems)
    title = "<h2>Caution: about this page itself</h2>"
    return f'<div class="warning problems" role="alert">{title}<ul>{rows}</ul></div>' if rows else ""


def save(page: Page, path: str | Path, script: Script = "inline") -> list[str]:
    """Write the file of a page, and return the files written; on failure a former file is unchanged."""
    text = to_html(page, script)
    wrote = []
    if script == "beside" and page.scene is not None:
        shared = Path(path).parent / plotly_name()
        source = _plotly_source().encode()
        if not shared.is_file() or shared.stat().st_size != len(source):
            write_bytes(shared, source)
            wrote.append(str(shared))
    write_text(path, text)
    return [*wrote, str(path)]


def plotly_name() -> str:
    """Name of the file with Plotly's script, shared by the pages of its folder."""
    return f"plotly-{metadata.version('plotly')}.min.js"


def is_shared(name: str) -> bool:
    """True if a file is a shared Plotly script, of any version."""
    return re.fullmatch(r"plotly-[\w.]+\.min\.js", name.rpartition("/")[2]) is not None


@cache
def _plotly_source() -> str:
    """Read Plotly's script as a file, which is faster than importing the package."""
    package = metadata.distribution("plotly").locate_file("plotly/package_data/plotly.min.js")
    return Path(str(package)).read_text(encoding="utf-8")


@cache
def _plotly() -> tuple[str, str]:
    """Hash of the script, and the script compressed in base64: a third of its size; pages unpack it to draw curves."""
    source = _plotly_source()
    return _hash(source), base64.b64encode(gzip.compress(source.encode(), 9, mtime=0)).decode()


@cache
def _asset(name: str) -> str:
    return (resources.files("shapegcode") / "data" / "page" / name).read_text(encoding="utf-8")


@cache
def _assets(names: tuple[str, ...]) -> str:
    return "\n".join(map(_asset, names))


def _hash(script: str) -> str:
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return f"'sha256-{digest}'"


LIGHT_WORDS: dict[model.Light, str] = {
    "green": "Go ahead", "calm": "Nothing to do", "amber": "Check first", "red": "Do not use"
}  # fmt: skip
"""Word for each traffic light, for readers who cannot see its colour."""

_SIGNS: dict[model.Light, str] = {
    # Each colour has its own shape: disc, square, triangle, octagon.
    "green": '<circle cx="16" cy="16" r="14"/><path class="mark" d="M9 16.5l5 5 9-11"/>',
    "calm": '<rect x="3" y="3" width="26" height="26" rx="5"/><path class="mark" d="M10 12.5h12m-12 7h12"/>',
    "amber": '<path d="M16 2.5 30.5 29h-29z"/><path class="mark" d="M16 12v8m0 3.2v2.2"/>',
    "red": '<path d="M10.2 2h11.6L30 10.2v11.6L21.8 30H10.2L2 21.8V10.2z"/>'
    '<path class="mark" d="M10.5 10.5l11 11m0-11l-11 11"/>',
}
_STEPS = 5
_CODE = re.compile(r"`([^`\n]+)`")


def light_sign(light: model.Light) -> str:
    """A traffic light: colour, shape and word."""
    sign = f'<svg viewBox="0 0 32 32" aria-hidden="true" class="sign">{_SIGNS[light]}</svg>'
    return f'<p class="light {light}">{sign}<strong>{LIGHT_WORDS[light]}</strong></p>'


def prose(text: str) -> str:
    """A sentence; text between backticks is code."""
    return _CODE.sub(r"<code>\1</code>", escape(text))


def number(value: float, digits: int, *, key: str = "", factor: float = 1.0) -> str:
    """A number, with its position in the JSON."""
    # Rounded as in the JSON, so that both agree in the last digit.
    value = float(f"{value / factor:.9g}") * factor
    place = f' data-json="{escape(key)}" data-factor="{factor!r}" data-digits="{digits}"' if key else ""
    return f'<span class="number" data-value="{value!r}"{place}>{value:z.{digits}f}</span>'


def section_of(section: model.Section) -> str:
    """A section with its heading."""
    kinds = ["part", *(["sheet"] if section.sheet else []), *([] if section.printed else ["unprinted"])]
    how = f'<p class="how"><b>How to read this:</b> {prose(section.how)}</p>' if section.how else ""
    body = how + "\n".join(_part(part, f"{section.key}-{rank}") for rank, part in enumerate(section.parts))
    key, title = escape(section.key), f'<h2 id="{escape(section.key)}-title">{escape(section.title)}</h2>'
    body = f"<details><summary>{title}</summary>\n{body}</details>" if section.folded else f"{title}\n{body}"
    return f'<section id="{key}" class="{" ".join(kinds)}" aria-labelledby="{key}-title">\n{body}\n</section>'


def _part(part: model.Part, key: str) -> str:
    match part:
        case model.Figures():
            return '<div class="cards">' + "\n".join(map(_card, part.rows)) + "</div>"
        case model.HeatMap():
            return _heat_map(part)
        case model.Bars():
            return _bars(part)
        case model.Notes():
            return _notes(part)
        case model.NextSteps(rows):
            steps = (f"<li>{prose(step.text)}{_command(step.command) if step.command else ''}</li>" for step in rows)
            return '<ol class="steps">' + "".join(steps) + "</ol>"
        case model.Picture():
            return _picture(part, key)
        case model.Text():
            kind = ' class="warning"' if part.warning else ""
            return f"<div{kind}>" + "".join(f"<p>{prose(text)}</p>" for text in part.paragraphs) + "</div>"
        case Table():
            return _table(part)
        case model.CutPicker():
            return _cut_picker(part, key)


def _card(figure: model.Figure) -> str:
    after = number(figure.after, figure.digits, key=figure.key_after, factor=figure.factor)
    unit = f'<span class="unit">{escape(figure.unit)}</span>'
    lines = [f'<h3 class="name">{escape(figure.name)}</h3>']
    if figure.before is None:
        lines.append(f'<p class="value">{after} {unit}</p>')
    else:
        before = number(figure.before, figure.digits, key=figure.key_before, factor=figure.factor)
        arrow = '<span class="arrow" aria-hidden="true">→</span><span class="unseen"> became </span>'
        lines.append(f'<p class="value"><span class="before">{before}</span> {arrow} {after} {unit}</p>')
        if figure.before:
            change = (figure.after - figure.before) / abs(figure.before) * 100.0
            lines.append(f'<p class="change">{change:+z.{0 if abs(change) >= 10.0 else 1}f} %</p>')
    kind = ""
    if figure.limit is not None:
        within = abs(figure.after) <= figure.limit
        kind = "within" if within else "over"
        word = "✓ within" if within else "▲ over"
        limit = f"{number(figure.limit, figure.digits)} {escape(figure.unit)}"
        lines.append(f'<p class="limit"><b>{word}</b> the limit of {limit}</p>')
    return f'<div class="card {kind}">' + "".join(lines) + "</div>"


def _heat_map(heat: model.HeatMap) -> str:
    has_remarks = any(row.remark for row in heat.rows)
    columns = ["", *heat.columns, *([""] if has_remarks else [])]
    head = "".join(f'<th scope="col">{escape(name)}</th>' if name else "<td></td>" for name in columns)
    rows = "\n".join(_heat_row(row, heat, has_remarks) for row in heat.rows)
    table = f'<table class="heat"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>'
    return _scrolled(table) + _LEGEND + _caption(heat.caption)


def _caption(text: str) -> str:
    return f'<p class="caption">{prose(text)}</p>' if text else ""


def _heat_row(row: model.HeatRow, heat: model.HeatMap, has_remarks: bool) -> str:
    cells = []
    keys = row.keys or ("",) * len(row.values)
    factors = heat.factors or (1.0,) * len(row.values)
    for value, share, key, factor in zip(row.values, row.shares, keys, factors, strict=True):
        kind, title = "heat-none", ""
        if share is not None:
            step = "over" if share > 1.0 else min(int(max(share, 0.0) * _STEPS), _STEPS - 1)
            kind, title = f"heat-{step}", f' title="{share * 100.0:.0f} % of the limit"'
        word = "–" if value is None else number(value, heat.digits, key=key, factor=factor)
        mark = '<span class="mark">▲</span>' if kind == "heat-over" else ""
        cells.append(f'<td class="{kind}"{title}>{mark}{word}</td>')
    if has_remarks:
        cells.append(f'<td class="remark">{prose(row.remark)}</td>')
    name = escape(row.name) if row.counts else f"({escape(row.name)})"
    kind = "" if row.counts else ' class="shown-only"'
    return f'<tr{kind}><th scope="row">{name}</th>{"".join(cells)}</tr>'


_SWATCHES = (
    f'<span class="swatch heat-{step}">{step * 100 // _STEPS}–{(step + 1) * 100 // _STEPS} %</span> '
    for step in range(_STEPS)
)
_OVER = '<span class="swatch heat-over"><span class="mark">▲</span>over</span>'
_LEGEND = f'<p class="legend">Ratio to the limit: {"".join(_SWATCHES)}{_OVER}</p>'


def _bars(bars: model.Bars) -> str:
    longest = max((value for _, values in bars.rows for value in values), default=0.0) or 1.0
    rows = []
    all_keys = bars.keys or (("",) * len(bars.labels),) * len(bars.rows)
    for (name, values), keys in zip(bars.rows, all_keys, strict=True):
        lines = []
        for rank, (label, value, key) in enumerate(zip(bars.labels, values, keys, strict=True)):
            width = max(value, 0.0) / longest * 100.0
            lines.append(
                f'<div class="bar bar-{rank}"><span class="of">{escape(label)}</span>'
                f'<span class="track"><span class="fill" style="width:{width:.2f}%"></span></span>'
                f'<span class="said">{number(value, bars.digits, key=key)} {escape(bars.unit)}</span></div>'
            )
        rows.append(f'<div class="bars-row"><h3>{escape(name)}</h3>{"".join(lines)}</div>')
    return '<div class="bars">' + "\n".join(rows) + "</div>"


def _notes(notes: model.Notes) -> str:
    rows = []
    for topic, text in notes.rows:
        kind = " class=strong" if topic in notes.strong else ""
        rows.append(f"<div{kind}><dt>{escape(topic)}</dt><dd>{prose(text)}</dd></div>")
    return f'<dl class="notes">{"".join(rows)}</dl>'


def _command(text: str) -> str:
    copy = '<button type="button" class="copy needs-script" aria-label="Copy the command">Copy</button>'
    return f'<div class="command"><code tabindex="0">{escape(text)}</code>{copy}</div>'


def _picture(picture: model.Picture, key: str) -> str:
    name = escape(picture.name.replace("-", " "))
    svg = svg_text(picture.plot(), key, label=picture.name.replace("-", " "))
    how = f"<b>How to read this:</b> {prose(picture.how)}" if picture.how else name
    paper = f'<div class="paper" tabindex="0" role="group" aria-label="Picture: {name}">{svg}</div>'
    return f'<figure class="picture">{paper}<figcaption>{how}</figcaption></figure>'


def _table(table: Table) -> str:
    headings, *rows = table.cells()
    columns = table.shown()
    kinds = ['class="word"' if column.text or column.left else 'class="figure"' for column in columns]
    head = "".join(f'<th scope="col" {kind}>{escape(name)}</th>' for kind, name in zip(kinds, headings, strict=True))
    lines = []
    for rank, (row, cells) in enumerate(zip(table.rows, rows, strict=True)):
        style = table.row_style(row) if table.row_style else ""
        marks = [name for name in ("bold", "red", "dim", "shaped") if name in style]
        marks += ["parted"] if rank in table.sections and rank else []
        body = "".join(
            f"<td {kind}>{_linked(escape(cell.replace(NO_BREAK, ' ')), column, row)}</td>"
            for kind, cell, column in zip(kinds, cells, columns, strict=True)
        )
        lines.append(f'<tr class="{" ".join(marks)}">{body}</tr>' if marks else f"<tr>{body}</tr>")
    title = f"<caption>{escape(table.title)}</caption>" if table.title else ""
    whole = f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table>"
    return _scrolled(whole) + _caption(table.caption)


def _linked(text: str, column: Column, row: object) -> str:
    if not column.link:
        return text
    target = column.link(row) if callable(column.link) else attrgetter(column.link)(row)
    return f'<a href="{escape(quote(target))}">{text}</a>' if target else text


def _scrolled(table: str) -> str:
    """Make a table scrollable, also from the keyboard, if it is too wide."""
    return f'<div class="scrolled" tabindex="0" role="group" aria-label="Table">{table}</div>'


def _number_of(row: model.CutRow, name: str) -> float | None:
    """Number of a row by which a column is sorted and summed."""
    if name == "first":
        return row.lines[0]
    if name == "bytes_added":
        shaped, original = row.bytes.emitted, row.bytes.original
        return None if shaped is None or original is None else shaped - original
    value: float | None = attrgetter(name)(row)
    return None if value is None else float(f"{value:.9g}")


_CUT_COLUMNS: Mapping[str, Column] = {
    "first": Column("lines", value=lambda row: "{}-{}".format(*row.lines), left=True),
    "tool": Column("tool", left=True),
    "gain_um": Column("gain", "µm", "gain_um", digits=1),
    "residual_um.original": Column("residual original", "µm", "residual_um.original", digits=1),
    "residual_um.emitted": Column("residual shaped", "µm", "residual_um.emitted", digits=1),
    "contour_um.original": Column("contour original", "µm", "contour_um.original", digits=1),
    "contour_um.emitted": Column("contour shaped", "µm", "contour_um.emitted", digits=1),
    "time_s.original": Column("time original", "s", "time_s.original", digits=2),
    "time_s.emitted": Column("time shaped", "s", "time_s.emitted", digits=2),
    "bytes_added": Column("bytes added", value=partial(_number_of, name="bytes_added")),
    "outcome": Column("shaped, or why not", value="outcome", text=True),
}
"""Columns of the cuts, by sort key."""

_CUT_SUMS = (
    ("count", "cuts to shape"),
    ("time", "cycle time"),
    ("residual", "maximum residual vibration"),
    ("contour", "maximum contour error"),
    ("bytes", "size of the program"),
)


def _cut_picker(picker: model.CutPicker, key: str) -> str:
    """The table, readable without a script; totals, check boxes and the command are filled by a script."""
    columns = tuple(_CUT_COLUMNS.values())
    table = Table("", columns, picker.rows, row_style=lambda row: "shaped" if row.is_shaped else "")
    shown = table.shown()
    values = {
        name: [getattr(row, name) if name in ("tool", "outcome") else _number_of(row, name) for row in picker.rows]
        for name in _CUT_COLUMNS
    }
    data = {
        "columns": [name for name, column in _CUT_COLUMNS.items() if column in shown],
        "values": values | {"last": [row.lines[1] for row in picker.rows]},
        "ticked": [rank for rank, row in enumerate(picker.rows) if row.selected and row.can_be_shaped],
        "fixed": [rank for rank, row in enumerate(picker.rows) if not row.can_be_shaped],
        "command": picker.command,
        "totals": plain(picker.totals),
    }
    cards = "".join(
        f'<div class="card" data-sum="{name}"><h3 class="name">{title}</h3><p class="value"></p><p class="change"></p>'
        '<p class="limit"></p></div>'
        for name, title in _CUT_SUMS
    )
    buttons = "".join(
        f'<button type="button" data-tick="{name}">{text}</button> '
        for name, text in (("all", "Tick all"), ("none", "Tick none"), ("first", "Reset"))
    )
    # On paper only the shaped cuts are listed.
    kind = "cut-picker" if any(row.is_shaped for row in picker.rows) else "cut-picker unprinted"
    return (
        f'<div class="{kind}" data-of="{escape(key)}-cuts"><div class="needs-script on-screen">'
        f'<div class="cards" role="status" aria-label="With the ticked cuts shaped">{cards}</div>'
        f'<p class="note" role="status"></p>{_command("")}<p class="ticks">{buttons}</p></div>{_table(table)}'
        '<p class="caption more needs-script on-screen"><span></span> <button type="button">Show all</button></p>'
        f"{json_script(f'{key}-cuts', data)}</div>"
    )


def json_script(key: str, value: Any) -> str:
    """JSON in HTML, with `<`, `>` and `&` escaped as code points."""
    encoder = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    if isinstance(value, Mapping) and any(isinstance(each, Streamed) for each in value.values()):
        stream = io.StringIO()
        stream.writelines(encoder.iterencode(value))
        text = stream.getvalue()
    else:
        text = encoder.encode(value)
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return f'<script type="application/json" id="{key}">{text}</script>'
