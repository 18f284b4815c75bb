"""Designs of shapers, and the choice among them.

`band` says what is to be cancelled, `design` what a design is worth, `registry` which families there are,
`choice` which to take, `comparison` what a user may ask of it; `grid_designs` holds the designs on a sample grid that
need an optimiser.
"""

from shapegcode.shaping.band import ModeBand, parse_mode_band
from shapegcode.shaping.choice import Recommendation, Refusal, choose, pareto_front, recommend
from shapegcode.shaping.comparison import candidate_periods, choose_shaper, machine_bands
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
    "Recommendation",
    "Refusal",
    "candidate_periods",
    "choose",
    "choose_block_period",
    "choose_shaper",
    "design",
    "evaluate",
    "family_named",
    "machine_bands",
    "pareto_front",
    "parse_mode_band",
    "recommend",
    "shortest_non_negative",
]
