"""A small program for the tests of pages, and what they ask of one that is open."""

from pathlib import Path

from browser import Browser
from command import run

# A mode along X: the corner at X30 Y40 shakes. The comment and the name of the file would end or begin an element.
COMMENT = "(</script><script>window.broken=1</script><img src=x onerror=window.broken=2>)"
TEXT = f"%\nO0001 {COMMENT}\nG90 G21 G17 G54\nG0 X0 Y0 Z5.\nG1 Z0. F3000.\nX30. Y40.\nX60. Y0.\nG0 Z5.\nM30\n%\n"
NAME = "<img src=x onerror=window.broken=3>.nc"
LINES = TEXT.splitlines()
UP, DOWN = LINES.index("X30. Y40.") + 1, LINES.index("X60. Y0.") + 1


def write_small(place: Path) -> None:
    """The program, and the page of its conversion."""
    (place / NAME).write_text(TEXT)
    convert(place, NAME, "out.nc", "small.html")


def convert(place: Path, name: str, out: str, page: str) -> None:
    done = run(place, "convert", "-m", "vx500", "--set", "tolerance.contour_um=15", name, "-o", out, "--html", page)
    assert done.returncode == 0, done.stderr


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
