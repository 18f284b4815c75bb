"""Designs of shapers, and the choice among them.

What is to be cancelled: `bands`. The families, one row each: `registry`, with their solvers in `families`,
`grid_designs` (exact on a sample grid) and `robust` (within a limit over bands); what one is worth: `designs`; taps of
a user: `taps`. The choice: `comparison` designs every family on the `periods` worth trying, `ranking` says which to
take, `recommendation` takes the question and gives a `result`. For a conversion: `block_period` chooses the period,
`grid` the shaper on it for a machine, `per_axis` one for each axis, `track` those that follow moving modes.

Each name is loaded on first use: who compares shapers needs neither machine nor controller.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shapegcode.shaping.bands import ModeBand, machine_bands, parse_mode_band
    from shapegcode.shaping.block_period import (
        BlockPeriodCandidate,
        BlockPeriodChoice,
        choose_block_period,
        robust_candidate,
    )
    from shapegcode.shaping.comparison import choose
    from shapegcode.shaping.designs import Design, evaluate
    from shapegcode.shaping.grid import Grid, choose_grid, shaper_track
    from shapegcode.shaping.grid_designs import shortest_non_negative
    from shapegcode.shaping.modal_run import ModalRun, respond, shaped_step
    from shapegcode.shaping.per_axis import design_per_axis
    from shapegcode.shaping.periods import candidate_periods
    from shapegcode.shaping.ranking import pareto_front, recommend
    from shapegcode.shaping.recommendation import choose_shaper
    from shapegcode.shaping.registry import FAMILIES, DesignOptions, Family, design, family_named
    from shapegcode.shaping.result import Recommendation, Refusal, families_table
    from shapegcode.shaping.robust.minimax import VIBRATION_LIMIT, RobustDesign, least_worst, minimax_robust
    from shapegcode.shaping.taps import parse_taps
    from shapegcode.shaping.track import MovingMode, ShaperTrack, TrackNode, design_track

__all__ = [
    "FAMILIES",
    "VIBRATION_LIMIT",
    "BlockPeriodCandidate",
    "BlockPeriodChoice",
    "Design",
    "DesignOptions",
    "Family",
    "Grid",
    "ModalRun",
    "ModeBand",
    "MovingMode",
    "Recommendation",
    "Refusal",
    "RobustDesign",
    "ShaperTrack",
    "TrackNode",
    "candidate_periods",
    "choose",
    "choose_block_period",
    "choose_grid",
    "choose_shaper",
    "design",
    "design_per_axis",
    "design_track",
    "evaluate",
    "families_table",
    "family_named",
    "least_worst",
    "machine_bands",
    "minimax_robust",
    "pareto_front",
    "parse_mode_band",
    "parse_taps",
    "recommend",
    "respond",
    "robust_candidate",
    "shaped_step",
    "shaper_track",
    "shortest_non_negative",
]

_HOME = {
    "bands": ("ModeBand", "machine_bands", "parse_mode_band"),
    "block_period": ("BlockPeriodCandidate", "BlockPeriodChoice", "choose_block_period", "robust_candidate"),
    "comparison": ("choose",),
    "designs": ("Design", "evaluate"),
    "grid": ("Grid", "choose_grid", "shaper_track"),
    "grid_designs": ("shortest_non_negative",),
    "modal_run": ("ModalRun", "respond", "shaped_step"),
    "per_axis": ("design_per_axis",),
    "periods": ("candidate_periods",),
    "ranking": ("pareto_front", "recommend"),
    "recommendation": ("choose_shaper",),
    "registry": ("FAMILIES", "DesignOptions", "Family", "design", "family_named"),
    "result": ("Recommendation", "Refusal", "families_table"),
    "robust.minimax": ("VIBRATION_LIMIT", "RobustDesign", "least_worst", "minimax_robust"),
    "taps": ("parse_taps",),
    "track": ("MovingMode", "ShaperTrack", "TrackNode", "design_track"),
}


def __getattr__(name: str) -> Any:
    """Load a name on first use."""
    for module, names in _HOME.items():
        if name in names:
            value = getattr(importlib.import_module(f"{__name__}.{module}"), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
