"""Writes docs/images/page-*.png: what a page of a result looks like in Debian's Chromium. `write_page_pictures.py`.

The page is that of a conversion of tests/golden/programs/PARALLEL.NC for vx500. Run it when the page looks otherwise.
"""

from __future__ import annotations

import base64
import io
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image

import shapegcode as sg

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "python"))
from browser import SEEN, Browser, chromium  # noqa: E402

FOLDER = ROOT / "docs" / "images"
MAX_BYTES = 150_000


def write(browser: Browser, name: str, box: dict[str, float]) -> None:
    """A rectangle of the page, in as many colours as fit the size."""
    clip = {**box, "scale": 1}
    data = browser.cdp("Page.captureScreenshot", captureBeyondViewport=True, format="png", clip=clip)["data"]
    picture = Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")
    for colours in (256, 128, 64, 32):
        stream = io.BytesIO()
        picture.quantize(colours, dither=Image.Dither.NONE).save(stream, format="png", optimize=True)
        if len(stream.getvalue()) <= MAX_BYTES:
            break
    (FOLDER / f"page-{name}.png").write_bytes(stream.getvalue())
    print(f"page-{name}.png: {len(stream.getvalue())} bytes, {colours} colours")


def box_of(browser: Browser, first: str, last: str | None = None, *, margin: float = 8.0) -> dict[str, float]:
    """From the top of an element to the bottom of another one."""
    top, bottom = (
        browser.js(
            "const b = document.querySelector(arguments[0]).getBoundingClientRect(); return [b.top, b.bottom]", each
        )
        for each in (first, last or first)
    )
    shift: Any = browser.js("return scrollY")
    return {"x": 0, "y": top[0] + shift - margin, "width": 1100, "height": bottom[1] - top[0] + 2.0 * margin}


def main() -> int:
    with tempfile.TemporaryDirectory() as place, chromium("--window-size=1100,1000") as browser:
        machine = sg.Machine.load("vx500")
        page = Path(place) / "page.html"
        sg.convert(ROOT / "tests" / "golden" / "programs" / "PARALLEL.NC", machine).report(page)
        browser.open(page, SEEN)
        browser.js("document.querySelector('nav').style.position = 'static'")
        for part in ("traces", "spectra"):
            browser.js("document.getElementById(arguments[0]).scrollIntoView()", part)
            browser.wait("return document.querySelector('#' + arguments[0] + ' .main-svg')", part)
        browser.js("scrollTo(0, 0)")
        write(browser, "top", box_of(browser, "header", "#next"))
        browser.one("[data-show=both]").click()
        browser.js("scenePage.seek(scenePage.chief, 77.4)")
        browser.js("scenePage.stage.drawNow()")
        write(browser, "motion", box_of(browser, "#scene h2", "#reading"))
        write(browser, "curves", box_of(browser, "#traces", margin=0.0))
        write(browser, "spectra", box_of(browser, "#spectra", margin=0.0))
        browser.one("#view-plan").click()
        browser.one("[data-show=original]").click()
        browser.js(
            "const c = document.getElementById('colour'); c.value = 'deviation'; c.dispatchEvent(new Event('change'))"
        )
        browser.js("scenePage.stage.camera.zoom(3.2, [230, 60]); scenePage.stage.drawNow()")
        write(browser, "plan", box_of(browser, ".stage"))
        write(browser, "conditions", box_of(browser, "#cases"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
