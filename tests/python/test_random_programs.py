"""Programs at random against an interpreter, a player and a plant that share nothing with the package. One of a seed:
`PYTHONPATH=tests/oracles python -c "from judge.draws import draw; print(draw(7).text)"`."""

import re
from collections.abc import Callable
from dataclasses import replace

import pytest

from effort import trials
from judge.dialect import play
from judge.draws import draw
from random_verdict import Case, complaints, convert, read
from second_reading import compare

QUICK = range(16)
MANY = range(len(QUICK), len(QUICK) + trials(500))
CHUNK = 20


def judged(seed: int) -> list[str]:
    """What the judge and the report of a seed's program differ in, each with the seed."""
    case = convert(draw(seed), shape_all=True)
    offsets = {name: tuple(place) for name, place in case.drawn.keys["input.work_offsets"].items()}
    compare(case.drawn.text, case.machine, place_mm=1.001 * case.increment_mm, work_offsets=offsets)
    found = complaints(case)
    if seed % 4 == 0:  # regions that gain little keep their text
        found += [f"kept regions: {what}" for what in complaints(convert(draw(seed), shape_all=False))]
    return [f"seed {seed}: {what}" for what in found]


@pytest.mark.parametrize("seed", QUICK)
def test_the_report_is_the_judges(seed: int) -> None:
    found = judged(seed)
    assert not found, "\n".join([*found, draw(seed).text])


@pytest.mark.slow
@pytest.mark.parametrize("first", range(MANY.start, MANY.stop, CHUNK))
def test_many_reports_are_the_judges(first: int) -> None:
    found = [what for seed in range(first, min(first + CHUNK, MANY.stop)) for what in judged(seed)]
    assert not found, "\n".join(found)


def test_what_is_drawn() -> None:
    """Every kind of word, in programs that the judge can play; the same seed gives the same program."""
    drawn = [draw(seed) for seed in range(60)]
    text = "".join(each.text for each in drawn)
    for word in (
        *("G02", "G03", "G18", "G19", "G20", "G91", "G52", "G92", "G55", "G16", "G51X", "G51.1", "G68", "G04", "G09"),
        *("G81", "G82", "G83", "G73", "G84", "G85", "G86", "G89"),
    ):
        assert word in text, word
    assert {each.machine for each in drawn} == {"vx500", "kimm004"}
    assert draw(5) == draw(5)
    feeds = [float(found) for found in re.findall(r"F([\d.]+)", text)]
    assert min(feeds) < 15.0 and max(feeds) > 8000.0
    offsets = {name: tuple(place) for name, place in drawn[0].keys["input.work_offsets"].items()}
    sizes = [item.radius for each in drawn for item in play(each.text, work_offsets=offsets) if item.kind == "arc"]
    assert min(sizes) < 0.05 and max(sizes) > 10.0


SEED = 3  # lines, arcs, helices and a reversal in inches


def spoilt(change: Callable[[str], str]) -> list[str]:
    """The complaints about a seed's conversion with its text changed behind the report's back."""
    case = convert(draw(SEED), shape_all=True)
    text = case.conversion.text.decode("latin-1")
    assert complaints(case) == []
    changed = change(text)
    assert changed != text
    return complaints(replace(case, emitted=read(changed, case.drawn)))


def in_the_middle(pattern: str, by: Callable[[float], str]) -> Callable[[str], str]:
    """Changes the number of the middle one of all words that match."""

    def change(text: str) -> str:
        found = list(re.finditer(pattern, text))
        word = found[len(found) // 2]
        return text[: word.start(1)] + by(float(word[1])) + text[word.end(1) :]

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (in_the_middle(r"\nX-?[\d.]+Y(-?[\d.]+)F", lambda y: f"{y + 0.002:.4f}"), "contour|peak|residual"),
        (in_the_middle(r"F([\d.]+)\n", lambda f: f"{1.5 * f:.2f}"), "takes|programs|says"),
        (lambda text: text.replace("G90G00X0Y0Z1.9685", "G90G00X0Y0Z1.9675"), "rapid to"),
        (in_the_middle(r"R([\d.]+)F", lambda r: f"{3.0 * r:.4f}"), "contour|takes|says"),
    ],
)
def test_a_spoilt_text_is_noticed(change: Callable[[str], str], words: str) -> None:
    found = spoilt(change)
    assert any(re.search(words, what) for what in found), found


def test_a_wrong_report_is_noticed() -> None:
    case: Case = convert(draw(SEED), shape_all=True)
    (first, *others) = case.conversion.regions
    for wrong in (
        replace(first, contour_error_um=4.0 * first.contour_error_um + 10.0),
        replace(first, contour_error_um=0.5 * first.contour_error_um - 1.0),
        replace(first, time_s=replace(first.time_s, emitted=first.time_s.emitted + 0.001)),
        replace(
            first,
            residual_vibration_um=replace(
                first.residual_vibration_um, emitted=replace(first.residual_vibration_um.emitted, x=9.0)
            ),
        ),
    ):
        other = replace(case, conversion=replace(case.conversion, regions=(wrong, *others)))
        assert complaints(other) != []
