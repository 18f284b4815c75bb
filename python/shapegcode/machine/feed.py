"""How a machine follows changes of the feed, and what its spindle can give."""

from __future__ import annotations

from shapegcode.settings.keys import Positive, TomlTable, key


class FeedControl(TomlTable):
    """How the controller follows changes of the feed."""

    interval_mm: Positive = key(
        "shortest piece of path over which the controller follows a change of the feed; scheduled blocks are not "
        "shorter. A test cut with feeds that change every 0.2, 0.4 and 0.6 mm shows it (paper 001, figure 8)",
        unit="mm",
        default=0.6,
        assumed=True,
    )
    max_change_mm_per_min: Positive | None = key(
        "largest change of the feed from one block to the next; left out: not limited", unit="mm/min", default=None
    )
    spindle_power_w: Positive | None = key(
        "power that the spindle gives for as long as it takes; left out: not limited", unit="W", default=None
    )
    spindle_torque_nm: Positive | None = key(
        "torque that the spindle gives for as long as it takes; left out: not limited", unit="N m", default=None
    )
