"""Designs of shapers, and the choice among them.

`band` says what is to be cancelled, `design` what a design is worth, `registry` which families there are;
`grid_designs` holds the designs on a sample grid that need an optimiser.
"""

from shapegcode.shaping.band import ModeBand, parse_mode_band
from shapegcode.shaping.design import Design, evaluate
from shapegcode.shaping.grid_designs import (
    BlockPeriodCandidate,
    BlockPeriodChoice,
    choose_block_period,
    shortest_non_negative,
)
from shapegcode.shaping.registry import FAMILIES, DesignOptions, Family, design, family_named

__all__ = [
    "FAMILIES",
    "BlockPeriodCandidate",
    "BlockPeriodChoice",
    "Design",
    "DesignOptions",
    "Family",
    "ModeBand",
    "choose_block_period",
    "design",
    "evaluate",
    "family_named",
    "parse_mode_band",
    "shortest_non_negative",
]
