"""The component is unloaded while its thread runs it: nothing crashes, nothing stays behind."""

from __future__ import annotations

import linuxcnc_run
import pytest
import unload

GROWTH_KIB = 64
"""Of rtapi_app from the first look to the last. A filter that is left is 5 KiB, and its thread another 12."""


@pytest.mark.parametrize("cycles", [50, pytest.param(1000, marks=pytest.mark.slow)])
def test_unloading_while_the_thread_runs(cycles: int) -> None:
    seen = unload.run(linuxcnc_run.as_user(), cycles)
    assert seen.exit_code == 0, seen.said[-2000:]
    assert "failed" not in seen.said
    assert "giving up" not in seen.said, "rtapi_app was not there at the end"
    assert len(seen.processes) == unload.LOOKS
    assert len(set(seen.processes)) == 1, "rtapi_app was started again"
    assert len(set(seen.threads)) == 1, "threads stayed behind"
    assert seen.resident_kib[-1] - seen.resident_kib[0] <= GROWTH_KIB
    assert "siggen.0.update" in seen.said, "the thread is not there any more"
    print(f"\n{cycles} cycles: {seen.resident_kib} KiB, {seen.threads} threads")
