"""What docs/reference/shapegcode_rt.md says of the library that a control embeds: its tests are there, its calls stand
in the table, it is small, it asks for no other symbol, and no call of it lets an exception out."""

import re
import subprocess
from pathlib import Path

import pytest
from rt_coverage import ROOT, rt_files

LIBRARY = ROOT / "build" / "release" / "libshapegcode_rt.a"
PAGE = (ROOT / "docs" / "reference" / "shapegcode_rt.md").read_text(encoding="utf-8")


def table(head: str) -> list[list[str]]:
    """Cells of the rows of the page's table under this heading."""
    (found,) = re.findall(rf"^\| {re.escape(head)} \|.*\n\|[-|]+\|\n((?:\|.*\n)+)", PAGE, re.MULTILINE)
    return [re.split(r" *\| *", line.strip("| ")) for line in found.splitlines()]


def in_code(cell: str) -> list[str]:
    """What stands between backquotes."""
    return re.findall(r"`([^`]+)`", cell)


CALLS = table("call")
TESTS = {key: re.findall(r"\[`(.+)`\]\(\.\./\.\./(.+)\): `(.+)`", test)[0] for key, _, test in table("name")}
SYMBOLS = {what: set(in_code(names)) for what, names in table("what for")}
_STRING = "std::__cxx11::basic_string<char, std::char_traits<char>, std::allocator<char> >"


@pytest.mark.parametrize("key", TESTS)
def test_every_test_of_the_table_is_there(key: str) -> None:
    shown, file, name = TESTS[key]
    text = (ROOT / file).read_text(encoding="utf-8")
    assert Path(file).name == shown
    if file.endswith(".py"):
        assert re.search(rf"^def {name}\(", text, re.MULTILINE)
    elif shown.startswith("test_"):
        assert f'TEST_CASE("{name}")' in text
    else:
        assert name in text


def declarations() -> list[str]:
    """Of the functions of MotionController, by its header."""
    text = (ROOT / "cpp/include/shapegcode/controller.hpp").read_text(encoding="utf-8")
    body = text[text.index("class MotionController {") : text.index(" private:\n  class Implementation")]
    return re.findall(r"^\s+(?!//)(.*\w\([^;]*\)[^;]*);", re.sub(r"//.*", "", body), re.MULTILINE)


def test_every_call_of_the_interface_stands_in_the_table() -> None:
    named = [name for call, *_ in CALLS for name in in_code(call)]
    assert sorted(named) == sorted({re.findall(r"(\w+)\(", one)[0] for one in declarations()})
    used = {key for *_, tests in CALLS for key in tests.split(", ")}
    assert used <= set(TESTS)


def test_no_call_but_the_constructor_may_throw() -> None:
    declared = declarations()
    assert len(declared) > 20
    throwing = [one for one in declared if "noexcept" not in one and not re.search(r"= delete|^~", one.strip())]
    assert throwing == ["explicit MotionController(const ControllerSettings& settings)"]


def code_lines(text: str) -> int:
    """Lines that hold more than a comment."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    return sum(bool(line.strip()) and not line.strip().startswith("//") for line in text.splitlines())


def test_it_is_small_enough_to_be_read() -> None:
    folders = rt_files()
    files = [file for folder in folders.values() for file in folder]
    assert 60 < len(files) == len(set(files))
    counts = {folder: str(len(inside)) for folder, inside in folders.items()} | {"all of it": str(len(files))}
    assert {folder: count for folder, _, count in table("folder of `cpp/src`")} == counts
    (limit,) = re.findall(r"Together less than (\d+) lines", PAGE)
    assert 4000 < sum(code_lines(file.read_text(encoding="utf-8")) for file in files) < int(limit)


def test_lines_of_code_are_those_that_hold_some() -> None:
    assert code_lines("// no\n#pragma once\n\n/* no\n no */\nint a;  // yes\n") == 2


def test_it_asks_for_no_other_symbols(tmp_path: Path) -> None:
    """All of the archive in one shared library, whose undefined symbols are what it calls."""
    shared = tmp_path / "all.so"
    subprocess.run(
        ["c++", "-shared", "-o", shared, "-Wl,--whole-archive", LIBRARY, "-Wl,--no-whole-archive"], check=True
    )
    done = subprocess.run(["nm", "-D", "-C", "--undefined-only", shared], check=True, capture_output=True, text=True)
    asked = {re.sub(r"@\S+$", "", line.split(maxsplit=1)[1]) for line in done.stdout.splitlines()}
    asked = {name.removeprefix("w ").removeprefix("U ").replace(_STRING, "std::string") for name in asked}
    assert len(asked) > 30
    assert asked <= set().union(*SYMBOLS.values())
    for what, names in SYMBOLS.items():
        assert asked & names, f"none of {what}"
