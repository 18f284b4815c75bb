"""Lay out the sources of the book below a folder: `book.py FOLDER`. `make docs` calls this before Sphinx.

The pages of docs/ are copied as they are, so that their links work here and where the repository is read as files. A
link to what lies outside of docs/ gets a place in the book: the pages of the root under house/, other files under
files/. Pages that come from the code (commands, Python, C++, gallery) are written beside them; see
`book_pages` and `gallery`.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import book_pages
import gallery

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
HOUSE = {"ARCHITECTURE.md": "architecture.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changes.md"}
"""Pages of the root and their names in the book."""
PLACES = {"README.md": "index.md"}
"""Pages of the root that the book has in another form."""

SUFFIXES = {".md", ".png", ".svg"}

LINK = re.compile(r"(!?\[[^\[\]]*\]\()([^()\s]+)(\))")
CODE = re.compile(r"^(`{3,}|~{3,})[^\n]*\n.*?^\1[^\n]*$|^(?: {4}|\t)[^\n]*$|`[^`\n]+`", re.MULTILINE | re.DOTALL)


def links(text: str) -> Iterator[tuple[int, int, str]]:
    """Place and target of every relative link or picture of a Markdown page, those in code left out."""
    hidden = [match.span() for match in CODE.finditer(text)]
    for match in LINK.finditer(text):
        inside = any(start <= match.start(2) < end for start, end in hidden)
        if not inside and not re.match(r"[a-z]+:|#", match[2]):
            yield *match.span(2), match[2]


def pages(folder: Path) -> list[Path]:
    """Every page below a folder."""
    return sorted(folder.rglob("*.md"))


def relinked(text: str, home: Path, place: Path, book: Path) -> str:
    """The text of a page with links that hold in the book.

    `home` is its file in the repository, `place` the one in the book; files that it links to are copied there.
    """
    parts, last = [], 0
    for start, end, target in links(text):
        path, mark, anchor = target.partition("#")
        file = Path(os.path.normpath(home.parent / path))
        parts += [text[last:start], os.path.relpath(_place(file, book), place.parent), mark, anchor]
        last = end
    return "".join(parts) + text[last:]


def _place(file: Path, book: Path) -> Path:
    """Where a file of the repository stands in the book; one from outside of docs/ is copied."""
    if file.is_relative_to(DOCS):
        return book / file.relative_to(DOCS)
    name = file.relative_to(ROOT).as_posix()
    if name in PLACES:
        return book / PLACES[name]
    if name in HOUSE:
        return book / "house" / HOUSE[name]
    copy = book / "files" / name
    if file.suffix == ".md":  # a page of its own, which stands in no table of contents
        write(copy, f"---\norphan: true\n---\n\n{relinked(file.read_text('utf-8'), file, copy, book)}")
    elif file.is_file():
        write(copy, file.read_bytes())
    return copy


def write(file: Path, content: str | bytes) -> None:
    """Write a file where it differs, so that Sphinx reads only anew what changed."""
    data = content.encode("utf-8") if isinstance(content, str) else content
    if not file.is_file() or file.read_bytes() != data:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)


def stage(book: Path) -> None:
    """Lay out the book below a folder; what stands there and is no longer part of it goes."""
    placed: dict[Path, str | bytes] = {}
    for file in sorted(DOCS.rglob("*")):
        if file.is_file() and file.suffix in SUFFIXES and file.parent.name != "_static":
            place = book / file.relative_to(DOCS)
            is_page = file.suffix == ".md"
            placed[place] = relinked(file.read_text("utf-8"), file, place, book) if is_page else file.read_bytes()
    for name, new in HOUSE.items():
        place = book / "house" / new
        placed[place] = relinked((ROOT / name).read_text("utf-8"), ROOT / name, place, book)
    placed |= {book / name: text for name, text in book_pages.generated().items()}
    placed[book / "gallery" / "index.md"] = gallery.page()
    drawn = book.parent / "gallery"
    placed |= {book / "gallery" / file.relative_to(drawn): file.read_bytes() for file in sorted(drawn.rglob("*.png"))}
    for old in sorted(book.rglob("*")):
        if old.is_file() and old not in placed and not old.is_relative_to(book / "files"):
            old.unlink()
    for place, content in placed.items():
        write(place, content)


def keep_public(doxygen: Path) -> None:
    """Take private members out of Doxygen's XML: it has no setting for that, and Breathe shows what is there."""
    for file in sorted(doxygen.glob("*.xml")):
        text = file.read_text(encoding="utf-8")
        public = re.sub(r'<sectiondef kind="(?:private|friend).*?</sectiondef>', "", text, flags=re.DOTALL)
        if public != text:
            file.write_text(public, encoding="utf-8")


if __name__ == "__main__":
    place = Path(sys.argv[1]).resolve()
    keep_public(place.parent / "doxygen" / "xml")
    stage(place)
