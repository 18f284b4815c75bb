"""An independent judge for CNC programs: interpreter, playback, plant, conversion check.

Plain Python and NumPy. It shares no code with the converter it judges. `interpreter` reads a program,
`player` turns cutting blocks into set-points, `plant` gives residual vibration and contour error,
`conversion` compares two program texts, `generate` draws random valid programs (it needs hypothesis and is
not imported here).
"""

from .conversion import regions, split, verify_conversion
from .interpreter import initial_state, interpret
from .plant import ContourError, Mode, contour_error_um, path_polyline, residual_um, response, rest_index
from .player import durations, moving_average, play, starts
from .records import Interpretation, JudgeError, LineRecord, Move

__all__ = [
    "ContourError",
    "Interpretation",
    "JudgeError",
    "LineRecord",
    "Mode",
    "Move",
    "contour_error_um",
    "durations",
    "initial_state",
    "interpret",
    "moving_average",
    "path_polyline",
    "play",
    "regions",
    "residual_um",
    "response",
    "rest_index",
    "split",
    "starts",
    "verify_conversion",
]
