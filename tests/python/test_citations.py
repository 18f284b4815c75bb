"""What `--cite` prints: BibTeX of the papers behind the methods of a run, with the facts of the page of references."""

import json
import re
from pathlib import Path

import pytest

import shapegcode as sg
from shapegcode.cli import main
from shapegcode.results.outcome import NotKeptError
from shapegcode.results.result import METHODS, bibliography, entries_of
from shapegcode.shaping import FAMILIES
from shapegcode.shaping.registry import Family

ROOT = Path(__file__).resolve().parents[2]
ENTRY = re.compile(r"@(\w+)\{(\w+),\n((?:  \w+ = \{.*\},\n)+)\}")
FIELD = re.compile(r"^  (\w+) = \{(.*)\},$", re.MULTILINE)
PAGE = (ROOT / "docs" / "evidence" / "references.md").read_text(encoding="utf-8")
KEYS = sorted(set(bibliography()) - {"shapegcode"})


def fields_of(entry: str) -> dict[str, str]:
    parsed = ENTRY.fullmatch(entry)
    assert parsed is not None, entry
    found = dict(FIELD.findall(parsed[3]))
    assert all(value.count("{") == value.count("}") for value in found.values()), entry
    return found


def surname(entry: str) -> str:
    """Of the first author."""
    first = fields_of(entry)["author"].split(" and ")[0]
    return first.partition(",")[0].strip("{}")


def needed(kind: str) -> set[str]:
    return {"article": {"author", "journal", "year"}, "book": {"author", "title"}}.get(kind, {"author"})


@pytest.mark.parametrize("key", [*KEYS, "shapegcode"])
def test_every_entry_is_bibtex(key: str) -> None:
    entry = bibliography()[key]
    parsed = ENTRY.fullmatch(entry)
    assert parsed[2] == key
    assert needed(parsed[1]) <= set(fields_of(entry))


@pytest.mark.parametrize("key", KEYS)
def test_the_facts_of_an_entry_are_those_of_the_page_of_references(key: str) -> None:
    fields = fields_of(bibliography()[key])
    rows = [line for line in PAGE.splitlines() if line.startswith("|") and surname(bibliography()[key]) in line]
    title = re.sub(r"[{}]", "", fields.get("title", ""))
    rows = [row for row in rows if title in row and fields.get("year", "") in row]
    assert rows, "not in docs/evidence/references.md"
    volume = f"{fields.get('volume', '')}({fields['number']})" if "number" in fields else fields.get("volume", "")
    facts = [volume, fields.get("pages", "").replace("--", "–"), fields.get("doi", ""), fields.get("url", "")]
    assert all(any(fact in row for row in rows) for fact in facts)


def test_every_entry_is_cited_and_every_citation_has_one() -> None:
    assert {key for keys in METHODS.values() for key in keys} == set(KEYS)


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.name)
def test_every_family_cites_its_source_or_is_our_own(family: Family) -> None:
    keys, source = METHODS[f"shaper {family.name}"], family.source
    if not keys:
        assert source in {"this project", "the user"}
    for key in keys:
        fields = fields_of(bibliography()[key])
        said = fields["title"] if "year" not in fields else surname(bibliography()[key])
        assert said in source
        assert fields.get("year", "") in source
    dated = [key for key in keys if "year" in fields_of(bibliography()[key])]
    assert len(re.findall(r"\b(?:19|20)\d\d\b", source)) == len(dated)


def test_every_method_that_a_class_names_is_known() -> None:
    named = re.compile(r'published: ClassVar\[tuple\[str, \.\.\.\]\] = \("([^"]+)",\)')
    found = {name for file in (ROOT / "python").rglob("*.py") for name in named.findall(file.read_text("utf-8"))}
    assert found
    assert found <= set(METHODS)


def test_a_zvd_conversion_cites_singer_and_seering(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program = ROOT / "python" / "shapegcode" / "data" / "paper_path.nc"
    words = ["convert", str(program), "-m", "vx500", "--shaper", "zvd", "--shape-all", "-q"]
    plain, cited = tmp_path / "plain.json", tmp_path / "cited.json"
    main([*words, "-o", str(tmp_path / "a.nc"), "--json", str(plain)])
    without = capsys.readouterr().out
    main([*words, "-o", str(tmp_path / "b.nc"), "--json", str(cited), "--cite"])
    out = capsys.readouterr().out
    assert "@" not in without
    answer, *_ = out.splitlines()
    assert answer == without.splitlines()[0]
    printed = [entry[0] for entry in ENTRY.finditer(out)]
    assert any("Preshaping Command Inputs" in each and "Singer, N. C. and Seering, W. P." in each for each in printed)
    result = sg.convert(program, sg.Machine.load("vx500"), shaper="zvd", shape_all=True)
    assert tuple(printed) == result.citations
    assert json.loads(plain.read_text()).keys() == json.loads(cited.read_text()).keys()


def test_a_method_of_our_own_cites_the_program_alone() -> None:
    assert entries_of(["shaper robust"]) == (bibliography()["shapegcode"],)
    assert entries_of(["shaper zvd", "shaper zvdd"]) == entries_of(["shaper zvd"])


def test_what_no_json_holds_is_said(tmp_path: Path) -> None:
    program = ROOT / "python" / "shapegcode" / "data" / "paper_path.nc"
    file = tmp_path / "s.json"
    assert main(["simulate", str(program), "-m", "vx500", "--json", str(file), "-q"]) == 0
    with pytest.raises(NotKeptError, match="use --cite"):
        sg.load_result(file).citations  # noqa: B018


@pytest.mark.parametrize(
    ("words", "key"),
    [
        (["time", "--no-full", "--set", "controller.motion=after_interpolation"], "lee2022"),
        (["simulate", "--plant", "feed-drive"], "canudas1995"),
    ],
    ids=["time", "simulate"],
)
def test_what_was_not_used_is_not_cited(words: list[str], key: str, capsys: pytest.CaptureFixture[str]) -> None:
    program = str(ROOT / "python" / "shapegcode" / "data" / "paper_path.nc")
    command, *options = words
    assert main([command, program, "-m", "vx500", "-q", "--cite", *options]) == 0
    assert f"{{{key}," in capsys.readouterr().out
    assert main([command, program, "-m", "vx500", "-q", "--cite"]) == 0
    assert f"{{{key}," not in capsys.readouterr().out
