"""What real programs hold beside plain moves, and what a feed schedule makes of it."""

import pytest

import shapegcode as sg
from judge.interpreter import interpret

HEAD = "%\nG90 G54 G17 G21 G94\nS5000 M03\nG00 X-10. Y2. Z-5.\n"
TAIL = "G00 Z50.\nM30\n%\n"
BOX = "[box]\nx_mm = [0.0, 100.0]\ny_mm = [0.0, 60.0]\nz_mm = [-20.0, 0.0]\n"
TOOL = """
[tool]
name = "E8"
{number}
diameter_mm = 8.0
flutes = 4
helix_deg = 30.0
flute_length_mm = {flutes}
overhang_mm = {overhang}
[cutting]
material = "al6061-t6-carbide"
[limits]
resultant_n = 200.0
[feed]
{feed}
"""


def scheduled(body: str, *, head: str = HEAD, flutes: float = 20.0, overhang: float = 32.0, number: int | None = None,
              feed: str = "") -> sg.FeedSchedule:  # fmt: skip
    line = "" if number is None else f"number = {number}"
    tool = sg.Tool.from_toml(TOOL.format(number=line, flutes=flutes, overhang=overhang, feed=feed))
    program = sg.Program.from_text(head + body + TAIL, "vx500", source="part.nc")
    return sg.schedule_feed(program, "vx500", tool, sg.Stock.from_toml(BOX))


def said(result: sg.FeedSchedule, words: str) -> bool:
    return any(words in warning for warning in result.warnings)


@pytest.mark.parametrize(
    "body",
    [
        "G95 G01 X50. F.2\nG94 X110. F1600.\n",
        "G01 X50. F1600.\nG95 X80. F.2\nG94 X110. F1600.\n",
        "G01 X50. F1600.\nG93 X80. F12.\nG94 X110. F1600.\n",
    ],
)
def test_regions_with_other_kinds_of_feed_keep_their_text(body: str) -> None:
    result = scheduled(body)
    assert result.text.decode() == HEAD + body + TAIL
    assert said(result, "not all of its feeds are per minute")


def test_blocks_that_stop_exactly_are_not_divided() -> None:
    body = "G01 X50. F5000.\nG61\nX70.\nX90. Y10.\nX110.\nG64\n"
    result = scheduled(body)
    cuts = interpret(result.text.decode()).cuts
    assert [tuple(move.end[:2]) for move in cuts[-3:]] == [(70.0, 2.0), (90.0, 10.0), (110.0, 10.0)]
    assert result.ok


def test_the_feed_is_given_back_only_where_something_needs_it() -> None:
    twice = "G01 X90. F5000.\nG00 Z50.\nX-10. Y50.\nZ-5.\nG01 X110.\n"
    assert "\nF5000.\nG00 Z50.\nX-10." not in scheduled(twice).text.decode()
    drilled = twice.replace("X-10. Y50.", "G81 X-5. Y70. R2. Z-1.\nG80\nG00 X-10. Y50.")
    assert "\nF5000.\nG00 Z50.\nG81" in scheduled(drilled).text.decode()
    feeds = [move.feed for move in interpret(scheduled(drilled).text.decode()).moves if move.cycle and move.feed > 0.0]
    assert set(feeds) == {5000.0}


def test_a_first_move_without_length_keeps_its_feed() -> None:
    result = scheduled("G01 X-10. F5000.\nX110.\n")
    assert interpret(result.text.decode()).cuts
    assert result.ok


def test_cuts_that_share_their_block_count_though_their_feed_stays() -> None:
    result = scheduled("G01 X50. F5000.\nX110. M08\n")
    assert not result.ok
    (move,) = result.moves
    assert move.place == "part.nc:6"
    assert "limit 200 N" in move.misses[0]


@pytest.mark.parametrize(
    ("shift", "back"), [("G52 Y10.", "G52 Y0."), ("G92 Y-8.", None), ("G10 L2 P1 Y10.", None), ("G55", "G54")]
)
def test_cuts_in_moved_coordinates_are_left(shift: str, back: str | None) -> None:
    moved = f"G01 X110. F5000.\nG00 Z50.\n{shift}\nG00 X-10. Y2.\nZ-5.\nG01 X110. F5000.\n"
    result = scheduled(moved, feed="air_feed_mm_per_min = 6000")
    assert said(result, "coordinates" if back == "G54" else "zero point has been moved")
    assert result.text.decode().endswith(moved.split(shift)[1] + TAIL)
    if back is not None:
        again = scheduled(f"{moved}G00 Z50.\n{back}\nG00 X-10. Y50.\nZ-5.\nG01 X110. F5000.\n")
        plan = again.plans[-1]
        assert len(plan.stretches) > 1


def test_depth_above_the_flutes_and_above_the_overhang_is_said() -> None:
    assert said(scheduled("G01 X110. F1000.\n", flutes=4.0), "cuts 5 mm above the tip, tool.flute_length_mm is 4")
    result = scheduled("G01 X110. F1000.\n", flutes=4.0, overhang=4.5)
    assert said(result, "it cuts 5 mm above the tip, tool.overhang_mm is 4.5")
    assert not result.plans[0]


def test_a_tool_that_is_only_got_ready_does_not_cut() -> None:
    head = HEAD.replace("S5000", "T2\nS5000")
    result = scheduled("G01 X110. F5000.\nG00 Z50.\nM06\nG00 X-10. Y50.\nZ-5.\nG01 X110. F5000.\n", head=head, number=2)
    assert [plan is not None for plan in result.plans] == [False, True]
    assert said(result, "the program names no tool before it")


def test_what_a_ramp_may_have_left_is_no_air() -> None:
    body = "G00 X20. Y30. Z5.\nG01 Z.5 F600.\nX80. Z-8. F500.\nX20. F1000.\nX80.\n"
    result = scheduled(body, head="%\nG90 G54 G17 G21 G94\nS5000 M03\n", feed="air_feed_mm_per_min = 6000")
    level = [move for move in interpret(result.text.decode()).cuts if move.start[2] == move.end[2] == -8.0]
    assert level[-1].end[0] == 80.0
    assert level[-1].feed == 6000.0  # the second pass at depth is air for certain
    assert max(move.feed for move in level[:-1]) <= 1000.0


def test_no_limit_changes_nothing_where_no_limit_acts() -> None:
    body = "G01 X20. F1000.\nX40. F120.\nG02 X60. Y22. R20. F300.\nG01 X70. F900.\n"
    result = scheduled(body.replace("Y2.", "Y2."), head=HEAD.replace("Z-5.", "Z20."))
    assert result.text.decode() == HEAD.replace("Z-5.", "Z20.") + body + TAIL


def test_a_schedule_of_its_own_output_changes_little() -> None:
    body = "G01 X50. F5000.\nG03 X60. Y12. R10.\nG01 Y50.\nX20.\n"
    first = scheduled(body)
    text = first.text.decode()
    again = scheduled(text[len(HEAD) : -len(TAIL)])
    times = [result.cycle_time_s.emitted for result in (first, again)]
    assert times[1] == pytest.approx(times[0], rel=0.01)
    assert again.ok


def test_a_shaped_program_gets_no_other_feeds() -> None:
    original = HEAD + "G01 X50. F5000.\nY20.\nX0.\n" + TAIL
    shaped = sg.convert(original, "vx500", shape_all=True).text.decode()
    tool = sg.Tool.from_toml(TOOL.format(number="", flutes=20.0, overhang=32.0, feed=""))
    with pytest.raises(sg.ProgramError, match="1:1: already shaped by shapegcode"):
        sg.schedule_feed(shaped, "vx500", tool, sg.Stock.from_toml(BOX))
