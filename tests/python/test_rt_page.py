"""What docs/reference/shapegcode_rt.md says of the library that a control embeds: its tests are there, its calls stand
in the table, it is small, it asks for no other symbol, and no call of it lets an exception out."""

import re
import subprocess
from pathlib import Path

import pytest
import rt_page

ROOT = rt_page.ROOT
LIBRARY = ROOT / "build" / "release" / "libshapegcode_rt.a"


@pytest.mark.parametrize("key", rt_page.TESTS)
def test_every_test_of_the_table_is_there(key: str) -> None:
    test = rt_page.TESTS[key]
    text = (ROOT / "tests" / test.file).read_text(encoding="utf-8")
    if test.file.endswith(".py"):
        assert re.search(rf"^def {test.name}\(", text, re.MULTILINE)
    elif Path(test.file).name.startswith("test_"):
        assert f'TEST_CASE("{test.name}")' in text
    else:
        assert test.name in text


def test_every_call_of_the_interface_stands_in_the_table() -> None:
    named = [name for call in rt_page.CALLS for name in call.names]
    assert sorted(named) == sorted(rt_page.public_calls())
    used = {key for call in rt_page.CALLS for key in call.tests}
    assert used <= set(rt_page.TESTS)


def test_no_call_but_the_constructor_may_throw() -> None:
    text = (ROOT / "cpp/include/shapegcode/controller.hpp").read_text(encoding="utf-8")
    body = text[text.index("class MotionController {") : text.index(" private:\n  class Implementation")]
    declared = re.findall(r"^\s+(?!//)(.*\w\([^;]*\)[^;]*);", re.sub(r"//.*", "", body), re.MULTILINE)
    assert len(declared) > 20
    throwing = [one for one in declared if "noexcept" not in one and not re.search(r"= delete|^~", one.strip())]
    assert throwing == ["explicit MotionController(const ControllerSettings& settings)"]


def test_it_is_small_enough_to_be_read() -> None:
    files = [file for folder in rt_page.rt_files().values() for file in folder]
    assert 60 < len(files) == len(set(files))
    assert 4000 < sum(map(rt_page.code_lines, files)) < rt_page.MAX_LINES


def test_lines_of_code_are_those_that_hold_some(tmp_path: Path) -> None:
    file = tmp_path / "a.hpp"
    file.write_text("// no\n#pragma once\n\n/* no\n no */\nint a;  // yes\n")
    assert rt_page.code_lines(file) == 2


def test_it_asks_for_no_other_symbols(tmp_path: Path) -> None:
    """All of the archive in one shared library, whose undefined symbols are what it calls."""
    shared = tmp_path / "all.so"
    subprocess.run(
        ["c++", "-shared", "-o", shared, "-Wl,--whole-archive", LIBRARY, "-Wl,--no-whole-archive"], check=True
    )
    done = subprocess.run(["nm", "-D", "-C", "--undefined-only", shared], check=True, capture_output=True, text=True)
    asked = {re.sub(r"@\S+$", "", line.split(maxsplit=1)[1]) for line in done.stdout.splitlines()}
    asked = {name.removeprefix("w ").removeprefix("U ") for name in asked}
    assert len(asked) > 30
    assert asked - {name for names in rt_page.SYMBOLS.values() for name in names} == set()
    for what, names in rt_page.SYMBOLS.items():
        assert asked & set(names), f"none of {what}"
