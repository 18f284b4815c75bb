"""The pages of the book hang together: links and anchors lead somewhere, every page is in the contents. No Sphinx."""

import ast
import functools
import os
import re
from pathlib import Path

import book
import gallery
import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [*book.pages(ROOT / "docs"), *(ROOT / name for name in ("README.md", *book.HOUSE))]
HOWTO = [page for page in sorted((ROOT / "docs" / "howto").glob("*.md")) if page.stem != "index"]
TOCTREE = re.compile(r"^`{3,}\{toctree\}\n(.*?)^`{3,}$", re.MULTILINE | re.DOTALL)


@functools.cache
def anchors(file: Path) -> set[str]:
    """What a page offers behind `#`, as GitHub and MyST name its headings."""
    found: dict[str, int] = {}
    text = re.sub(r"^(`{3,}).*?^\1", "", file.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for heading in re.findall(r"^#{1,4} +(.+?) *$", text, re.MULTILINE):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        slug = re.sub(r"[^\w\- ]", "", plain).replace(" ", "-")
        found[slug] = found.get(slug, -1) + 1
    return {slug if number == 0 else f"{slug}-{number}" for slug, last in found.items() for number in range(last + 1)}


def test_links_are_found_outside_of_code() -> None:
    text = "[a](b.md#c) `[no](x.md)` ![p](q.png)\n\n    [no](y.md)\n\n```text\n[no](z.md)\n```\n"
    text += "[w](https://w.org) [h](#h)\n"
    assert [target for *_, target in book.links(text)] == ["b.md#c", "q.png"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_leads_somewhere(page: Path) -> None:
    dead = []
    for *_, target in book.links(page.read_text(encoding="utf-8")):
        path, _, anchor = target.partition("#")
        file = Path(os.path.normpath(page.parent / path))
        if not file.is_file() or (anchor and file.suffix == ".md" and anchor not in anchors(file)):
            dead.append(target)
    assert dead == []


def test_architecture_names_files_that_exist() -> None:
    """A file or folder with a path in ARCHITECTURE.md, but for those that its recipes would add."""
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([a-z_]+(?:/[a-z_0-9]+)+(?:\.[a-z]+)?)`", text))
    folders = [ROOT / name for name in ("python", "cpp", "tests", "docs", "bindings", "integrations")]
    there = [f"/{file.relative_to(ROOT)}" for folder in folders for file in folder.rglob("*")]
    missing = {name for name in named if not any(f"/{name}" in file for file in there)}
    assert missing == {"balance/result.py", "balance/balance.py", "cli/balance.py"}


def test_every_page_is_in_the_contents(tmp_path: Path) -> None:
    """Of the book as it is laid out, with the pages that come from the code; each page in one place."""
    place = tmp_path / "book"
    book.stage(place)
    listed: list[Path] = []
    for page in book.pages(place):
        for body in TOCTREE.findall(page.read_text(encoding="utf-8")):
            names = [line.strip() for line in body.splitlines() if line.strip() and not line.startswith(":")]
            listed += [page.parent / f"{name}.md" for name in names]
    pages = {page for page in book.pages(place) if not page.is_relative_to(place / "files")} - {place / "index.md"}
    assert sorted(pages - set(listed)) == [], "in no contents"
    assert sorted(set(listed) - pages) == [], "in the contents, and not there"
    assert len(listed) == len(set(listed)), "twice in the contents"


@pytest.mark.parametrize("page", HOWTO, ids=lambda page: page.stem)
def test_every_how_to_ends_with_what_can_go_wrong(page: Path) -> None:
    head, _, last = page.read_text(encoding="utf-8").rpartition("\n## ")
    title, *rows = last.strip().splitlines()
    assert title == "What can go wrong"
    assert 3 <= sum(row.startswith("|") for row in rows) - 2 <= 6, "three to six rows below the head of the table"
    assert title not in head


@pytest.mark.parametrize("page", [page for page in PAGES if "{literalinclude}" in page.read_text(encoding="utf-8")])
def test_every_included_piece_of_a_file_is_there(page: Path) -> None:
    """Its file is linked from the page, by which it comes into the book; where it begins and ends is in it."""
    text = page.read_text(encoding="utf-8")
    linked = {os.path.normpath(page.parent / target.partition("#")[0]) for *_, target in book.links(text)}
    included = re.findall(r"^```\{literalinclude\} /files/(\S+)\n((?::.*\n)*)", text, re.MULTILINE)
    assert included
    for name, options in included:
        source = (ROOT / name).read_text(encoding="utf-8")
        assert str(ROOT / name) in linked, name
        marks = re.findall(r"^:(start-at|start-after|end-at|end-before): *\"?(.*?)\"? *$", options, re.MULTILINE)
        places = [source.index(mark) for _, mark in marks]
        assert places == sorted(places), (name, marks)


def test_every_picture_that_a_result_draws_is_in_the_gallery() -> None:
    """By the names in the functions that offer pictures; those of `KEPT` are drawn once and stand in docs/images."""
    offered = set()
    for file in (ROOT / "python" / "shapegcode").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name in {"plots_of", "plots", "motion_pictures"}:
                for part in ast.walk(node):
                    keys = part.keys if isinstance(part, ast.Dict) else []
                    if isinstance(part, ast.Assign) and isinstance(part.targets[0], ast.Subscript):
                        keys = [part.targets[0].slice]
                    offered |= {key.value for key in keys if isinstance(key, ast.Constant)}
    shown = {name for entry in gallery.ENTRIES for name in entry.shown}
    assert len(offered) > 30
    assert offered - shown - {Path(name).stem for *_, name, _ in gallery.KEPT} == set()


def test_every_picture_is_shown() -> None:
    shown = {
        os.path.normpath(page.parent / target.partition("#")[0])
        for page in PAGES
        for *_, target in book.links(page.read_text(encoding="utf-8"))
    }
    kept = {str(file) for file in (ROOT / "docs" / "images").iterdir()}
    assert sorted(kept - shown) == []
