"""Cuts to choose from on a page: sums and command against NumPy, sorting, ten thousand rows, paper, no script."""

import base64
import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pypdf
import pytest
from selenium.webdriver import Keys

from browser import Browser, grave
from shapegcode.results.outcome import Pair
from shapegcode.results.page.html import save
from shapegcode.results.page.model import CutPicker, CutRow, CutTotals, Light, Page, Section

COMMAND = "shapegcode convert part.nc -m mine.toml -o shaped.nc --only {lines}"
TOTALS = CutTotals(300.0, 50_000, residual_limit_um=5.0, contour_limit_um=20.0)
MANY = 10_000


def cut(rank: int, **changes: Any) -> CutRow:
    """A cut of a row of cuts, of ten lines each."""
    noise = np.random.default_rng(rank)
    residual, contour, time = noise.uniform(1.0, [30.0, 40.0, 9.0])
    shaped = rank % 3 == 0
    fields: dict[str, Any] = {
        "lines": (10 * rank + 1, 10 * rank + 9),
        "tool": f"T{rank % 12 + 1}",
        "gain_um": residual * 0.9,
        "residual_um": Pair(residual, residual * 0.1),
        "contour_um": Pair(contour, contour * 0.7),
        "time_s": Pair(time, time * 1.04),
        "bytes": Pair(100, 1000 + rank),
        "outcome": "shaped" if shaped else "gains less than shaping.least_gain_um",
        "is_shaped": shaped,
        "selected": shaped,
    }
    return CutRow(**(fields | changes))


FEW = (
    cut(0),
    cut(1, gain_um=None, residual_um=Pair(12.0, None), contour_um=Pair(4.0, None), time_s=Pair(2.0, None),
        bytes=Pair(50, None), outcome="not tried"),
    cut(2, tool="T10"),
    cut(3, tool="T2"),
    cut(4, can_be_shaped=False, outcome="a thread: its feed follows the spindle"),
)  # fmt: skip


def write(place: Path, rows: Sequence[CutRow], name: str, light: Light = "calm") -> Path:
    section = Section("cuts", "Choose the cuts", (CutPicker(tuple(rows), COMMAND, TOTALS),))
    page = Page("Cuts", light, "no benefit: run the original", "nothing gains enough", (section,), {"name": "cuts"})
    save(page, place / name)
    return place / name


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("cuts")
    write(place, FEW, "few.html")
    write(place, [cut(rank) for rank in range(MANY)], "many.html")
    write(place, [cut(rank) for rank in range(600)], "more.html")
    return place


@pytest.fixture
def few(chrome: Browser, folder: Path) -> Iterator[Browser]:
    chrome.open(folder / "few.html")
    yield chrome
    assert chrome.complaints() == []


def heading(browser: Browser, name: str) -> Any:
    found = next(one for one in browser.all(".cut-picker thead button") if one.text == name)
    browser.js("arguments[0].scrollIntoView({block: 'center'})", found)
    return found


def column(browser: Browser, name: str) -> list[str]:
    """What stands in a column, from top to bottom."""
    names = [one.text for one in browser.all(".cut-picker thead th")]
    script = (
        "return [...document.querySelectorAll('.cut-picker tbody tr')].map(row => row.cells[arguments[0]].innerText)"
    )
    found: list[str] = browser.js(script, names.index(name))
    return found


def tick(browser: Browser, lines: str) -> None:
    browser.one(f'[aria-label="Shape the cut in lines {lines}"]').click()


def sums(browser: Browser) -> dict[str, str]:
    script = "return [...document.querySelectorAll('[data-sum]')].map(one => [one.dataset.sum, one.innerText])"
    return dict(browser.js(script))


def assert_sums(browser: Browser, rows: Sequence[CutRow], ticked: Sequence[int]) -> None:
    """The cards against NumPy."""
    is_ticked = np.isin(np.arange(len(rows)), ticked)

    def sides(name: str) -> np.ndarray:
        pairs = [getattr(row, name) for row in rows]
        return np.array([(each.original, each.original if each.emitted is None else each.emitted) for each in pairs])

    def maximum(name: str) -> float:
        both = sides(name)
        return float(np.where(is_ticked, both[:, 1], both[:, 0]).max())

    added_s, added_bytes = (float(np.diff(sides(name))[is_ticked].sum()) for name in ("time_s", "bytes"))
    found = sums(browser)
    assert f"{len(ticked)} of {len(rows)}" in found["count"]
    assert f"{added_s:+.2f} s\n" in found["time"]
    assert f"{added_s / 3.0:+.1f} % of 300.00 s" in found["time"]
    for name, limit in (("residual", 5.0), ("contour", 20.0)):
        assert f"{maximum(name + '_um'):.1f} µm" in found[name]
        assert ("▲ over the limit" in found[name]) == (maximum(name + "_um") > limit)
    assert f"{50.0 + added_bytes / 1e3:.1f} kB" in found["bytes"]


def test_ticks_are_summed_and_named_in_the_command(few: Browser) -> None:
    assert_sums(few, FEW, [0, 3])
    code = few.one(".cut-picker code")
    assert code.text == COMMAND.format(lines="1-9,31-39")
    tick(few, "21-29")
    assert_sums(few, FEW, [0, 2, 3])
    assert code.text == COMMAND.format(lines="1-9,21-29,31-39")
    tick(few, "1-9")
    assert code.text == COMMAND.format(lines="21-29,31-39")
    tick(few, "11-19")
    assert_sums(few, FEW, [1, 2, 3])
    assert "counted as in the original: 1" in few.one(".cut-picker .note").text
    few.one("[data-tick=all]").click()
    assert_sums(few, FEW, [0, 1, 2, 3])
    assert len(few.all(".cut-picker [type=checkbox]")) == 4, "what cannot be shaped has no box"
    few.one("[data-tick=none]").click()
    assert_sums(few, FEW, [])
    assert not code.is_displayed()
    assert "run the original" in few.one(".cut-picker .note").text
    few.one("[data-tick=first]").click()
    assert_sums(few, FEW, [0, 3])


def test_headings_sort_by_pointer_and_by_keys(few: Browser) -> None:
    """Numbers as numbers, T2 before T10, what is not known last in both directions; ticks stay with their rows."""
    heading(few, "gain µm").click()
    gains = [float(text) for text in column(few, "gain µm")[:-1]]
    assert gains == sorted(gains, reverse=True)
    assert column(few, "gain µm")[-1] == ""
    assert few.js("return [...document.querySelectorAll('[aria-sort]')].map(one => one.getAttribute('aria-sort'))") == [
        "descending"
    ]
    ticked = "return [...document.querySelectorAll('tbody :checked')].map(one => one.closest('tr').cells[1].innerText)"
    assert sorted(few.js(ticked)) == ["1-9", "31-39"]
    heading(few, "gain µm").send_keys(Keys.SPACE)
    assert [float(text) for text in column(few, "gain µm")[:-1]] == gains[::-1]
    assert column(few, "gain µm")[-1] == ""
    heading(few, "tool").send_keys(Keys.ENTER)
    assert column(few, "tool") == ["T1", "T2", "T2", "T5", "T10"]
    assert few.js("return document.activeElement.innerText") == "tool"
    tick(few, "1-9")
    assert few.one(".cut-picker code").text == COMMAND.format(lines="31-39")
    heading(few, "lines").click()
    assert column(few, "lines") == ["1-9", "11-19", "21-29", "31-39", "41-49"]
    assert column(few, "shape") == [""] * 5


def test_the_command_is_copied_without_a_clipboard_too(chrome: Browser, folder: Path) -> None:
    end = chrome.before_scripts(
        "Object.defineProperty(navigator, 'clipboard', {value: undefined});"
        "document.execCommand = () => { window.copied = document.activeElement.value; return !window.refused; }"
    )
    chrome.open(folder / "few.html")
    chrome.one(".cut-picker .copy").click()
    assert chrome.js("return window.copied") == COMMAND.format(lines="1-9,31-39")
    chrome.wait("return document.querySelector('.cut-picker .copy').textContent === 'Copied'")
    chrome.js("window.refused = true")
    chrome.one(".cut-picker .copy").click()
    chrome.wait("return document.querySelector('.cut-picker .copy').textContent.startsWith('Selected')")
    assert chrome.js("return getSelection().toString()") == COMMAND.format(lines="1-9,31-39")
    end()


def test_ten_thousand_cuts_have_few_rows_and_no_listeners_of_their_own(chrome: Browser, folder: Path) -> None:
    end = chrome.before_scripts(
        "window.listeners = 0; const add = EventTarget.prototype.addEventListener;"
        "EventTarget.prototype.addEventListener = function (...all) { window.listeners++; add.apply(this, all); }"
    )
    chrome.open(folder / "many.html")
    rows = [cut(rank) for rank in range(MANY)]
    counted = "return document.querySelectorAll('.cut-picker tbody tr').length"
    assert chrome.js(counted) == 500
    assert_sums(chrome, rows, range(0, MANY, 3))
    heading(chrome, "residual original µm").click()
    assert chrome.js(counted) == 500
    largest = sorted((row.residual_um.original or 0.0 for row in rows), reverse=True)[:500]
    assert column(chrome, "residual original µm") == [f"{each:.1f}" for each in largest]
    chrome.one("[data-tick=none]").click()
    chrome.one(".cut-picker tbody [type=checkbox]").click()
    worst = max(range(MANY), key=lambda rank: rows[rank].residual_um.original or 0.0)
    assert_sums(chrome, rows, [worst])
    assert "500 of 10000" in chrome.one(".cut-picker .more").text
    chrome.one(".cut-picker .more button").click()
    assert chrome.js(counted) == MANY
    assert not chrome.one(".cut-picker .more").is_displayed()
    heading(chrome, "lines").click()
    assert column(chrome, "lines")[-1] == "4991-4999"
    assert "500 of 10000" in chrome.one(".cut-picker .more").text
    assert chrome.js("return window.listeners") < 30
    end()


def test_a_command_of_thousands_of_cuts_is_short_enough_to_type(chrome: Browser, folder: Path) -> None:
    """Neighbours that are all ticked become one range; without that it is said that the command is too long."""
    chrome.open(folder / "many.html")
    assert "8191" in chrome.one(".cut-picker .note").text
    chrome.one("[data-tick=all]").click()
    tick(chrome, "41-49")
    assert chrome.one(".cut-picker code").text == COMMAND.format(lines="1-39,51-99999")
    assert chrome.one(".cut-picker .note").text == ""


def test_where_the_script_fails_every_row_is_seen(chrome: Browser, folder: Path) -> None:
    end = chrome.before_scripts("globalThis.matchMedia = () => { throw new Error('none here'); }")
    chrome.open(folder / "more.html")
    assert len([row for row in chrome.all(".cut-picker tbody tr")[-120:] if row.is_displayed()]) == 120
    end()
    chrome.complaints()


def test_without_a_script_it_is_a_table(chrome: Browser, folder: Path) -> None:
    with chrome.without_script():
        chrome.driver.get((folder / "few.html").as_uri())
        assert [row.text.split()[0] for row in chrome.all(".cut-picker tbody tr")] == [
            "{}-{}".format(*row.lines) for row in FEW
        ]
        assert chrome.all(".cut-picker [type=checkbox], .cut-picker thead button") == []
        assert not any(one.is_displayed() for one in chrome.all(".cut-picker button, .cut-picker .cards"))


@pytest.mark.parametrize("page", ["few.html", "more.html"])
def test_on_paper_are_the_shaped_cuts(chrome: Browser, folder: Path, page: str) -> None:
    chrome.open(folder / page)
    heading(chrome, "gain µm").click()
    data = chrome.cdp("Page.printToPDF", preferCSSPageSize=True, printBackground=True)["data"]
    words = "\n".join(one.extract_text() for one in pypdf.PdfReader(io.BytesIO(base64.b64decode(data))).pages)
    shaped = {"1-9", "31-39"} if page == "few.html" else {f"{10 * k + 1}-{10 * k + 9}" for k in range(0, 600, 3)}
    assert set(re.findall(r"^(\d+-\d+) T", words, re.MULTILINE)) == shaped
    assert "Tick all" not in words
    assert "shapegcode convert" not in words
    assert len(chrome.all(".cut-picker tbody tr")) == (len(FEW) if page == "few.html" else 500)


@pytest.mark.parametrize("colours", ["light", "dark"])
def test_it_has_no_barriers(chrome: Browser, folder: Path, colours: str) -> None:
    chrome.open(folder / "few.html")
    if colours == "dark":
        chrome.one("#theme").click()
    heading(chrome, "gain µm").click()
    assert grave(chrome) == []
    assert chrome.one(".light.calm strong").text == "Nothing to do"
    chrome.keep(f"cuts-{colours}", whole=True)
    with chrome.phone():
        assert chrome.js("return document.documentElement.scrollWidth") <= 390
