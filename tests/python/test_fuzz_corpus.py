"""What the fuzzer of the parameter import has found is imported or refused without harm."""

import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
sys.path.insert(0, str(TESTS / "fuzz"))

from parameters_check import check_import  # noqa: E402

CORPUS = sorted((TESTS / "fuzz" / "corpus" / "parameters").iterdir())


@pytest.mark.parametrize("file", CORPUS, ids=lambda file: file.name)
def test_parameter_dump_of_the_corpus(file: Path) -> None:
    assert check_import(file.read_bytes()) in ("imported", "refused")


def test_the_corpus_holds_both() -> None:
    assert {check_import(file.read_bytes()) for file in CORPUS} == {"imported", "refused"}
