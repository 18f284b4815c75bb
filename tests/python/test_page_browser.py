"""Pages of results in a browser, opened from the disk without a network: what one clicks does what it says."""

from __future__ import annotations

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
from selenium.webdriver import ActionChains, Keys

import shapegcode as sg
from browser import ROOT, Browser, chromium
from command import run
from shapegcode.model.scene import scene_of
from shapegcode.program import Program

# A mode along X: the corner at X30 Y40 shakes. The comment and the name of the file would end or begin an element.
COMMENT = "(</script><script>window.broken=1</script><img src=x onerror=window.broken=2>)"
TEXT = f"%\nO0001 {COMMENT}\nG90 G21 G17 G54\nG0 X0 Y0 Z5.\nG1 Z0. F3000.\nX30. Y40.\nX60. Y0.\nG0 Z5.\nM30\n%\n"
NAME = "<img src=x onerror=window.broken=3>.nc"
LINES = TEXT.splitlines()
UP, DOWN = LINES.index("X30. Y40.") + 1, LINES.index("X60. Y0.") + 1
SEEN = "return document.getElementById('scene-body') && !document.getElementById('scene-body').hidden"


@pytest.fixture(scope="module")
def chrome() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pages of a small program and of one of 3741 lines."""
    place = tmp_path_factory.mktemp("pages")
    (place / NAME).write_text(TEXT)
    (place / "PARALLEL.NC").write_bytes((ROOT / "tests" / "golden" / "programs" / "PARALLEL.NC").read_bytes())
    words = ("convert", "-m", "vx500", "--set", "tolerance.contour_um=20")
    for name, out, html in ((NAME, "out.nc", "small"), ("PARALLEL.NC", "P.NC", "large")):
        done = run(place, *words, name, "-o", out, "--html", f"{html}.html")
        assert done.returncode == 0, done.stderr
    done = run(place, "simulate", NAME, "-m", "vx500", "--html", "beside.html", "--html-script", "beside")
    assert done.returncode == 0, done.stderr
    return place


@pytest.fixture
def small(chrome: Browser, folder: Path) -> Browser:
    """The page of the small program, seen from above."""
    chrome.open(folder / "small.html", SEEN)
    chrome.one("#view-plan").click()
    chrome.one("[data-show=original]").click()
    return chrome


MARKED = """
const list = document.querySelector(`[data-program=${arguments[0]}] .lines`);
const row = list.querySelector("[aria-selected=true]");
if (!row) return null;
const [seen, frame] = [row.getBoundingClientRect(), list.getBoundingClientRect()];
const count = row.querySelector(".count").textContent;
return seen.top >= frame.top - 1 && seen.bottom <= frame.bottom + 1
  ? [Number(count), row.textContent.slice(count.length).trim()] : null;
"""


def marked(browser: Browser, program: str) -> tuple[int, str]:
    """Number and text of the marked line; the list has scrolled, so that it is in sight."""
    number, text = browser.wait(MARKED, program)
    return number, text


def reading(browser: Browser, program: str = "original") -> dict[str, str]:
    """What is said of the place of the marker."""
    table = browser.js(
        "return [...document.querySelectorAll('#reading tr')].map(r => [...r.cells].map(c => c.innerText))"
    )
    return next(dict(zip(table[0], row, strict=True)) for row in table[1:] if row[0] == program)


def pixel(browser: Browser, x: float, y: float) -> tuple[float, float]:
    """Where a place of the part is drawn, seen from above, from the middle of the picture."""
    camera = browser.js("const {centre, scale, pan} = scenePage.stage.camera; return {centre, scale, pan}")
    return (
        (x - camera["centre"][0]) * camera["scale"] + camera["pan"][0],
        -(y - camera["centre"][1]) * camera["scale"] - camera["pan"][1],
    )


def click(browser: Browser, x: float, y: float) -> None:
    """On the picture of the path, at a place of the part."""
    view = browser.one("#view")
    browser.js("arguments[0].scrollIntoView({block: 'center'})", view)
    right, down = pixel(browser, x, y)
    ActionChains(browser.driver, duration=0).move_to_element_with_offset(
        view, round(right), round(down)
    ).click().perform()


def set_slider(browser: Browser, name: str, value: float) -> None:
    script = "const it = document.getElementById(arguments[0]); it.value = arguments[1]; "
    script += "it.dispatchEvent(new Event('input'))"
    browser.js(script, name, value)


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
    """A comment and a file name that are HTML are read as they stand, and nothing of them runs."""
    assert small.js("return window.broken") is None
    assert NAME in small.one("h1").text
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


def test_a_click_on_the_path_finds_the_line(small: Browser) -> None:
    for x, y, line in ((15.0, 20.0, UP), (45.0, 20.0, DOWN)):
        click(small, x, y)
        assert marked(small, "original") == (line, LINES[line - 1])
        place = reading(small)
        assert float(place["X mm"]) == pytest.approx(x, abs=0.3)
        assert float(place["Y mm"]) == pytest.approx(y, abs=0.3)
        assert int(place["line"]) == line
    small.keep("click-on-the-path")
    before = reading(small)
    click(small, 30.0, 10.0)
    assert reading(small) == before, "there is no path"


def test_a_click_on_a_line_finds_its_place(small: Browser) -> None:
    """Of the original and of what was emitted; keys go from line to line."""
    small.one("#magnify").send_keys(Keys.HOME)
    small.one(f"[data-program=original] [data-line='{DOWN}']").click()
    assert marked(small, "original") == (DOWN, LINES[DOWN - 1])
    place = reading(small)
    assert (float(place["X mm"]), float(place["Y mm"])) == pytest.approx((30.0, 40.0), abs=0.5)
    ring = small.js("const s = scenePage.stage, m = s.marks.find(m => m.chief); return s.placeOf(m.motion, m.here)")
    middle = [half / 2 for half in small.js("return scenePage.stage.camera.size")]
    right, down = pixel(small, float(place["X mm"]), float(place["Y mm"]))
    assert ring == pytest.approx([middle[0] + right, middle[1] + down], abs=1.5)
    small.one("[data-program=original] .lines").send_keys(Keys.ARROW_UP)
    assert marked(small, "original")[0] == UP
    small.one("[data-program=original] .lines").send_keys(Keys.END)
    assert marked(small, "original")[0] == len(LINES)

    small.one("[data-show=both]").click()
    small.one(f"[data-program=original] [data-line='{DOWN}']").click()
    here, there = reading(small, "original"), reading(small, "emitted")
    for axis in ("X mm", "Y mm"):
        assert float(there[axis]) == pytest.approx(float(here[axis]), abs=0.5)
    assert int(there["line"]) == marked(small, "emitted")[0]


def test_programs_are_shown_one_or_both(small: Browser) -> None:
    """In the picture, in the texts and in the figures."""

    def colours() -> tuple[int, int]:
        seen = small.pixels("#view")
        orange = (abs(seen - [0xF2, 0x8E, 0x3C]) < 12).all(axis=2)
        blue = (abs(seen - [0x56, 0xB4, 0xE9]) < 12).all(axis=2)
        return int(orange.sum()), int(blue.sum())

    small.js("scenePage.stage.marks = []")
    for show, programs in (("original", ["original"]), ("emitted", ["emitted"]), ("both", ["original", "emitted"])):
        small.one(f"[data-show={show}]").click()
        if show != "both":
            small.js(
                "const c = document.getElementById('colour'); c.value = 'program'; c.dispatchEvent(new Event('change'))"
            )
        small.js("scenePage.stage.marks = []; scenePage.stage.drawNow()")
        orange, blue = colours()
        assert (orange > 200) == ("original" in programs)
        assert (blue > 200) == ("emitted" in programs)
        assert [one.get_attribute("data-program") for one in small.all(".program:not([hidden])")] == programs
        pressed = [one.get_attribute("data-show") for one in small.all("#show [aria-pressed=true]")]
        assert pressed == [show]


def test_deviation_is_drawn_as_large_as_it_says(small: Browser, folder: Path) -> None:
    """The tip of the corner moves by the factor: the table shoots beyond it."""

    def top() -> int:
        small.js("scenePage.stage.marks = []; scenePage.stage.drawNow()")
        # Letters are grey.
        return int(np.flatnonzero((np.ptp(small.pixels("#view"), axis=2) > 60).any(axis=1))[0])

    small.one("#magnify").send_keys(Keys.HOME)
    assert small.one("#magnify-said").text == "×1"
    plain = top()
    small.one("#magnify").send_keys(Keys.ARROW_RIGHT * 7)
    assert small.one("#magnify-said").text == "×200"
    machine = sg.Machine.load("vx500")
    motion = scene_of(Program.read(folder / NAME, machine), machine).variants[0]
    y = motion.command_mm[:, 1] + 1e-3 * motion.deviation_um[:, 1] * np.array([[1.0], [200.0]])
    grown = float(np.diff(y.max(axis=1))[0]) * small.js("return scenePage.stage.camera.scale")
    assert grown > 5
    assert plain - top() == pytest.approx(grown, abs=2.5)


def test_amounts_have_colours_units_and_words(small: Browser) -> None:
    options = small.js("return [...document.getElementById('colour').options].map(o => [o.value, o.text])")
    assert {"deviation", "vibration", "speed", "acceleration", "block_s"} <= {value for value, _ in options}
    seen = set()
    for value, text in options[:-1]:
        small.js(
            "const c = document.getElementById('colour'); c.value = arguments[0]; c.dispatchEvent(new Event('change'))",
            value,
        )
        assert text in small.one("#colours").text
        assert len(small.one("#colour-how").text) > 20
        assert re.search(r", (µm|mm/min|m/s²|s|N)$", text)
        small.js("scenePage.stage.drawNow()")
        seen.add(small.pixels("#view").tobytes())
    assert len(seen) == len(options) - 1


def test_the_slider_of_time_moves_the_marker(small: Browser) -> None:
    small.one(f"[data-program=original] [data-line='{UP}']").click()
    slider = small.one("#clock")
    begin = float(slider.get_attribute("value"))
    slider.send_keys(Keys.ARROW_RIGHT)
    after = float(small.one("#clock").get_attribute("value"))
    assert after > begin
    assert reading(small)["time s"] == f"{after:.3f}"
    assert small.one("#clock-said").text.startswith(f"{after:.3f} s")
    set_slider(small, "clock", 1e9)
    assert marked(small, "original")[1] in ("G0 Z5.", "M30")
    small.one("#block-back").click()
    assert reading(small)["block"] != ""
    small.js("document.getElementById('pace').value = 500")
    small.one("#play").click()
    small.wait("return scenePage.playing === false")
    small.js("document.getElementById('pace').value = 1")
    set_slider(small, "clock", 0.0)
    small.one("#play").click()
    small.wait("return scenePage.time > 0.05")
    small.js("scenePage.stop()")
    assert small.one("#play").text == "▶ Play"
    assert reading(small)["time s"] == f"{small.js('return scenePage.time'):.3f}"


def test_pointer_wheel_and_keys_turn_and_zoom(small: Browser) -> None:
    small.one("#view-3d").click()
    state = "const {yaw, pitch, scale} = scenePage.stage.camera; return [yaw, pitch, scale]"
    first = small.js(state)
    view = small.one("#view")
    ActionChains(small.driver, duration=0).click_and_hold(view).move_by_offset(60, 30).release().perform()
    turned = small.js(state)
    assert turned[0] != first[0]
    assert turned[1] != first[1]
    view.send_keys(Keys.ARROW_LEFT, "+")
    keyed = small.js(state)
    assert keyed[0] != turned[0]
    assert keyed[2] == pytest.approx(turned[2] * 1.25)
    small.one("#view-fit").click()
    assert small.js(state)[2] < keyed[2]
    small.keep("motion-3d")


def test_curves_zoom_together_and_set_the_marker(small: Browser) -> None:
    small.one("[data-show=both]").click()
    small.js("document.getElementById('traces').scrollIntoView()")
    small.wait("return document.querySelector('#traces .nsewdrag') && document.querySelector('#traces .cursor')")
    titles = small.js("const l = document.getElementById('traces').layout; return Object.keys(l).filter(k => "
                      "/axis/.test(k)).map(k => l[k].title.text)")  # fmt: skip
    assert set(titles) == {"time s", "deviation from<br>the path µm", "X mm", "Y mm", "Z mm"}
    buttons = small.js("return [...document.querySelectorAll('#traces .modebar-btn')].map(b => b.dataset.title)")
    assert buttons == ["Download plot as a PNG", "Zoom", "Pan", "Reset axes"], "none sends the data away"
    spans = "return document.getElementById('traces').data.map(one => [one.x[0], one.x[one.x.length - 1]])"
    whole = small.js(spans)
    plot = small.one("#traces .nsewdrag")
    wide = plot.rect["width"]
    drag = ActionChains(small.driver, duration=50).move_to_element_with_offset(plot, round(-0.25 * wide), 0)
    drag.click_and_hold().move_by_offset(round(0.5 * wide), 0).release().perform()
    small.wait("return document.getElementById('traces').layout.xaxis.range[0] > 0")
    small.wait("return document.getElementById('traces').data[0].x[0] > 0")
    low, high = small.js("return document.getElementById('traces').layout.xaxis.range")
    assert high - low == pytest.approx(0.5 * max(end for _, end in whole), rel=0.15)
    assert all(begin <= low + 0.2 for begin, _ in small.js(spans))
    before = small.js("return scenePage.time")
    ActionChains(small.driver, duration=0).move_to_element(plot).perform()
    small.wait("return document.querySelector('#traces .hovertext')")
    ActionChains(small.driver, duration=0).click().perform()
    small.wait("return scenePage.time !== arguments[0]", before)
    assert small.js("return scenePage.time") == pytest.approx((low + high) / 2, abs=0.05 * (high - low))
    small.keep("curves")
    cursor = small.one("#traces .cursor").rect["x"]
    assert cursor == pytest.approx(small.one("#traces .nsewdrag").rect["x"] + wide / 2, abs=0.06 * wide)
    ActionChains(small.driver, duration=0).move_to_element(plot).double_click().perform()
    small.wait("return document.getElementById('traces').data[0].x[0] === 0")
    assert small.js(spans) == whole


def test_spectra_name_the_modes_in_hertz(small: Browser) -> None:
    small.js("document.getElementById('spectra').scrollIntoView()")
    small.wait("return document.querySelector('#spectra .annotation')")
    # The modes of the built-in machine.
    assert small.js("return document.getElementById('spectra').layout.shapes.map(s => s.x0)") == [46.0, 131.0]
    assert all("Hz" in one.text for one in small.all("#spectra .annotation"))
    titles = small.js("const l = document.getElementById('spectra').layout; return Object.keys(l).filter(k => "
                      "/axis/.test(k)).map(k => l[k].title.text)")  # fmt: skip
    assert {"frequency Hz", "X m/s²/√Hz", "Y m/s²/√Hz"} <= set(titles)
    small.keep("spectra")


def test_lines_of_both_programs_stand_for_each_other(chrome: Browser, folder: Path) -> None:
    """What was emitted keeps the N words of the original, so that they tell which lines belong together."""
    chrome.open(folder / "large.html", SEEN)
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
    assert script is not None
    assert len(text.encode()) - len(script[0]) <= 3e6


def test_without_a_script_it_is_read(chrome: Browser, folder: Path) -> None:
    with chrome.without_script():
        chrome.driver.get((folder / "small.html").as_uri())
        words = chrome.one("body").text
        chrome.keep("without-script")
        assert chrome.one("#theme").is_displayed() is False
    for part in ("Why:", "What it gains", "cycle time", "Run sheet", "drawn by a script, which is not running"):
        assert part in words


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
    """The run sheet is one of them, by itself; the path is drawn on another."""
    chrome.open(folder / "large.html", SEEN)
    data = chrome.cdp("Page.printToPDF", preferCSSPageSize=True, printBackground=True)["data"]
    paper = pypdf.PdfReader(io.BytesIO(base64.b64decode(data)))
    pages = [unicodedata.normalize("NFKC", page.extract_text()) for page in paper.pages]
    assert len(pages) <= 4
    (sheet,) = [page for page in pages if "Run sheet" in page]
    assert "What it gains" not in sheet
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


def grave(browser: Browser) -> list[str]:
    """Serious and critical findings of axe-core on the page that is open."""
    script = ROOT / ".cache" / "axe" / "node_modules" / "axe-core" / "axe.min.js"
    assert script.is_file(), "tests/tools/fetch_axe.sh brings it"
    browser.js("document.querySelectorAll('details').forEach(one => { one.open = true; })")
    browser.js(script.read_text(encoding="utf-8"))
    found = browser.later("axe.run(document, {resultTypes: ['violations']}).then(arguments[0])")
    assert len(found["passes"]) > 10
    return [
        f"{one['id']}: {one['help']}: {node['html'][:160]} {node['failureSummary']}"
        for one in found["violations"] if one["impact"] in ("serious", "critical")
        for node in one["nodes"]
    ]  # fmt: skip


@pytest.mark.parametrize("colours", ["light", "dark"])
def test_it_has_no_barriers(chrome: Browser, folder: Path, colours: str) -> None:
    """By axe-core: nothing serious, nothing critical."""
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
    assert chrome.one(".light strong").text in ("Go ahead", "Heed first", "Do not use")
    chrome.keep(words[0], whole=True)
    data = chrome.cdp("Page.printToPDF", preferCSSPageSize=True, printBackground=True)["data"]
    assert len(pypdf.PdfReader(io.BytesIO(base64.b64decode(data))).pages) <= 4
    assert grave(chrome) == []
    with chrome.phone():
        assert chrome.js("return document.documentElement.scrollWidth") <= 390
    chrome.complaints()
