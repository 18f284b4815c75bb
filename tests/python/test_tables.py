"""Tables of results: they fit a terminal of 80 columns, and no word or figure in them is cut."""

from hypothesis import given, settings, strategies as st

from shapegcode.results.table import Column, Table

WORDS = st.lists(st.text("abcxyz", min_size=1, max_size=9), max_size=12).map(" ".join)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(WORDS, WORDS.filter(bool)), min_size=1, max_size=7))
def test_a_table_whose_words_fit_is_not_wider_than_the_terminal_and_whole(row: list[tuple[str, str]]) -> None:
    columns = tuple(
        Column(name, value=lambda cells, rank=rank: cells[rank], text=True) for rank, (name, _) in enumerate(row)
    )
    lines = str(Table("", columns, [[cell for _, cell in row]])).splitlines()
    assert max(map(len, lines)) <= 80
    shown = [word for line in lines for word in line.split() if set(word) != {"─"}]
    assert sorted(shown) == sorted(word for pair in row for text in pair for word in text.split())


def test_figures_stay_whole_where_the_widest_column_must_shrink_first() -> None:
    columns = tuple(Column(f"quantity{rank} of it", "N", value=lambda row: row, digits=2) for rank in range(7))
    text = str(Table("", columns, [123456.789]))
    assert text.count("123456.79") == 7
    assert all(f"quantity{rank}" in text for rank in range(7))
    assert max(map(len, text.splitlines())) <= 80
