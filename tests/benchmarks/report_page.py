"""How large a page of a result is, how soon it is seen, and how fast its path turns, by the browser's own trace.

    .venv/bin/python tests/benchmarks/report_page.py [--program PART.NC] [--repetitions N] [--json FILE]

The page is that of a conversion of the program on vx500, with both programs shown. The browser is Debian's Chromium
without a graphics card. Frames are those that the compositor says it drew (`DrawFrame` of the trace), not those that
the page asked for. Beside it the same points as a `scatter3d` of Plotly, whose WebGL is computed by SwiftShader.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import websocket
from places import GOLDEN

import shapegcode as sg
from browser import SEEN, Browser, chromium
from shapegcode.results.page.html import plotly_name, save

TURN_S = 5.0
CATEGORIES = "blink.user_timing,loading,rail,devtools.timeline,disabled-by-default-devtools.timeline.frame"
SWIFTSHADER = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
TURN = """const done = arguments[0], begun = performance.now();
(function turn(now) { if (now - begun > %g) return done(); %s; requestAnimationFrame(turn); })(begun);"""
OURS = "scenePage.stage.camera.turn(4, 0); scenePage.stage.draw()"
PLOTLY = """<!DOCTYPE html><meta charset="utf-8"><div id="plot" style="width:850px;height:560px"></div>
<script src="%s"></script><script>
const [x, y, z, c] = %s;
const line = {width: 2, color: c, colorscale: "Viridis"};
Plotly.newPlot("plot", [{type: "scatter3d", mode: "lines", x, y, z, line}], {showlegend: false})
  .then(() => {window.drawn = true;});
let angle = 0;
function rotate() { angle += 0.03;
  return Plotly.relayout("plot", {"scene.camera.eye": {x: 1.8 * Math.cos(angle), y: 1.8 * Math.sin(angle), z: 0.9}}); }
</script>"""


class Trace:
    """What the browser says of itself, by its own protocol."""

    def __init__(self, browser: Browser) -> None:
        address = browser.driver.capabilities["goog:chromeOptions"]["debuggerAddress"]
        with urllib.request.urlopen(f"http://{address}/json/version") as answer:
            place = json.load(answer)["webSocketDebuggerUrl"]
        self._socket = websocket.create_connection(place, suppress_origin=True)
        self._number = 0

    def ask(self, method: str, **params: Any) -> dict[str, Any]:
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": params}))
        while True:
            said = json.loads(self._socket.recv())
            if said.get("id") == self._number:
                return said.get("result", {})

    @contextmanager
    def events(self) -> Iterator[list[dict[str, Any]]]:
        """Events of what happens inside; the list is filled at the end."""
        found: list[dict[str, Any]] = []
        self.ask("Tracing.start", categories=CATEGORIES, transferMode="ReportEvents")
        yield found
        self.ask("Tracing.end")
        while (said := json.loads(self._socket.recv())).get("method") != "Tracing.tracingComplete":
            if said.get("method") == "Tracing.dataCollected":
                found += said["params"]["value"]


def renderer(trace: Trace) -> str:
    """Who draws."""
    gpu = trace.ask("SystemInfo.getInfo")["gpu"]
    return f"{gpu['auxAttributes'].get('glRenderer') or 'no GL'}; compositing {gpu['featureStatus']['gpu_compositing']}"


def first_paint_s(browser: Browser, trace: Trace, page: Path) -> float:
    """From the start of the navigation to the first text, by the trace."""
    browser.driver.get("about:blank")
    with trace.events() as events:
        browser.open(page, SEEN)
    named: dict[str, list[dict[str, Any]]] = {}
    for event in events:
        named.setdefault(event["name"], []).append(event)
    begun = max(
        event["ts"]
        for event in named["navigationStart"]
        if page.name in event["args"].get("data", {}).get("documentLoaderURL", "")
    )
    return min(event["ts"] - begun for event in named["firstContentfulPaint"] if event["ts"] > begun) / 1e6


def frames_per_s(browser: Browser, trace: Trace, turn: str) -> float:
    with trace.events() as events:
        browser.later(TURN % (TURN_S * 1e3, turn))
    drawn = sorted(event["ts"] for event in events if event["name"] == "DrawFrame")
    return (len(drawn) - 1) / (drawn[-1] - drawn[0]) * 1e6


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, default=GOLDEN / "PARALLEL.NC")
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        machine = sg.Machine.load("vx500")
        begun = time.process_time()
        conversion = sg.convert(args.program, machine, shape_all=True)
        figures["conversion_cpu_s"] = time.process_time() - begun
        page = conversion.page()
        figures["page_cpu_s"] = time.process_time() - begun - figures["conversion_cpu_s"]
        assert page.scene is not None
        figures["points"] = sum(len(variant.sample) for variant in page.scene.variants)
        save(page, folder / "inline.html")
        save(page, folder / "beside.html", "beside")
        figures["inline_mb"] = (folder / "inline.html").stat().st_size / 1e6
        figures["beside_mb"] = (folder / "beside.html").stat().st_size / 1e6
        variants = page.scene.variants
        corners = np.concatenate([variant.command_mm for variant in variants]).T.tolist()
        colours = np.concatenate([variant.channels["deviation"] for variant in variants]).tolist()
        (folder / "peer.html").write_text(PLOTLY % (plotly_name(), json.dumps([*corners, colours])))
        for name in ("first_paint_s", "frames_per_s", "peer_frames_per_s"):
            figures[name] = []
        for _ in range(args.repetitions):
            with chromium() as browser:
                trace = Trace(browser)
                figures["renderer"] = renderer(trace)
                figures["browser"] = browser.driver.capabilities["browserVersion"]
                figures["first_paint_s"].append(first_paint_s(browser, trace, folder / "inline.html"))
                browser.one("[data-show=both]").click()
                browser.js("document.getElementById('view').scrollIntoView()")
                figures["frames_per_s"].append(frames_per_s(browser, trace, OURS))
            with chromium(*SWIFTSHADER) as browser:
                trace = Trace(browser)
                figures["peer_renderer"] = renderer(trace)
                browser.open(folder / "peer.html", "return window.drawn")
                figures["peer_frames_per_s"].append(frames_per_s(browser, trace, "rotate()"))
    if args.json is not None:
        args.json.write_text(json.dumps(figures, indent=2) + "\n")
    return report(figures)


def report(figures: dict[str, Any]) -> int:
    """Say it; 1 where a target is missed."""

    def middle(name: str) -> str:
        values = figures[name]
        return f"{statistics.median(values):.2f} ({min(values):.2f} – {max(values):.2f})"

    paint, frames = (statistics.median(figures[name]) for name in ("first_paint_s", "frames_per_s"))
    rows = [
        ("page, script inside", f"{figures['inline_mb']:.2f} MB", "≤ 8", figures["inline_mb"] <= 8.0),
        ("page, script beside", f"{figures['beside_mb']:.2f} MB", "≤ 3", figures["beside_mb"] <= 3.0),
        ("first paint", f"{middle('first_paint_s')} s", "≤ 2", paint <= 2.0),
        (f"frames drawn, {figures['points']} points turn", f"{middle('frames_per_s')} /s", "≥ 10", frames >= 10.0),
        ("the same by scatter3d", f"{middle('peer_frames_per_s')} /s", "", True),
        (
            "to make it: conversion, then page",
            "{conversion_cpu_s:.2f}, {page_cpu_s:.2f} CPU-s".format(**figures),
            "",
            True,
        ),
    ]
    for name, value, target, met in rows:
        print(f"| {name} | {value} | {target} | {'' if not target else 'met' if met else 'MISSED'} |")
    print(f"Chromium {figures['browser']}; page: {figures['renderer']}; scatter3d: {figures['peer_renderer']}")
    return 0 if all(met for *_, met in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
