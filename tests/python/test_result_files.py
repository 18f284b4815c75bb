"""Results read back from their JSON: nothing lost, nothing invented; what is wrong with a file is said."""

import dataclasses
import functools
import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jsonschema
import pytest
import write_schemas

import shapegcode as sg
from command import run
from page_pieces import pieces
from shapegcode.results.json import RENAMED, OldNames
from shapegcode.results.outcome import NotKeptError
from shapegcode.results.revive import load_result

PART = "%\nO0001\nG90 G21 G17 G54\nG0 X0 Y0 Z5.\nG1 Z0. F3000.\nX30. Y40.\nX60. Y0.\nG0 Z5.\nG4 P504\nM30\n%\n"


class Shown(NamedTuple):
    """What a command left: its name, its streams and its files."""

    name: str
    out: str
    err: str
    json: Path
    page: Path


COMMANDS = {
    "Conversion": "convert part.nc -m vx500 -o out.nc",
    "Simulation": "simulate part.nc -m vx500",
    "CycleTime": "time part.nc -m vx500",
    "Check": "check part.nc -m vx500",
    "Expansion": "expand part.nc -m vx500 -o plain.nc",
    "Measurement": "measure part.nc -m vx500 --tool-diameter 10mm",
    "Recommendation": "shaper -m vx500",
    "MachineDescription": "machine show vx500",
    "TapPlan": "identify --tap-plan -m vx500",
    "CharacterisationTests": "characterize --write tests -m vx500",
    "PathDemo": "demo path",
}


def made(folder: Path, name: str) -> Path:
    """The JSON of a command."""
    (folder / "part.nc").write_text(PART)
    done = run(folder, *COMMANDS[name].split(), "--json", "r.json")
    assert done.returncode in (0, 1), done.stderr
    return folder / "r.json"


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Shown]:
    """Runs each command once: what it printed on a terminal of 80 columns, its JSON and its page."""

    @functools.cache
    def once(name: str) -> Shown:
        folder = tmp_path_factory.mktemp(name)
        (folder / "part.nc").write_text(PART)
        words = *COMMANDS[name].split(), "--json", "r.json", "--html", "p.html"
        done = run(folder, *words, COLUMNS="80", NO_COLOR="1")
        assert done.returncode in (0, 1), done.stderr
        return Shown(name, done.stdout, done.stderr, folder / "r.json", folder / "p.html")

    return once


@pytest.fixture(scope="module")
def schemas(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The schemas, as `make schemas` and the book write them."""
    folder = tmp_path_factory.mktemp("schemas")
    write_schemas.write(folder)
    return folder


@pytest.fixture(params=COMMANDS)
def shown(request: pytest.FixtureRequest, kept: Callable[[str], Shown]) -> Shown:
    return kept(request.param)


def alike(ours: object, written: object) -> bool:
    """Equal; what follows from numbers of nine digits may differ in the last of them."""
    if isinstance(ours, dict) and isinstance(written, dict):
        return ours.keys() == written.keys() and all(alike(ours[key], written[key]) for key in ours)
    if isinstance(ours, list) and isinstance(written, list):
        return len(ours) == len(written) and all(map(alike, ours, written))
    if isinstance(ours, float) and isinstance(written, float):
        return ours == pytest.approx(written, rel=1e-8)
    return ours == written


def test_every_class_of_results_is_found() -> None:
    """A file names the class of its result, which is looked for among the public names."""
    there = write_schemas.results()
    assert {name: getattr(sg, name, None) for name in there} == there


def test_a_result_is_what_its_schema_says(shown: Shown, schemas: Path) -> None:
    written = json.loads(shown.json.read_text())
    validator = jsonschema.Draft202012Validator(json.loads((schemas / f"{shown.name}.json").read_text()))
    validator.validate(written)
    assert not validator.is_valid(written | {"unheard": 1})
    assert not validator.is_valid({key: value for key, value in written.items() if key != "next_step"})


def test_a_result_comes_back_from_its_json(shown: Shown) -> None:
    written = json.loads(shown.json.read_text())
    beside = {key: written.pop(key) for key in ("provenance", "plots", "output") if key in written}
    assert beside["provenance"]["result"] == shown.name
    result = load_result(shown.json)
    assert type(result).__name__ == shown.name
    assert result.is_read_back
    # Where a file was written, the next step is what to do with it, which only the command knows.
    own = result.to_dict()
    assert alike(own, written | {"next_step": own["next_step"]})
    assert written["next_step"] in (own["next_step"], result.next_step_after(beside.get("output", "")))
    assert result.answer
    assert result.page(motion=False).verdict == result.answer


def test_its_page_holds_its_json_and_the_motion_of_its_programs(shown: Shown) -> None:
    found = pieces(shown.page)
    assert found["result"] == json.loads(shown.json.read_text())
    assert f"wrote {shown.page.name}" in " ".join(shown.out.split())
    programs = {"Conversion": 2, "Simulation": 1, "CycleTime": 1, "Check": 1, "Measurement": 1}
    if shown.name in programs:
        assert len(found["scene-head"]["variants"]) == programs[shown.name]


def test_output_fits_80_columns_and_begins_with_the_answer(shown: Shown) -> None:
    """Of paths, commands to copy, and text that a terminal wraps between words, lines may be longer."""
    assert "\x1b" not in shown.out + shown.err
    lines = shown.out.splitlines()
    result = load_result(shown.json)
    assert lines[0] == result.answer
    tables = "\n".join(str(table) for table in result.tables())
    assert max(map(len, tables.splitlines()), default=0) <= 80
    # A word of a table that is nowhere whole on the screen has been cut.
    words = set(shown.out.split())
    for table in result.tables():
        heads = {column.heading for column in table.shown()}
        left = {head for head in heads if any("left out" in line and head in line for line in lines)}
        assert {word for head in heads - left for word in head.split()} <= words


def test_what_the_json_does_not_hold_says_so(tmp_path: Path) -> None:
    result: Any = load_result(made(tmp_path, "Conversion"))
    with pytest.raises(NotKeptError, match="placed: the JSON of a result does not contain it"):
        len(result.placed)
    with pytest.raises(NotKeptError, match="emitted: the JSON"):
        _ = result.emitted.regions
    with pytest.raises(NotKeptError, match="emitted: the JSON"):
        _ = result.text


def edited(file: Path, change: Any) -> Path:
    report = json.loads(file.read_text())
    change(report)
    file.write_text(json.dumps(report))
    return file


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r: r.pop("provenance"), "key provenance is missing"),
        (lambda r: r["provenance"].update(format=99), "provenance.format = 99: written by shapegcode .*; this version"),
        (lambda r: r["provenance"].update(result="os.system"), "provenance.result = os.system: not a result"),
        (lambda r: r.pop("cycle_time_s"), "key cycle_time_s is missing"),
        (lambda r: r.update(cycle_time_s="long"), 'cycle_time_s = "long": must be a number'),
        (lambda r: r.update(regions=3), "regions = 3: must be a list"),
        (lambda r: r["regions"][0].update(lines=[1]), r"regions\[0\].lines = \[1\]: must be a list of 2"),
        (lambda r: r.update(unheard=1), "key unheard is not one of a CycleTime"),
    ],
)  # fmt: skip
def test_a_json_of_another_kind_names_the_key(change: Any, said: str, tmp_path: Path) -> None:
    file = edited(made(tmp_path, "CycleTime"), change)
    with pytest.raises(sg.ArgumentError, match=f"r.json: {said}"):
        load_result(file)


def test_a_file_that_was_cut_off_says_where(tmp_path: Path) -> None:
    file = made(tmp_path, "CycleTime")
    text = file.read_text()
    file.write_text(text[: len(text) // 2])
    with pytest.raises(sg.ArgumentError, match=r"line \d+, column \d+: .*the file ends in the middle"):
        load_result(file)
    file.write_bytes(b"\xff\xfe{")
    with pytest.raises(sg.ArgumentError, match="byte 0 is not UTF-8"):
        load_result(file)
    file.write_text("3")
    with pytest.raises(sg.ArgumentError, match="the file is not an object"):
        load_result(file)
    file.write_text(f"[{text},{text}]")
    with pytest.raises(sg.ArgumentError, match="contains 2 results"):
        load_result(file)
    file.write_text("[" * 100_000)
    with pytest.raises(sg.ArgumentError, match=r"nested too deeply|cut off"):
        load_result(file)


def test_results_for_notebooks_and_tables(tmp_path: Path) -> None:
    (tmp_path / "a<b>.nc").write_text(PART)
    time = sg.cycle_time(tmp_path / "a<b>.nc", "vx500")
    html = time._repr_html_()
    assert "a&lt;b&gt;.nc" in html and "<b>.nc" not in html
    regions = time.to_pandas("regions")
    assert list(regions["duration_s"]) == pytest.approx([region.duration_s for region in time.regions])
    assert regions.attrs["units"]["duration_s"] == "s"
    with pytest.raises(sg.ArgumentError, match=r"regons: not a list of rows of this result; it has tools, regions"):
        time.to_pandas("regons")
    with pytest.raises(sg.ArgumentError, match="it has no arrays"):
        time.to_xarray()
    motion = sg.simulate_motion(tmp_path / "a<b>.nc", "vx500")
    simulation = sg.simulate(tmp_path / "a<b>.nc", "vx500")
    assert simulation.plot("path").get_xlabel()
    with pytest.raises(sg.ArgumentError, match="plot nothing: one of"):
        simulation.plot("nothing")
    from dataclasses import replace

    data = replace(simulation, motion=motion).to_xarray("motion")
    assert data["low"].shape == motion.low.shape
    assert data["low"].dims[0] == "times_s"
    assert list(data["axis"].values) == ["x", "y", "z"]
    assert data["times_s"].attrs["units"] == "s"


def test_keys_of_the_version_before_are_read(kept: Callable[[str], Shown], tmp_path: Path) -> None:
    report = json.loads(kept("Conversion").json.read_text(encoding="utf-8"))
    current = load_result(kept("Conversion").json)
    report["rests_on"] = report.pop("parameter_sensitivity")
    for cut in report["cuts"]:
        cut["cure"] = cut.pop("remedy")
    for case in report["cases"]:
        case["starved_ms"] = case.pop("underrun_ms")
    (tmp_path / "old.json").write_text(json.dumps(report))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        old = load_result(tmp_path / "old.json")
    assert {str(each.message).rpartition(": ")[2] for each in caught} == {
        "key rests_on of a Conversion is parameter_sensitivity now",
        "key cure of a CutOutcome is remedy now",
        "key starved_ms of a CaseVerdict is underrun_ms now",
    }
    assert len(caught) == 3, "each once"
    assert old == current and isinstance(old, sg.Conversion)
    with pytest.warns(FutureWarning, match=r"Conversion\.rests_on is Conversion\.parameter_sensitivity now"):
        assert old.rests_on == old.parameter_sensitivity  # type: ignore[attr-defined]
    with pytest.warns(FutureWarning, match=r"CutOutcome\.cure is CutOutcome\.remedy now"):
        assert old.cuts[0].cure == old.cuts[0].remedy  # type: ignore[attr-defined]
    with pytest.raises(AttributeError, match="'ruse'"):
        old.ruse  # type: ignore[attr-defined]  # noqa: B018


def test_names_of_the_version_before_are_free() -> None:
    classes = {cls.__name__: cls for cls in with_old_names(OldNames)}
    assert RENAMED.keys() <= classes.keys()
    for name, fields in RENAMED.items():
        if name == "Result":
            continue  # `provenance` is not a field: the command adds it to the JSON
        own = {*dir(classes[name]), *(field.name for field in dataclasses.fields(classes[name]))}
        assert set(fields.values()) <= own and not fields.keys() & own


def with_old_names(cls: type) -> set[type]:
    """Every class below one, in all modules of the package."""
    write_schemas.results()
    return {cls}.union(*(with_old_names(each) for each in cls.__subclasses__()))
