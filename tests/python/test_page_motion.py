"""Motion on a page, in a browser: path, texts, sliders and curves show the same place, and what one clicks finds it."""

import re
from pathlib import Path

import numpy as np
import pytest
from selenium.webdriver import ActionChains, Keys

import shapegcode as sg
from browser import SEEN, Browser
from shapegcode import _core
from shapegcode.model.scene import scene_of
from shapegcode.model.stream import stream
from shapegcode.program import Program
from shapegcode.program.compensation import paired_regions
from small_page import DOWN, LINES, NAME, UP, marked, write_small


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("motion")
    write_small(place)
    return place


@pytest.fixture
def small(chrome: Browser, folder: Path) -> Browser:
    """The page of the small program, seen from above."""
    chrome.open(folder / "small.html", SEEN)
    chrome.one("#view-plan").click()
    chrome.one("[data-show=original]").click()
    return chrome


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


def largest_deviation_um(program: Program, nominal: Program, machine: sg.Machine) -> tuple[float, int, float]:
    """In the one cut of a program, from the path, with its line; and from table to command anywhere."""
    ((cut, own),) = paired_regions(program, nominal)
    follower = _core.PathFollower(own.path)
    largest, line, everywhere = 0.0, 0, 0.0
    for chunk in stream(program, machine):
        everywhere = max(everywhere, float(np.linalg.norm(chunk.error_mm, axis=1).max()) * 1e3)
        inside = (chunk.line >= cut.first_line) & (chunk.line <= cut.last_line)
        if inside.any():
            off = np.linalg.norm(follower.step(chunk.command_mm[inside], chunk.response_mm[inside]), axis=1) * 1e3
            if off.max() > largest:
                largest, line = float(off.max()), int(chunk.line[inside][off.argmax()])
    return largest, line, everywhere


def test_it_opens_at_the_largest_deviation_of_what_was_emitted(chrome: Browser, folder: Path) -> None:
    """Of its cuts, not of a rapid, which nobody measures; against the samples that the model gives."""
    chrome.open(folder / "small.html", SEEN)
    assert [one.get_attribute("data-show") for one in chrome.all("#show [aria-pressed=true]")] == ["emitted"]
    assert chrome.one("#colour").get_attribute("value") == "deviation"
    assert "deviation from the path" in chrome.one("#colours").text
    machine = sg.Machine.load("vx500")
    original, emitted = (Program.read(folder / name, machine) for name in (NAME, "out.nc"))
    largest, line, everywhere = largest_deviation_um(emitted, original, machine)
    assert everywhere > 1.2 * largest, "a rapid deviates more: it must not be taken"
    place = reading(chrome, "emitted")
    assert float(place["deviation from the path µm"]) == pytest.approx(largest, rel=0.01)
    assert int(place["line"]) == line == marked(chrome, "emitted")[0]
    assert f"at line {line}," in chrome.one("#worst-said").text
    assert float(chrome.one("#clock").get_attribute("value")) == pytest.approx(float(place["time s"]), abs=2e-3)
    high = re.search(r"([\d.]+)\s*\(middle", chrome.one("#colours").text)
    of_both = max(largest, largest_deviation_um(original, original, machine)[0])
    assert float(high[1]) == pytest.approx(of_both, rel=0.01), "colours are for the cuts of both"
    chrome.keep("worst-spot")
    set_slider(chrome, "clock", 0.0)
    chrome.one("#worst").click()
    assert int(reading(chrome, "emitted")["line"]) == line
    chrome.one("[data-show=both]").click()
    assert marked(chrome, "original")[1] in LINES, "it has scrolled while it was hidden"


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
    small.one("#magnify").send_keys(Keys.HOME)
    small.click_line("original", DOWN)
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
    small.click_line("original", DOWN)
    here, there = reading(small, "original"), reading(small, "emitted")
    for axis in ("X mm", "Y mm"):
        assert float(there[axis]) == pytest.approx(float(here[axis]), abs=0.5)
    assert int(there["line"]) == marked(small, "emitted")[0]


def test_programs_are_shown_one_or_both(small: Browser) -> None:
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
    small.click_line("original", UP)
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
    # A click goes where Plotly saw the pointer last, which may still be the end of the drag.
    near = "const at = document.getElementById('traces')._hoverdata; return at && Math.abs(at[0].x - arguments[0]) < %s"
    small.wait(near % (0.05 * (high - low)), (low + high) / 2)
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
