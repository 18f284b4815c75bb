"""``shapegcode report`` and ``--html``: pages made at once and later, and what is said when something has changed."""

import html
import json
import re
from pathlib import Path
from typing import Any

import pytest

import shapegcode as sg
from command import run
from page_pieces import pieces

ROOT = Path(__file__).resolve().parents[2]
COMMENT = "(<script>alert`1`</script>)"
PART = f"%\nO0001 {COMMENT}\nG90 G21 G17 G54\nG0 X0 Y0 Z5.\nG1 Z0. F3000.\nX30. Y40.\nX60. Y0.\nG0 Z5.\nM30\n%\n"


def converted(folder: Path, *words: str) -> Path:
    (folder / "part.nc").write_text(PART)
    done = run(folder, "convert", "part.nc", "-m", "vx500", "-o", "out.nc", "--json", "r.json", *words)
    assert done.returncode == 0, done.stderr
    return folder / "r.json"


def test_the_page_holds_the_json_and_both_programs(tmp_path: Path) -> None:
    report = converted(tmp_path, "--html", "page.html")
    found = pieces(tmp_path / "page.html")
    assert found["result"] == json.loads(report.read_text())
    variants = found["scene-head"]["variants"]
    assert [variant["key"] for variant in variants] == ["original", "emitted"]
    text = (tmp_path / "page.html").read_text()
    assert "<script>alert" not in text
    assert html.escape(found["result"]["at_the_control"][0]["text"]) in text
    provenance = found["result"]["provenance"]
    assert {file["role"] for file in provenance["files"]} == {"input", "machine", "output"}
    sheet = text[text.index('id="sheet"') :]
    assert next(file["sha256"] for file in provenance["files"] if file["role"] == "output") in sheet


def test_a_page_made_later_is_the_same(tmp_path: Path) -> None:
    converted(tmp_path, "--html", "page.html", "--set", "tolerance.contour_um=15", "--shaper", "zvd")
    done = run(tmp_path, "report", "r.json", "--json", "said.json")
    assert done.returncode == 0, done.stdout + done.stderr
    now, then = pieces(tmp_path / "r.html"), pieces(tmp_path / "page.html")
    assert now == then
    data = re.compile(r'id="scene-data">([^<]*)<')
    assert data.findall((tmp_path / "r.html").read_text()) == data.findall((tmp_path / "page.html").read_text())
    (said,) = json.loads((tmp_path / "said.json").read_text())["pages"]
    assert said == {"source": "r.json", "page": "r.html", "result": "Conversion", "motion": True, "problems": []}
    elsewhere = tmp_path / "elsewhere"
    (tmp_path / "kept").mkdir()
    for name in ("r.json", "part.nc", "out.nc"):
        (tmp_path / name).rename(tmp_path / "kept" / name)
    elsewhere.mkdir()
    again = run(elsewhere, "report", "../kept/r.json", "-o", "here.html", "--html-script", "beside")
    assert again.returncode == 0, again.stdout + again.stderr
    assert "scene-head" in pieces(elsewhere / "here.html")
    assert len(list(elsewhere.glob("*.js"))) == 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda folder: (folder / "part.nc").write_text("M30\n"), "input part.nc was changed since"),
        (lambda folder: (folder / "out.nc").unlink(), "output out.nc was not found"),
        (lambda folder: edit(folder / "r.json", by="shapegcode 0.0.9"), "made by shapegcode 0.0.9; this page by"),
        (lambda folder: edit(folder / "r.json", format=7), "provenance.format = 7: written by"),
        (lambda folder: edit(folder / "r.json", command="shapegcode convert --unheard"), "its command cannot be read"),
        (lambda folder: edit(folder / "r.json", command="shapegcode machine init -o x.toml"), "its command cannot"),
    ],
)  # fmt: skip
def test_what_has_changed_since_is_said_on_the_page_and_here(change: Any, said: str, tmp_path: Path) -> None:
    converted(tmp_path)
    change(tmp_path)
    done = run(tmp_path, "report", "r.json")
    assert done.returncode == 1
    assert said in " ".join(done.stdout.split())
    assert html.escape(said) in (tmp_path / "r.html").read_text()


def edit(file: Path, **values: object) -> None:
    report = json.loads(file.read_text())
    report["provenance"].update(values)
    file.write_text(json.dumps(report))


def test_what_is_no_result_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    file = converted(tmp_path)
    whole = file.read_text()
    (tmp_path / "cut.json").write_text(whole[:500])
    (tmp_path / "nan.json").write_text('{"cycle_time_s": NaN}')
    (tmp_path / "old.json").write_text(json.dumps({"cycle_time_s": 1.0}))
    for words, said in (
        (["cut.json"], "the file ends in the middle"),
        (["old.json"], "old.json: key provenance is missing"),
        (["r.json", "r.json", "-o", "both.html"], "2 results need a page each"),
        (["r.json", "-o", "r.json"], "would overwrite"),
        (["none.json"], "none.json: no such file"),
        (["nan.json"], "NaN is not a number in JSON"),
        (["r.json", "-o", "-"], "name a file"),
    ):
        done = run(tmp_path, "report", *words)
        assert done.returncode == 2
        assert said in done.stderr
    refused = run(tmp_path, "time", "part.nc", "-m", "vx500", "--html", "part.nc")
    assert refused.returncode == 2 and "would overwrite" in refused.stderr
    piped = run(tmp_path, "time", "part.nc", "-m", "vx500", "--html", "-")
    assert piped.returncode == 2 and "--html -: a page cannot go to standard output" in piped.stderr
    assert list(tmp_path.glob("*.html")) == []
    assert (tmp_path / "part.nc").read_text() == PART


def test_programs_of_one_file_have_a_page_each(tmp_path: Path) -> None:
    second = PART.replace(f"O0001 {COMMENT}", "O0002")
    (tmp_path / "part.nc").write_text(PART.removesuffix("%\n") + second.removeprefix("%\n"))
    words = ("time", "part.nc", "-m", "vx500", "--program", "all", "--json", "r.json", "--html", "p.html")
    assert run(tmp_path, *words).returncode == 0
    assert sorted(each.name for each in tmp_path.glob("p*.html")) == ["p-O0001.html", "p-O0002.html"]
    assert run(tmp_path, "report", "r.json").returncode == 0
    assert sorted(each.name for each in tmp_path.glob("r-*.html")) == ["r-O0001.html", "r-O0002.html"]


def test_the_report_from_python(tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_text(PART)
    result = sg.cycle_time(tmp_path / "part.nc", sg.Machine.load("vx500"))
    assert result.report(tmp_path / "p.html") == [str(tmp_path / "p.html")]
    assert pieces(tmp_path / "p.html")["result"] == result.to_json()
    with pytest.raises(sg.ArgumentError, match="script must be"):
        result.report(tmp_path / "q.html", script="outside")  # type: ignore[arg-type]
    assert not (tmp_path / "q.html").exists()


def test_the_page_of_feeds_has_the_cutting_force(tmp_path: Path) -> None:
    """Along the path stands the force that the schedule knows: its largest is the peak of the JSON."""
    golden = Path(__file__).parents[1] / "golden" / "feed"
    tool, stock = sg.Tool.load(golden / "pocket_tool.toml"), sg.Stock.load(golden / "pocket_stock.toml")
    schedule = sg.schedule_feed(sg.Program.read(golden / "POCKET.NC", "vx500"), "vx500", tool, stock)
    scene = schedule.page().scene
    for variant, peak in zip(scene.variants, ("original", "emitted"), strict=True):
        expected = getattr(schedule.resultant_force_n, peak).max
        assert variant.channels["force"].max() == pytest.approx(expected, rel=0.05)
        air = variant.line < min(part.region.first_line for part in schedule.survey.regions)
        assert not variant.channels["force"][air].any()


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("machine diff vx500 kimm004", 0),
        (f"machine import {ROOT / 'tests/golden/parameters/with_q.txt'} -o m.toml --rigid XYZ", 1),
        ("identify --tap-plan -m vx500", 0),
        ("demo path", 0),
    ],
)
def test_results_without_programs_have_pages_too(words: str, code: int, tmp_path: Path) -> None:
    """At once and later; where the JSON does not hold what the page needs, it is shown as it stands."""
    done = run(tmp_path, *words.split(), "--json", "r.json", "--html", "p.html")
    assert done.returncode in (0, 1), done.stderr
    assert pieces(tmp_path / "p.html")["result"] == json.loads((tmp_path / "r.json").read_text())
    later = run(tmp_path, "report", "r.json")
    assert later.returncode == code, later.stdout + later.stderr
    assert pieces(tmp_path / "r.html")["result"] == json.loads((tmp_path / "r.json").read_text())
