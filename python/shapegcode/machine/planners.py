"""Controls whose planner is modelled beside FANUC's: their settings, by the names of their own configuration files."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict

from shapegcode.settings.keys import Bool, NonNegative, Positive, TomlTable, key

ControllerKind = Literal["fanuc", "linuxcnc", "klipper", "grbl"]
PLANNER_NAMES = {"fanuc": "FANUC", "linuxcnc": "LinuxCNC", "klipper": "Klipper", "grbl": "GRBL"}
"""Kinds of controls for people."""


class LinuxcncPlanner(TomlTable):
    """What the INI file and the program say of the motion; its period is interpolation_period_s."""

    blend_tolerance_mm: Annotated[NonNegative, Field(le=100)] = key(
        "G64 P of the program (those written here have P0.001): how far a blend may leave a corner; 0: G64 without P",
        assumed=0.001,
    )
    naive_cam_tolerance_mm: Annotated[NonNegative, Field(le=100)] = key(
        "G64 Q of the program (those written here have Q0), without it as P: lines of one feed within it become one, "
        "and an arc in XY within it two lines; 0: not",
        assumed=0.0,
    )
    ramp_frequency_hz: Annotated[Positive, Field(ge=0.001, le=1e6)] = key(
        "[TRAJ] ARC_BLEND_RAMP_FREQ: in a segment that takes less than its inverse the speed is a linear ramp",
        assumed=100.0,
    )
    kink_ratio: Annotated[Positive, Field(ge=0.001, le=1)] = key(
        "[TRAJ] ARC_BLEND_KINK_RATIO: share of the acceleration that the change of direction between two segments may "
        "take, within one period; above it slows. It acts up to 0.7071",
        assumed=0.1,
    )
    max_feed_override: Annotated[Positive, Field(ge=0.01, le=100)] = key(
        "[DISPLAY] MAX_FEED_OVERRIDE: corners are planned for it", unit="1", assumed=1.0
    )
    optimization_depth: Annotated[int, Strict(), Field(ge=2, le=4096)] = key(
        "[TRAJ] ARC_BLEND_OPTIMIZATION_DEPTH: segments that it looks ahead", unit="segments", assumed=50
    )
    rapid_follows: Bool = key(
        "a rapid follows each cut; false: a dwell, an M function or the end of the program follows, and the last move "
        "decelerates with half of the acceleration",
        assumed=True,
    )


class KlipperPlanner(TomlTable):
    """What printer.cfg says of the motion; max_velocity and max_accel are the smaller of X and Y."""

    square_corner_velocity_mm_per_s: Annotated[NonNegative, Field(le=1000)] = key(
        "[printer] square_corner_velocity: speed at a corner of 90 degrees", assumed=5.0
    )
    minimum_cruise_ratio: Annotated[NonNegative, Field(lt=1)] = key(
        "[printer] minimum_cruise_ratio: share of a move that is no change of speed; with max_accel_to_decel in its "
        "place 1 - max_accel_to_decel / max_accel",
        assumed=0.5,
    )
    arc_resolution_mm: Annotated[Positive, Field(ge=0.001, le=100)] = key(
        "[gcode_arcs] resolution: length of the lines that an arc of the original becomes; in what is emitted with "
        'emission.dialect = "klipper" arcs are chords already, and are simulated as these',
        assumed=1.0,
    )


class GrblPlanner(TomlTable):
    """What `$$` says of the motion, and what was compiled in."""

    junction_deviation_mm: Annotated[Positive, Field(ge=1e-6, le=10)] = key(
        "$11: a corner is passed as an arc that cuts it by so much, at the acceleration of the axes", assumed=0.01
    )
    arc_tolerance_mm: Annotated[Positive, Field(ge=1e-5, le=10)] = key(
        "$12: distance of the lines that an arc becomes from it", assumed=0.002
    )
    look_ahead_blocks: Annotated[int, Strict(), Field(ge=2, le=4096)] = key(
        "blocks that its planner holds (BLOCK_BUFFER_SIZE less 1); it can always stop at the end of the last one, and "
        "short blocks slow it by that",
        unit="blocks",
        assumed=15,
    )
