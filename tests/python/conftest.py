"""What every Python test shares."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

import hypothesis
import pytest
from slow_tests import read_list

if TYPE_CHECKING:
    from browser import Browser

# Figures are files here; no display is looked for.
os.environ["MPLBACKEND"] = "Agg"

# The same examples in every run, so that a red run is the fault of its commit. To look for new ones:
# `pytest --hypothesis-profile=search`.
hypothesis.settings.register_profile("gate", derandomize=True, deadline=None)
hypothesis.settings.register_profile("search", deadline=None, max_examples=2000)
hypothesis.settings.load_profile("gate")


@pytest.hookimpl(tryfirst=True)  # before -m looks at the marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what takes long; a name in the list that is no test any more is an error."""
    slow = read_list()
    found = set()
    for item in items:
        if (name := item.nodeid.removeprefix("tests/python/")) in slow:
            item.add_marker(pytest.mark.slow)
            found.add(name)
    has_parts = any("::" in str(each) for each in config.invocation_params.args)
    files = set() if has_parts else {item.path.name for item in items}
    if gone := sorted(name for name in slow - found if name.split("::")[0] in files):
        raise pytest.UsageError(f"tests/python/slow_tests.txt names what is no test: {', '.join(gone)}")


@pytest.fixture(scope="module")
def chrome() -> Iterator[Browser]:
    from browser import chromium  # with all of Selenium, which few tests need

    with chromium() as browser:
        yield browser
