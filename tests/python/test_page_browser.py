"""Pages of results in a browser, opened from the disk without a network: quiet, complete, on paper, on a phone."""

import base64
import io
import re
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pypdf
import pytest
from selenium.webdriver import Keys

from browser import ROOT, SEEN, Browser, grave
from command import run
from small_page import COMMENT, NAME, convert, marked, write_small


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pages of a small program and of one of 3741 lines."""
    place = tmp_path_factory.mktemp("pages")
    write_small(place)
    (place / "PARALLEL.NC").write_bytes((ROOT / "tests" / "golden" / "programs" / "PARALLEL.NC").read_bytes())
    convert(place, "PARALLEL.NC", "P.NC", "large.html")
    done = run(place, "simulate", NAME, "-m", "vx500", "--html", "beside.html", "--html-script", "beside")
    assert done.returncode == 0, done.stderr
    return place


@pytest.fixture
def small(chrome: Browser, folder: Path) -> Browser:
    chrome.open(folder / "small.html", SEEN)
    return chrome


def test_it_opens_without_network_and_without_complaints(chrome: Browser, folder: Path) -> None:
    for page in ("small.html", "large.html", "beside.html"):
        chrome.open(folder / page, SEEN)
        for part in ("traces", "spectra"):
            chrome.js("document.getElementById(arguments[0]).scrollIntoView()", part)
            chrome.wait("return document.querySelector('#' + arguments[0] + ' .main-svg')", part)
        chrome.js("scrollTo(0, 0)")
        chrome.keep(page.removesuffix(".html"), whole=True)
        assert chrome.complaints() == []
        keys = chrome.js("return [...document.querySelectorAll('body [id]:not(.chart *)')].map(one => one.id)")
        assert len(keys) == len(set(keys)), "each picture has ids of its own"
        asked = chrome.js("return performance.getEntriesByType('resource').map(one => one.name)")
        assert [name for name in asked if not name.startswith(folder.as_uri() + "/plotly-")] == []
    assert len(list(folder.glob("plotly-*.min.js"))) == 1


def test_it_forbids_itself_connections_and_foreign_scripts(small: Browser) -> None:
    refused = small.later(
        "const done = arguments[0]; fetch('https://example.org/').then(() => done('sent'), () => done('no'))"
    )
    assert refused == "no"
    small.js(
        "const s = document.createElement('script'); s.textContent = 'window.foreign = 1'; document.body.append(s)"
    )
    small.js("const i = new Image(); i.src = 'https://example.org/a.png'; document.body.append(i)")
    assert small.js("return window.foreign") is None
    said = "".join(small.complaints())
    assert said.count("Content Security Policy") >= 3


def test_texts_of_others_stay_texts(small: Browser) -> None:
    assert small.js("return window.broken") is None
    assert NAME in small.one("h1").text
    small.one("[data-show=original]").click()
    small.js("document.querySelector('[data-program=original] .lines').scrollTop = 0")
    chosen = small.one("[data-program=original] [data-line='2']")
    assert COMMENT in chosen.text
    assert NAME in small.one("[data-program=original] h3").text
    assert small.all("img") == []
    assert small.js("return JSON.parse(document.getElementById('result').textContent).program") == NAME


@pytest.mark.parametrize("page", ["small.html", "large.html"])
def test_figures_are_those_of_the_json(chrome: Browser, folder: Path, page: str) -> None:
    chrome.open(folder / page)
    report = chrome.js("return JSON.parse(document.getElementById('result').textContent)")
    shown = chrome.js("return [...document.querySelectorAll('[data-json]')].map(e => [{...e.dataset}, e.textContent])")
    places = set()
    for said, text in shown:
        value: Any = report
        for key in said["json"].split("."):
            value = value[int(key)] if isinstance(value, list) else value[key]
        value *= float(said["factor"])
        assert text == f"{value:z.{said['digits']}f}", said
        assert float(said["value"]) == pytest.approx(value, rel=1e-8, abs=1e-9)
        places.add(said["json"].split(".")[0])
    assert {"residual_vibration_um", "contour_error_um", "cycle_time_s", "bytes_emitted", "cases"} <= places
    assert len(shown) > 40
    judged = report["cases"]
    assert len(chrome.all("table.heat tbody tr")) == len(judged)
    for row, case in zip(chrome.all("table.heat tbody tr"), judged, strict=True):
        assert case["name"] in row.text
        assert ("▲" in row.text) == (case["share_of_limit"] > 1.0)


@pytest.mark.parametrize("page", ["small.html", "large.html"])
def test_numbers_of_cards_and_tables_are_in_the_json(chrome: Browser, folder: Path, page: str) -> None:
    """Those that do not say where: as they stand there, or in another unit, or as the change between two."""
    chrome.open(folder / page)

    def leaves(value: Any) -> Iterator[float]:
        if isinstance(value, dict | list):
            for part in value.values() if isinstance(value, dict) else value:
                yield from leaves(part)
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield float(value)

    held = np.unique([*leaves(chrome.js("return JSON.parse(document.getElementById('result').textContent)"))])
    texts = chrome.js(
        "return [...document.querySelectorAll('main .number:not([data-json]), #rests td, #figures td')]"
        ".filter(e => !e.closest('#scene, .bars')).map(e => e.textContent.trim())"
    )
    numbers = [text for text in texts if re.fullmatch(r"-?\d+(\.\d+)?", text)]
    assert len(numbers) > 10
    for text in numbers:
        digits = len(text.partition(".")[2])
        near = [held * factor for factor in (1.0, 1e3, 1e-3, 100.0)]
        assert any((abs(values - float(text)) <= 0.5001 * 10.0**-digits).any() for values in near), text


def test_lines_of_both_programs_stand_for_each_other(chrome: Browser, folder: Path) -> None:
    """What was emitted keeps the N words of the original, so that they tell which lines belong together."""
    chrome.open(folder / "large.html", SEEN)
    chrome.one("[data-show=both]").click()
    numbers = re.compile(r"N(\d+)")
    emitted = (folder / "P.NC").read_text().splitlines()
    ranked = {int(found[1]): rank for rank, line in enumerate(emitted, 1) if (found := numbers.match(line))}
    tried = 0
    for number in range(100, 18000, 1345):
        if number not in ranked:
            continue
        chrome.js("scenePage.lists[1].onPick(scenePage.motions[1], arguments[0])", ranked[number])
        place = int(numbers.match(marked(chrome, "original")[1])[1])  # type: ignore[index]
        # An emitted line that bears a number may begin within its block: one block is 5.
        assert abs(place - number) <= 10
        tried += 1
    assert tried > 8
    assert len(chrome.all(".line")) < 150, "only what is seen stands in the page"
    chrome.one("[data-program=emitted] .lines").send_keys(Keys.END)
    assert marked(chrome, "emitted")[0] == len(emitted)


def test_it_is_small(folder: Path) -> None:
    assert (folder / "large.html").stat().st_size <= 8e6
    text = (folder / "large.html").read_text()
    script = re.search(r'<script type="text/plain" id="plotly-data">[^<]*</script>', text)
    assert len(text.encode()) - len(script[0]) <= 3e6


def test_without_a_script_it_is_read(chrome: Browser, folder: Path) -> None:
    with chrome.without_script():
        chrome.driver.get((folder / "small.html").as_uri())
        words = chrome.one("body").text
        chrome.keep("without-script")
        assert chrome.one("#theme").is_displayed() is False
    for part in ("Why:", "Before and after", "cycle time", "Run sheet", "JavaScript is off in this browser"):
        assert part in words
    assert "loading" not in words


def test_it_says_that_it_is_loading_until_it_has_loaded(chrome: Browser, folder: Path) -> None:
    said = "return document.getElementById('scene-message').textContent"
    end = chrome.before_scripts("globalThis.requestAnimationFrame = () => 0")
    chrome.open(folder / "small.html")
    assert chrome.js(said + ".startsWith('The motion is still loading')")
    assert chrome.one("#scene-message").is_displayed()
    assert "JavaScript is off" not in chrome.one("#scene").text
    end()
    end = chrome.before_scripts("globalThis.matchMedia = () => { throw new Error('none here'); }")
    chrome.open(folder / "small.html")
    assert "does not run in this browser" in chrome.js(said)
    assert "none here" in chrome.js(said)
    end()
    chrome.complaints()


def test_an_old_browser_is_told_what_it_lacks(chrome: Browser, folder: Path) -> None:
    end = chrome.before_scripts("delete globalThis.DecompressionStream")
    chrome.open(folder / "small.html", "return document.getElementById('scene-message').innerText.includes('cannot')")
    assert "DecompressionStream" in chrome.one("#scene-message").text
    assert not chrome.one("#scene-body").is_displayed()
    end()
    chrome.complaints()


def test_curves_say_which_file_they_miss(chrome: Browser, folder: Path, tmp_path: Path) -> None:
    (tmp_path / "moved.html").write_bytes((folder / "beside.html").read_bytes())
    chrome.open(tmp_path / "moved.html", SEEN)
    chrome.js("document.getElementById('traces').scrollIntoView()")
    chrome.wait("return document.getElementById('traces').innerText.includes('beside this page')")
    chrome.complaints()


def test_on_paper_it_has_four_pages(chrome: Browser, folder: Path) -> None:
    chrome.open(folder / "large.html", SEEN)
    data = chrome.cdp("Page.printToPDF", preferCSSPageSize=True, printBackground=True)["data"]
    paper = pypdf.PdfReader(io.BytesIO(base64.b64decode(data)))
    pages = [unicodedata.normalize("NFKC", page.extract_text()) for page in paper.pages]
    assert len(pages) <= 4
    (sheet,) = [page for page in pages if "Run sheet" in page]
    assert "Before and after" not in sheet
    assert "first run" in sheet
    assert any("Path from above" in page for page in pages)
    assert not any("Colour by" in page or "Play" in page for page in pages)
    wide, high = (float(side) / 72.0 * 25.4 for side in paper.pages[0].mediabox[2:])
    assert (wide, high) == pytest.approx((210.0, 297.0), abs=1.0)


def test_on_a_phone_it_does_not_scroll_sideways(chrome: Browser, folder: Path) -> None:
    with chrome.phone():
        chrome.open(folder / "small.html", SEEN)
        chrome.js("document.getElementById('traces').scrollIntoView()")
        chrome.wait("return document.querySelector('#traces .main-svg')")
        chrome.js("scrollTo(0, 0)")
        assert chrome.js("return document.documentElement.scrollWidth") <= 390
        chrome.keep("phone", whole=True)


def test_dark_colours_by_system_and_by_button(chrome: Browser, folder: Path) -> None:
    ground = "return getComputedStyle(document.body).backgroundColor"
    with chrome.dark():
        chrome.open(folder / "small.html", SEEN)
        assert chrome.js(ground) == "rgb(20, 23, 27)"
        chrome.keep("dark")
        chrome.one("#theme").click()
        assert chrome.js(ground) == "rgb(255, 255, 255)"
    chrome.open(folder / "small.html", SEEN)
    assert chrome.js(ground) == "rgb(255, 255, 255)"


@pytest.mark.parametrize("colours", ["light", "dark"])
def test_it_has_no_barriers(chrome: Browser, folder: Path, colours: str) -> None:
    chrome.open(folder / "small.html", SEEN)
    if colours == "dark":
        chrome.one("#theme").click()
    chrome.js("document.getElementById('traces').scrollIntoView()")
    chrome.wait("return document.querySelector('#spectra .main-svg')")
    chrome.js("scrollTo(0, 0)")
    assert grave(chrome) == []
    chrome.complaints()


@pytest.mark.parametrize(
    "words",
    [("time", NAME, "-m", "vx500"), ("check", NAME, "-m", "vx500"), ("shaper", "--mode", "46:0.02"), ("demo", "path")],
    ids=lambda words: words[0],
)
def test_pages_of_other_results(chrome: Browser, folder: Path, words: tuple[str, ...]) -> None:
    page = folder / f"{words[0]}.html"
    done = run(folder, *words, "--html", page.name)
    assert done.returncode in (0, 1), done.stderr
    chrome.open(page)
    if chrome.all("#scene-head"):
        chrome.wait(SEEN)
    assert chrome.complaints() == []
    assert chrome.one(".light strong").text in ("Go ahead", "Check first", "Do not use")
    chrome.keep(words[0], whole=True)
    data = chrome.cdp("Page.printToPDF", preferCSSPageSize=True, printBackground=True)["data"]
    assert len(pypdf.PdfReader(io.BytesIO(base64.b64decode(data))).pages) <= 4
    assert grave(chrome) == []
    with chrome.phone():
        assert chrome.js("return document.documentElement.scrollWidth") <= 390
    chrome.complaints()
