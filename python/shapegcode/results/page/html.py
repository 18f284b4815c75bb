"""A page as one HTML file, readable offline.

Its Content-Security-Policy forbids every connection and allows only scripts with the listed hashes.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import re
from functools import cache
from html import escape
from importlib import metadata, resources
from pathlib import Path
from string import Template

from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import write_bytes, write_text
from shapegcode.results.json import this_version
from shapegcode.results.page.markup import json_script, light_sign, prose, section_of
from shapegcode.results.page.model import Page, Script
from shapegcode.results.page.scene import packed

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
    """Write the file of a page; on failure the former file is kept."""
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
    """Hash of the script, and the script compressed in base64: a third of its size, unpacked only for curves."""
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
