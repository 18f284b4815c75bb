"""Designs of shapers, and the choice among them.

`band` says what is to be cancelled, `design` what a design is worth, `registry` which families there are,
`choice` which to take by the rules of `ranking`, `comparison` what a user may ask of it; `grid_designs` holds the exact
designs on a sample grid that need an optimiser, `robust` those that hold over bands (`robust_search` and
`cutting_planes` find them), and `block_period` chooses the grid.
"""

from shapegcode.shaping.bands import ModeBand, parse_mode_band
from shapegcode.shaping.block_period import (
    BlockPeriodCandidate,
    BlockPeriodChoice,
    choose_block_period,
    choose_robust_grid,
    robust_candidate,
)
from shapegcode.shaping.choose import choose
from shapegcode.shaping.comparison import candidate_periods, choose_shaper, machine_bands
from shapegcode.shaping.design import Design, evaluate
from shapegcode.shaping.grid_designs import shortest_non_negative
from shapegcode.shaping.ranking import pareto_front, recommend
from shapegcode.shaping.registry import FAMILIES, DesignOptions, Family, design, family_named
from shapegcode.shaping.result import Recommendation, Refusal, families_table
from shapegcode.shaping.robust.minimax import VIBRATION_LIMIT, RobustDesign, least_worst, minimax_robust

__all__ = [
    "FAMILIES",
    "VIBRATION_LIMIT",
    "BlockPeriodCandidate",
    "BlockPeriodChoice",
    "Design",
    "DesignOptions",
    "Family",
    "ModeBand",
    "Recommendation",
    "Refusal",
    "RobustDesign",
    "candidate_periods",
    "choose",
    "choose_block_period",
    "choose_robust_grid",
    "choose_shaper",
    "design",
    "evaluate",
    "families_table",
    "family_named",
    "least_worst",
    "machine_bands",
    "minimax_robust",
    "pareto_front",
    "parse_mode_band",
    "recommend",
    "robust_candidate",
    "shortest_non_negative",
]
