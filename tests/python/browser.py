"""Debian's Chromium for tests: without a network, without a display, without a graphics card."""

from __future__ import annotations

import base64
import io
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from selenium import webdriver
from selenium.common.exceptions import StaleElementReferenceException
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.ui import WebDriverWait

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "build" / "report_pages"
"""Where tests leave what they saw."""

SEEN = "return document.getElementById('scene-body') && !document.getElementById('scene-body').hidden"
"""The motion of a page is there."""

_AT_MOST_S = 30


@contextmanager
def chromium(*options: str) -> Iterator[Browser]:
    """A browser with an empty profile; `make test` installs it."""
    found = {name: shutil.which(name) for name in ("chromium", "chromedriver")}
    assert all(found.values()), f"install the Debian packages chromium and chromium-driver: {found}"
    wanted = webdriver.ChromeOptions()
    wanted.binary_location = str(found["chromium"])
    for option in (
        "--headless=new",
        "--no-sandbox",  # has no use for root, which a container's tests are
        "--disable-dev-shm-usage",
        "--host-resolver-rules=MAP * ~NOTFOUND",  # no name has an address
        "--hide-scrollbars",
        "--window-size=1280,1000",
        "--force-device-scale-factor=1",
        *options,
    ):
        wanted.add_argument(option)
    wanted.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=wanted, service=webdriver.ChromeService(str(found["chromedriver"])))
    try:
        yield Browser(driver)
    finally:
        driver.quit()


class Browser:
    """A driver with the few words that the tests need."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver = driver

    def open(self, page: Path, ready: str = "return document.readyState === 'complete'") -> None:
        """Open a file and wait."""
        self.driver.get(page.resolve().as_uri())
        self.wait(ready)

    def wait(self, condition: str, *arguments: Any) -> Any:
        """Until a script returns something true."""
        return WebDriverWait(self.driver, _AT_MOST_S, poll_frequency=0.05).until(
            lambda _: self.js(condition, *arguments), condition
        )

    def js(self, script: str, *arguments: Any) -> Any:
        return self.driver.execute_script(script, *arguments)

    def later(self, script: str) -> Any:
        """What a script gives to its last argument."""
        self.driver.set_script_timeout(_AT_MOST_S)
        return self.driver.execute_async_script(script)

    def cdp(self, command: str, **arguments: Any) -> Any:
        return self.driver.execute_cdp_cmd(command, arguments)

    def one(self, selector: str) -> WebElement:
        return self.driver.find_element("css selector", selector)

    def click_line(self, program: str, line: int) -> None:
        """On a line of a program's text, whose rows are built again in a later frame where the text was scrolled."""

        def clicked(_: webdriver.Chrome) -> bool:
            self.one(f"[data-program={program}] [data-line='{line}']").click()
            return True

        WebDriverWait(
            self.driver, _AT_MOST_S, poll_frequency=0.05, ignored_exceptions=[StaleElementReferenceException]
        ).until(clicked)

    def all(self, selector: str) -> list[WebElement]:
        return self.driver.find_elements("css selector", selector)

    def complaints(self) -> list[str]:
        """What stands in the console since it was read last."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def pixels(self, selector: str) -> np.ndarray:
        """A part of the page as it is seen, (rows, columns, 3)."""
        return np.asarray(Image.open(io.BytesIO(self.one(selector).screenshot_as_png)).convert("RGB")).astype(int)

    def keep(self, name: str, *, whole: bool = False) -> None:
        """Leave a picture for people."""
        PICTURES.mkdir(parents=True, exist_ok=True)
        data = self.cdp("Page.captureScreenshot", captureBeyondViewport=whole, format="png")["data"]
        (PICTURES / f"{name}.png").write_bytes(base64.b64decode(data))

    @contextmanager
    def changed(self, on: tuple[str, dict[str, Any]], off: tuple[str, dict[str, Any]]) -> Iterator[None]:
        """Something of the browser for a while."""
        self.cdp(on[0], **on[1])
        try:
            yield
        finally:
            self.cdp(off[0], **off[1])

    def dark(self) -> Any:
        def said(value: str) -> dict[str, Any]:
            return {"features": [{"name": "prefers-color-scheme", "value": value}]}

        name = "Emulation.setEmulatedMedia"
        return self.changed((name, said("dark")), (name, said("light")))

    def phone(self) -> Any:
        size = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
        return self.changed(("Emulation.setDeviceMetricsOverride", size), ("Emulation.clearDeviceMetricsOverride", {}))

    def without_script(self) -> Any:
        name = "Emulation.setScriptExecutionDisabled"
        return self.changed((name, {"value": True}), (name, {"value": False}))

    def before_scripts(self, source: str) -> Callable[[], None]:
        """Run a script before those of the pages; what is given back ends it."""
        key = self.cdp("Page.addScriptToEvaluateOnNewDocument", source=source)["identifier"]
        return lambda: self.cdp("Page.removeScriptToEvaluateOnNewDocument", identifier=key)


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
