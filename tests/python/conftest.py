"""What every Python test shares."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

import hypothesis
import pytest

if TYPE_CHECKING:
    from browser import Browser

# Figures are files here; no display is looked for.
os.environ["MPLBACKEND"] = "Agg"

# The same examples in every run, so that a red run is the fault of its commit. To look for new ones:
# `pytest --hypothesis-profile=search`.
hypothesis.settings.register_profile("gate", derandomize=True, deadline=None)
hypothesis.settings.register_profile("search", deadline=None, max_examples=2000)
hypothesis.settings.load_profile("gate")


@pytest.fixture(scope="module")
def chrome() -> Iterator[Browser]:
    from browser import chromium  # with all of Selenium, which few tests need

    with chromium() as browser:
        yield browser
