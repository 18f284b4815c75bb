"""Two hundred random programs in LinuxCNC's words: the package's reading against LinuxCNC's own interpreter."""

from __future__ import annotations

from pathlib import Path

import pytest

from linuxcnc_compare import compare


@pytest.mark.parametrize("group", range(20))
def test_random_programs(group: int, tmp_path: Path) -> None:
    assert sum(compare(1000 + 10 * group + seed, tmp_path) for seed in range(10)) > 200
