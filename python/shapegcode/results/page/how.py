"""How to read each picture: one line, by the picture's name."""

from __future__ import annotations

from collections.abc import Mapping

UNKNOWN = "Labels and units are at the axes."

HOW: Mapping[str, str] = {
    "path": "The programmed path beside the table's, magnified as the title says: a gap is an error.",
    "feed": "Speed along the path over time: a dip is a corner or a short block, and costs time.",
    "vibration": "Response of the machine table minus command over time: what oscillates after the stop is the "
    "residual vibration.",
    "tolerance": "Each point is the program at a contour tolerance: left of the knee each micrometre is dear.",
    "motion": "The whole program in time; each band spans the minimum and the maximum of a section.",
    "time": "Each bar is a tool or a region; its colours are where its time goes.",
    "measure-part": "Where on the part each program leaves the contour: further from its line is worse.",
    "measure-walls": "Each wall as a probe would see it, one line for each program; zero is the drawing.",
    "feed-along-path": "Feed and force along the path: where the force touches its limit, the feed gives way.",
    "feed-path": "The tool path from above, coloured by force: bright is where the cutter works hardest.",
    "feed-surface": "What bending of the tool leaves on the wall: blue too little cut, red too much.",
    "shaper-pareto": "Each point is a shaper: further left is faster, further down leaves less vibration.",
    "shaper-sensitivity": "How much vibration is left if the mode is not where it was measured: low and wide is good.",
    "shaper-impulses": "The taps of each shaper: a move is split into so many parts, so far apart.",
    "shaper-steps": "Response of the machine table to a step through each shaper: what oscillates after the "
    "last impulse is the residual vibration.",
    "shaper-branches": "Duration of the shortest shaper over the ratio of two modes: each branch is a way to build it.",
    "identify-sweep": "Each column is a place of the axis: where its peak moves, the mode moves with the position.",
    "identify-response": "Peaks of the measured response are modes; the model should lie on the measurement.",
    "identify-stabilisation": "A mode is where the marks stand one above the other, whatever the order of the model.",
    "identify-traces": "Hammer and response over time; the model should lie on the measurement until both are noise.",
    "identify-decay": "Envelopes of the modes while they die out: a straight line is one mode with constant damping.",
    "identify-spectrum": "Amplitude over frequency: a peak with a label was taken as a mode.",
    "testcut-forces": "Measured forces beside those of the fitted model, over the way of the tool.",
    "testcut-coefficients": "Each coefficient with its interval: one that reaches zero is not determined by the cut.",
    "testcut-corner": "Measured load at the corner beside the predicted one.",
    "testcut-interval": "Measured times between feeds beside the fitted ones.",
    "study-tornado": "The longest bar is the value that decides: its ends say where the verdict is best and worst.",
    "study-bands": "Where the band reaches the dashed line, one machine in twenty or more is out of tolerance.",
    "servo": "Position minus command over time, measured and of the fitted loop.",
    "clock": "Each point is a run: on the diagonal the predicted time is the measured one.",
    "evidence-nist": "Each point is a program: on the diagonal the predicted time is the measured one.",
    "paper001-figure6a-radial-depth": "Radial depth of cut along the corner: it rises where the tool meets both walls.",
    "paper001-figures6bc-forces": "Cutting forces along the corner, by axis.",
    "paper001-figure9-resultant": "Size of the force along the corner, at constant and at scheduled feed.",
    "paper001-figures11-12-surface": "Error of the wall over its height and length: zero is the drawing.",
    "paper001-scheduled": "Feed and force along the corner once the feed is scheduled.",
    "paper002-figure2-durations": "Duration of the shaper over the ratio of two modes; each branch is a solution.",
    "paper002-figure3-amplitudes": "Amplitudes of the taps over the ratio of the modes.",
    "paper002-figure4-impulses": "The taps of the shaper with the fewest.",
    "paper002-figure5-sensitivity": "Vibration that is left over the error of the frequency: low and wide is good.",
    "paper002-figure6-responses": "Response of two modes to a shaped step: flat behind the last tap is good.",
    "paper002-figure8-stage-short": "The stage of the paper, a short move: oscillation after it is residual vibration.",
    "paper002-figure9-stage-long": "The stage of the paper, a long move: oscillation after it is residual vibration.",
    "paper003-figures2-3-acceleration": "Acceleration after a tap, measured and of the fitted modes.",
    "paper003-deflection": "The way that belongs to the acceleration: what the tool's tip does.",
}
"""By the names that `plots()` has."""
