"""The file of a page without a browser: what it refuses, what it escapes, what it writes."""

import html
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shapegcode.errors import ArgumentError
from shapegcode.results.outcome import Pair
from shapegcode.results.page.html import plotly_name, save, to_html
from shapegcode.results.page.model import (
    Bars,
    CutPicker,
    CutRow,
    CutTotals,
    Figure,
    Figures,
    HeatMap,
    HeatRow,
    NextStep,
    NextSteps,
    Notes,
    Page,
    Picture,
    Section,
    Text,
)
from shapegcode.results.page.scene import CHANNELS, Scene, Variant
from shapegcode.results.plot import axes
from shapegcode.results.table import Column, Table

EVIL = "</script><b onclick='x'>&amp;\u2028"


def page(*sections: Section, **fields: Any) -> Page:
    found = Page(EVIL, "red", EVIL, EVIL, sections, {"name": EVIL, "value": 1.0})
    return replace(found, **fields)


def scene() -> Scene:
    count = 3
    column = np.arange(count, dtype=np.float64)
    table = np.column_stack([column] * 3)
    channels = {name: column for name in CHANNELS}
    whole = np.arange(count)
    variant = Variant(
        "program", EVIL, EVIL, f"G0 X1\n({EVIL})\nG1 X2\n", whole, whole + 1, whole, table, table, channels, 3
    )
    return Scene(0.002, (variant,), EVIL)


def every_part() -> tuple[Section, ...]:
    """Each kind of part once, with a text that would end an element."""
    figure = Figure(EVIL, EVIL, 2.0, 1.0, limit=0.5, key_after=EVIL)
    heat = HeatMap((EVIL,), (HeatRow(EVIL, (1.0,), (1.5,), EVIL, keys=(EVIL,)),), caption=EVIL)
    bars = Bars(EVIL, ((EVIL, (1.0,)),), (EVIL,))
    notes = Notes(((EVIL, EVIL),), frozenset([EVIL]))
    steps = NextSteps((NextStep(EVIL, EVIL),))
    picture = Picture(EVIL, lambda ax=None: axes(ax, title=EVIL), EVIL)
    table = Table(EVIL, (Column(EVIL, EVIL, value=str, text=True),), (EVIL,), caption=EVIL)
    none: Pair[Any] = Pair(1, None)
    cut = CutRow((1, 2), EVIL, 1.0, none, none, none, none, EVIL, is_shaped=True, selected=True)
    cuts = CutPicker((cut,), EVIL, CutTotals(1.0, 1))
    parts = (Figures((figure,)), heat, bars, notes, steps, picture, Text((EVIL,), warning=True), table, cuts)
    return (Section("all", EVIL, parts, how=EVIL), Section("folded", EVIL, (), folded=True))


def test_every_text_is_escaped() -> None:
    text = to_html(page(*every_part(), problems=(EVIL,), scene=scene()))
    assert "<b onclick" not in text
    assert text.count(html.escape(EVIL)) > 20
    # Only the elements that the page makes itself.
    assert text.count("</script>") == text.count("<script") == 7
    data = dict(re.findall(r'<script type="application/json" id="([\w-]+)">(.*?)</script>', text, re.DOTALL))
    assert json.loads(data["result"]) == {"name": EVIL, "value": 1.0}
    assert json.loads(data["scene-head"])["thinned"] == EVIL
    assert not set("<>&\u2028\u2029") & set("".join(data.values()))


def test_it_names_no_address_to_load_from() -> None:
    text = to_html(page(*every_part(), scene=scene()))
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    assert policy[1].startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe-inline" not in policy[1].split("style-src")[0]
    shown = re.sub(r"<(script|svg)\b.*?</\1>", "", text, flags=re.DOTALL)
    assert re.findall(r"\b(?:src|href)=\"(?!#)[^\"]*\"", shown) == []


def test_what_colours_say_words_say_too() -> None:
    for light, word in (
        ("green", "Go ahead"),
        ("calm", "Nothing to do"),
        ("amber", "Check first"),
        ("red", "Do not use"),
    ):
        assert f"<strong>{word}</strong>" in to_html(page(light=light))
    text = to_html(page(*every_part()))
    assert "▲ over</b> the limit" in text
    assert '<span class="mark">▲</span>' in text
    assert 'title="150 % of the limit"' in text


def test_a_number_is_rounded_as_in_the_json() -> None:
    """2.4450000000000003 is 2.445 in the JSON: both give the same last digit."""
    text = to_html(page(Section("a", "a", (Figures((Figure("t", "s", None, 2.4450000000000003, 2, key_after="t"),)),))))
    assert f'data-json="t" data-factor="1.0" data-digits="2">{2.445:.2f}<' in text


def test_bad_pages_are_refused() -> None:
    with pytest.raises(ArgumentError, match="inline"):
        to_html(page(), "elsewhere")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="clock"):
        to_html(page(Section("clock", "a", ())))


def test_the_shared_script_is_written_once(tmp_path: Path) -> None:
    first = save(page(scene=scene()), tmp_path / "a.html", "beside")
    assert first == [str(tmp_path / plotly_name()), str(tmp_path / "a.html")]
    assert save(page(scene=scene()), tmp_path / "b.html", "beside") == [str(tmp_path / "b.html")]
    assert save(page(), tmp_path / "c.html", "beside") == [str(tmp_path / "c.html")]
    assert (tmp_path / "a.html").stat().st_size < 2e5
    (tmp_path / plotly_name()).write_text("cut off")
    assert len(save(page(scene=scene()), tmp_path / "b.html", "beside")) == 2
    with pytest.raises(OSError, match="nowhere"):
        save(page(), tmp_path / "nowhere" / "a.html")
    assert not [file for file in tmp_path.iterdir() if file.suffix == ".tmp"]


@pytest.mark.slow
def test_pictures_of_many_points_stay_small() -> None:
    def noise(ax: Any = None) -> Any:
        panel = axes(ax, title="noise")
        panel.plot(np.random.default_rng(1).normal(size=200_000))
        return panel

    section = Section("p", "p", (Picture("noise", noise, "how"), Picture("noise", noise, "how")))
    text = to_html(page(section))
    assert len(text) < 600_000
    assert text.count("data:image/png;base64") == 2
    keys = re.findall(r'\bid="([^"]*)"', text)
    assert len(keys) == len(set(keys))
    for key in set(re.findall(r'(?:url\(#|href="#)([^")]*)', text)):
        assert key in keys
