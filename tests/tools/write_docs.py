"""Write the pages of docs/ that come from the code: keys of files, public names. `make docs` calls this."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from pathlib import Path

import write_schemas
from dialects_page import dialects_documentation
from machine_page import machine_documentation
from tool_files_page import file_documentation

import shapegcode as sg

FOLDER = Path(__file__).resolve().parents[2] / "docs"

_HEAD = """\
# The Python API

<!-- Generated: make docs -->

`import shapegcode as sg` offers these names. `help(sg.convert)` says what each takes, with shapes and units, what it
returns and raises, and where the method comes from. Every function that takes a program takes a `Program`, its path or
its text (a string of several lines); every one that takes a machine takes a `Machine`, its file or its built-in name.
Every result of a command is a frozen dataclass with `ok`, `warnings`, `next_step`, `to_dict()`, `tables()`, `plots()`;
the keys of its JSON are in [schemas](schemas.md). `result.plots()` draws its pictures by name,
`result.save_plots(folder)` writes them.

    machine = sg.Machine.load("vx500").with_values("tolerance.contour_um", 10)
    conversion = sg.convert("part.nc", machine)
    print(conversion.answer, conversion.next_step)

What can be guessed; a wrong name, argument or attribute is answered with the one that was probably meant:

| line | what it gives |
|---|---|
| `sg.convert("part.nc", "vx500")` | the shaped program; `simulate`, `check`, `cycle_time` take the same arguments |
| `sg.zv(46, 0.02)` | the ZV shaper of 46 Hz with a damping ratio of 0.02; `sg.Mode(46, 0.02)` is that mode |
| `sg.zv(46).residual(frequencies_hz)` | its residual vibration over an array of frequencies |
| `sg.choose_shaper([46, 131])` | every family of shapers for two modes, and the one to take |
| `sg.plot_sensitivity(shaper)` | residual over frequency, of a comparison, a shaper, a list or dict of shapers |
| `sg.identify(t, y)`, `sg.identify(t, y, force)` | modes of a decay, of an impact test, from arrays |
| `sg.Machine.simple(modes={"x": 46, "y": [131, 200]})` | a machine of which nothing but its modes is known |
| `sg.zv(found.modes[0])`, `sg.Machine.simple({"x": found.modes})` | identified modes serve wherever modes are taken |
| `sg.simulate(conversion.text, "vx500")` | the emitted text, which is bytes, is a program too |
| `sg.zv_on_grid(mode, 0.001).to_fir(0.001).apply(samples)` | samples of 1 ms, shaped |
| `json.dump(result.to_json(), file)`, `sg.load_result("part.json")` | a result kept for later; `--json` writes it too |
| `sg.MotionController(shaper=sg.Mode(46, 0.02), ...)` | a controller with the ZV shaper of a mode, on its own grid |

| name | home | what it is |
|---|---|---|
"""


def api_documentation() -> str:
    """Every public name with the first sentence of its docstring, by home in the order of the stub."""
    rows = []
    for name, home in sg._home().items():
        value = getattr(sg, name)
        called = "()" if callable(value) and not inspect.isclass(value) else ""
        said = first_sentence(inspect.getdoc(value) or "") if callable(value) else "The version of the package."
        folder = home.split(".")[1].lstrip("_")
        rows.append(f"| `{name}{called}` | {folder} | {said} |")
    return _HEAD + "\n".join(rows) + "\n"


def first_sentence(doc: str) -> str:
    """The first sentence of a docstring on one line."""
    text = " ".join(doc.partition("\n\n")[0].split())
    found = re.match(r".*?(?<!\beq)\.(?=\s|$)", text)
    return (found[0] if found else text).rstrip(":.").replace("|", "\\|") + "."


_SCHEMAS = """\
# JSON schemas

<!-- Generated: make docs -->

`--json FILE` of a command writes its result. The keys of each kind of result stand in a JSON Schema, with units and
meaning; Draft 2020-12, without references outside of the file. The schemas are made from the code: one by
`sg.schema(sg.Conversion)` in Python, all by `make schemas` (build/schemas); in the built book each name of the table
leads to its schema. Those of machine, tool, stock and study files, for editors: `shapegcode machine schema KIND`.

| kind | what it is |
|---|---|
"""


def schema_documentation(*, linked: bool = False) -> str:
    """Every kind of result, in the book linked to its schema."""
    rows = [
        f"| {f'[{name}](../schema/{name}.json)' if linked else name} | {first_sentence(inspect.getdoc(cls) or '')} |"
        for name, cls in write_schemas.results().items()
    ]
    return _SCHEMAS + "\n".join(rows) + "\n"


PAGES: dict[str, Callable[[], str]] = {
    "reference/machine.md": machine_documentation,
    "reference/dialects.md": dialects_documentation,
    "reference/tool_files.md": file_documentation,
    "reference/api.md": api_documentation,
    "reference/schemas.md": schema_documentation,
}
"""What writes each page, by its name."""

if __name__ == "__main__":
    for name, text in PAGES.items():
        (FOLDER / name).write_text(text(), encoding="utf-8")
