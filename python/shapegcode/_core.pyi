"""
Compiled core of shapegcode: program text, motion, filters, shapers, plant and metrology.
"""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
__all__: list[str] = ['AccelerationLaw', 'Activity', 'ArcFigures', 'ArgumentError', 'Arma', 'BlockEnd', 'BlockKind', 'BlockMark', 'ChipThickness', 'CircleFigures', 'CircleFit', 'CodeBindings', 'CommandPlanner', 'ComparedKind', 'ContourSolver', 'ContourTarget', 'ContourTracker', 'ControllerEvent', 'ControllerKind', 'ControllerState', 'CornerCut', 'CornerEngagement', 'CornerSection', 'CuttingCoefficients', 'CycleTime', 'DecayFit', 'DesignError', 'DeviationStats', 'EndMill', 'EngagementTrack', 'EquivalentMass', 'ExpandedProgram', 'ExtraInsensitive', 'FanucModel', 'FeedDrive', 'FeedDriveParameters', 'FeedDriveRealTime', 'FeedExcess', 'FeedLimit', 'FeedLimits', 'FeedOf', 'FeedRate', 'FeedStretch', 'FeedWriterOptions', 'FilterShape', 'FilterTolerance', 'Fir', 'FirStream', 'FitOptions', 'FittedBlocks', 'FollowingFir', 'FollowingLimits', 'ForceCurve', 'ForceFigures', 'FrequencyBand', 'FrictionModel', 'FrictionParameters', 'InPosition', 'InterpolatedTime', 'Interpolator', 'JogResult', 'LimitedFeed', 'LinearBlock', 'LinearPlant', 'LinuxcncOptions', 'LinuxcncProgram', 'LinuxcncSlowing', 'LinuxcncToolTable', 'Material', 'MetrologyOptions', 'MillingForce', 'MinimalBranches', 'MinimalShapers', 'ModalFit', 'ModalState', 'Mode', 'ModeRanking', 'ModeTable', 'MotionController', 'MotionKind', 'MotionLimits', 'NumericError', 'OffsetLimits', 'OverrideFigures', 'Path', 'PathFollower', 'PathSection', 'PlannerRules', 'PositionFeedback', 'ProgramComparison', 'ProgramEntry', 'ProgramError', 'ProgramText', 'PushResult', 'RapidPath', 'ReaderOptions', 'RefedRegion', 'Region', 'RegionNote', 'RegionShaper', 'RestVibration', 'Roughness', 'SectionFigures', 'SectionKind', 'SectionMetrology', 'Segment', 'SegmentKind', 'SegmentRules', 'ServoLag', 'ShapedCommand', 'ShapedRegions', 'ShapegcodeError', 'Shaper', 'ShapingOptions', 'SideFigures', 'SiemensOptions', 'SiemensProgram', 'SimulationChunk', 'SimulationFigures', 'SimulationOptions', 'SimulationStream', 'SpeedProfile', 'SpindleSense', 'StarvedFigures', 'StepKind', 'ToolBeam', 'ToolOffset', 'ToolTime', 'TrackFigures', 'Travel', 'VaryingFir', 'VaryingFirStream', 'WallFigures', 'WallSide', 'WorkLimits', 'WorstResidual', 'WriterOptions', 'acceleration_filters', 'arma_decay', 'arma_driven', 'block_overlap_time_s', 'busiest_per_s', 'compare_programs', 'contour_kernel', 'controlled_motion', 'convolve', 'convolved_zv', 'count_slowed_blocks', 'csv_rows', 'divisible_segments', 'equivalent_mass_bisection', 'equivalent_mass_closed_form', 'extra_insensitive', 'fastest_block_ends', 'feeds_per_minute', 'fit_blocks', 'fit_circle', 'fit_decay', 'fit_modes', 'for_shaped_blocks', 'gaussian_low_pass', 'grid_polynomial', 'in_position_wait_behind_s', 'in_position_wait_s', 'insensitive_band', 'insensitivity', 'interpolate', 'interpolate_program', 'largest_difference_mm', 'largest_feed', 'largest_feeds', 'layer_borders', 'line_sections', 'linear_blocks', 'linear_distance_mm', 'linear_duration_s', 'linear_end_speed', 'linear_model', 'linear_positions_mm', 'linuxcnc_peck_clearance_mm', 'linuxcnc_slowing', 'list_programs', 'look_ahead_on_load', 'machine_frame', 'matrix_exponential', 'measure_roughness', 'minimal_branches', 'minimal_shapers', 'minimal_two_mode', 'modal_response', 'mzv', 'mzv_second_zero', 'negative_zv', 'path_sections', 'plan_speed', 'plan_tolerances', 'plant_response', 'poles_to_modes', 'rank_modes', 'rapid_samples', 'rapid_time_s', 'read_linuxcnc', 'read_parts', 'read_program', 'read_siemens', 'repeated_zv', 'schedule_feed', 'sensitivity_curve', 'shape_path', 'simulate_blocks', 'simulate_circle', 'simulate_path', 'simulate_planned', 'simulate_samples', 'simulated_duration_s', 'stabilisation_poles', 'sweep', 'thin_curves', 'time_optimal_trajectory', 'time_program', 'travel_blocks', 'travel_path', 'wall_error_um', 'wall_errors_um', 'wilson_theta', 'with_feeds', 'worst_residual', 'write_blocks', 'write_feeds', 'zv', 'zv_on_grid']
class ShapegcodeError(Exception):
    """
    Base of every error that shapegcode raises.
    """
class ProgramError(ShapegcodeError):
    """
    The CNC program cannot be read. `line` and `column` count from 1 (0: not known); `alarm`: FANUC's number (0: none); `file`: name of its file (empty: the program itself).
    """
    alarm: typing.ClassVar[int] = 0
    column: typing.ClassVar[int] = 0
    file: typing.ClassVar[str] = ''
    line: typing.ClassVar[int] = 0
class DesignError(ShapegcodeError):
    """
    The requested shaper does not exist, or not on this grid, or cannot be computed.
    """
class ArgumentError(ShapegcodeError, ValueError):
    """
    A value is outside its stated range.
    """
class NumericError(ShapegcodeError):
    """
    A solver failed or did not converge; the message says which.
    """
class Fir:
    """
    Weights on the sample grid that add up to one: an acceleration filter (moving average) or an input shaper. One filter type for both.
    """
    @staticmethod
    def exponential(time_constant_samples: typing.SupportsFloat | typing.SupportsIndex, rest: typing.SupportsFloat | typing.SupportsIndex = 1e-06) -> Fir:
        """
        Geometric weights exp(-k / time_constant), cut off where less than the ratio `rest` of their sum remains and scaled to a sum of 1; costs the same for any length. Raises ArgumentError on a time constant that is not > 0 or a ratio outside 0 ... 1.
        """
    @staticmethod
    def moving_average(length: typing.SupportsInt | typing.SupportsIndex) -> Fir:
        """
        Equal weights over `length` samples; costs the same for any length. Raises ArgumentError below 1.
        """
    def __init__(self, delays: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], taps: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> None:
        """
        Taps at whole-sample delays, ascending, adding up to 1. Raises ArgumentError otherwise.
        """
    def __repr__(self) -> str:
        ...
    def apply(self, samples: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
        """
        Filter samples of shape (n,) or (n, n_axes); the result has duration_samples more rows. The input is held at its first value before and at its last value after. Bit-identical to FirStream. Raises ArgumentError on another shape.
        """
    @property
    def delays(self) -> list[int]:
        """
        Delays in samples.
        """
    @property
    def duration_samples(self) -> int:
        """
        Largest delay in samples.
        """
    @property
    def mean_samples(self) -> float:
        """
        Mean delay in samples.
        """
    @property
    def taps(self) -> list[float]:
        """
        Weights, adding up to 1.
        """
    @property
    def variance_samples2(self) -> float:
        """
        Second central moment in samples squared; on a circle dR/R = variance*(v/R)^2/2.
        """
class FirStream:
    """
    Real-time form of Fir: one sample of every axis per step.
    """
    def __init__(self, fir: Fir, n_axes: typing.SupportsInt | typing.SupportsIndex) -> None:
        """
        At rest at zero. Raises ArgumentError on n_axes < 1.
        """
    def reset(self, position: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> None:
        """
        Rest at `position`, shape (n_axes,).
        """
    def step(self, position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.typing.NDArray[numpy.float64]:
        """
        Filtered sample, shape (n_axes,).
        """
class VaryingFir:
    """
    A set of filters on one grid, with a varying choice among them.
    
    Each increment of the input is replaced by the whole impulse train of the filter that its place selects (scatter form),
    so that every increment keeps the zeros of its own filter, however often the filters change. Place k is filter k of the
    set; place k + w (0 < w < 1) gives the part 1 - w of an increment to filter k and w to filter k + 1.
    
    Args:
        set: The filters (Fir), at least one.
    
    Raises:
        ArgumentError: An empty set.
    """
    def __init__(self, set: collections.abc.Sequence[Fir]) -> None:
        """
        Raises ArgumentError if the set is empty.
        """
    def apply(self, samples: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], place: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> numpy.ndarray:
        """
        Filter samples (n, n_axes); `place` (n,) for the increment that leads to each sample. The result has duration_samples more rows. Bit-identical to VaryingFirStream. Raises ArgumentError on another shape or a value that is not finite.
        """
    def on_finer_grid(self, factor: typing.SupportsInt | typing.SupportsIndex) -> VaryingFir:
        """
        The same set on a grid `factor` times as fine. Raises ArgumentError below 1.
        """
    @property
    def duration_samples(self) -> int:
        """
        Largest delay in samples.
        """
    @property
    def mean_samples(self) -> float:
        """
        Mean delay, average of the set, in samples.
        """
    @property
    def set(self) -> list[Fir]:
        """
        The filters.
        """
    @property
    def variance_samples2(self) -> float:
        """
        Largest second central moment of the set in samples squared.
        """
class VaryingFirStream:
    """
    Real-time form of VaryingFir: one sample per step.
    """
    def __init__(self, fir: VaryingFir, n_axes: typing.SupportsInt | typing.SupportsIndex) -> None:
        """
        At rest at zero. Raises ArgumentError on n_axes < 1.
        """
    def reset(self, position: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> None:
        """
        Rest at `position`, shape (n_axes,).
        """
    def step(self, position: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], place: typing.SupportsFloat | typing.SupportsIndex) -> list[float]:
        """
        Filtered sample, n_axes values.
        """
class FollowingFir:
    """
    A set of filters along an axis, whose position selects the filter.
    
    Filter k of the set is valid where the axis is at position k; between two positions each increment is divided between
    their filters, beyond the ends the nearest filter is valid. The middle of each increment selects its filter.
    
    Args:
        fir: The set.
        axis: 0, 1, 2 for X, Y, Z.
        position_mm: Strictly ascending, one per filter, mm.
    
    Raises:
        ArgumentError: No such axis, another number of positions, or positions that do not ascend.
    """
    def __init__(self, fir: VaryingFir, axis: typing.SupportsInt | typing.SupportsIndex, position_mm: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> None:
        """
        Raises ArgumentError if axis or positions do not fit.
        """
    def apply(self, samples: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.ndarray:
        """
        Filter samples (n, n_axes) in mm; the result has fir.duration_samples more rows. Raises ArgumentError on another shape, no sample, a value that is not finite, or samples without the axis.
        """
    def on_finer_grid(self, factor: typing.SupportsInt | typing.SupportsIndex) -> FollowingFir:
        """
        The same on a grid `factor` times as fine. Raises ArgumentError below 1.
        """
    def place(self, position_mm: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Place in the set for a position (mm) of the axis.
        """
    @property
    def axis(self) -> int:
        """
        Axis whose position selects the filter.
        """
    @property
    def fir(self) -> VaryingFir:
        """
        The set.
        """
    @property
    def position_mm(self) -> list[float]:
        """
        Positions of the filters, mm.
        """
class Mode:
    """
    One vibration mode as it moves one axis, base-excited by the command of that axis or of others. Immutable.
    
    Args:
        frequency_hz: Undamped natural frequency in Hz, above 0.
        damping_ratio: Damping ratio (no unit), 0 <= zeta < 1.
        participation: Factor of this mode's relative deflection in the response (no unit), finite.
        excited_by: Factors of the accelerations of X, Y and Z that excite it (no unit), finite; all zero: the axis which
            it moves, with factor one.
    
    Raises:
        ArgumentError: A value is outside its range.
    """
    def __eq__(self, arg0: Mode) -> bool:
        ...
    def __getstate__(self) -> tuple[float, float, float, typing.Annotated[list[float], "FixedSize(3)"]]:
        ...
    def __hash__(self) -> int:
        ...
    def __init__(self, frequency_hz: typing.SupportsFloat | typing.SupportsIndex, damping_ratio: typing.SupportsFloat | typing.SupportsIndex = 0.0, participation: typing.SupportsFloat | typing.SupportsIndex = 1.0, excited_by: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"] = [0.0, 0.0, 0.0]) -> None:
        """
        Raises ArgumentError on a value outside its range.
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    @property
    def damping_ratio(self) -> float:
        """
        Damping ratio, no unit.
        """
    @property
    def excited_by(self) -> typing.Annotated[list[float], "FixedSize(3)"]:
        """
        Factors of the accelerations of X, Y, Z that excite it; all zero: 1 for the axis it moves.
        """
    @property
    def frequency_hz(self) -> float:
        """
        Undamped natural frequency in Hz.
        """
    @property
    def participation(self) -> float:
        """
        Factor of this mode's relative deflection in the response, no unit.
        """
    @property
    def pole(self) -> complex:
        """
        Pole -zeta*omega + j*omega*sqrt(1-zeta^2) in rad/s (paper 002, eq. 7).
        """
class Shaper:
    """
    Input shaper: impulses at ascending times, whose amplitudes add up to one. Immutable.
    
    Args:
        times_s: Times of the impulses in s, shape (n,), n >= 1, strictly ascending from exactly 0.
        amplitudes: Amplitudes of the impulses (no unit), shape (n,), sum 1 within 1e-9; may be negative.
    
    Raises:
        ArgumentError: Unequal lengths, no impulse, a value that is not finite, times that do not ascend from 0, or a sum
            other than 1.
    
    Source: paper 002, eq. 4 and 9.
    """
    __hash__: typing.ClassVar[None] = None
    def __eq__(self, arg0: Shaper) -> bool:
        ...
    def __getstate__(self) -> tuple[list[float], list[float]]:
        ...
    def __init__(self, times_s: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], amplitudes: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> None:
        """
        Raises ArgumentError if the impulses are not as the class states.
        """
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def residual(self, frequency_hz: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], damping_ratio: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] = 0.0) -> typing.Any:
        """
        Residual vibration over frequency: `residual_ratio` of modes of these frequencies.
        
        Args:
            frequency_hz: Natural frequency in Hz, above 0; a number or an array of any shape.
            damping_ratio: Damping ratio (no unit), 0 <= zeta < 1; a number, or an array that broadcasts with the frequencies.
        
        Returns:
            The ratio (no unit): a number for numbers, else an array of the broadcast shape.
        
        Raises:
            ArgumentError: A value is outside its range.
        """
    def residual_ratio(self, mode: Mode) -> float:
        """
        Residual vibration of a mode after the last impulse, relative to the unshaped one.
        
        V = exp(-zeta*omega*t_N) * |sum A_k exp(zeta*omega*t_k) exp(j*omega_d*t_k)|; the participation has no effect.
        V has a rounding floor of about 1e-16*(1 + omega*t_N)*abs_sum.
        
        Args:
            mode: The mode that vibrates; it need not be one that the shaper was designed for.
        
        Returns:
            The ratio V (no unit), 0 where the shaper cancels the mode.
        
        Source: paper 002, eq. 8.
        """
    def to_fir(self, period_s: typing.SupportsFloat | typing.SupportsIndex) -> Fir:
        """
        The shaper as a filter of samples: ``shaper.to_fir(0.001).apply(samples)``.
        
        Args:
            period_s: Period of the samples in s, above 0.
        
        Returns:
            The filter; its delays are the times of the impulses in periods.
        
        Raises:
            ArgumentError: The period is not above 0, or the shaper is too long.
            DesignError: A time is not a multiple of the period, as those of `zv_on_grid` are: times are never rounded.
        """
    @property
    def abs_sum(self) -> float:
        """
        Sum of the amplitudes' magnitudes (no unit): 1 for a non-negative shaper.
        """
    @property
    def amplitudes(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Amplitudes of the impulses (no unit), shape (n,), read-only view.
        """
    @property
    def duration_s(self) -> float:
        """
        Time of the last impulse in s, by which the shaped command is longer.
        """
    @property
    def has_negative(self) -> bool:
        """
        True if any amplitude is below zero.
        """
    @property
    def mean_s(self) -> float:
        """
        First moment in s: the mean delay of the shaped command.
        """
    @property
    def times_s(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Times of the impulses in s, shape (n,), read-only view.
        """
    @property
    def variance_s2(self) -> float:
        """
        Second central moment in s^2; radius error of a circle: dR/R = variance*(v/R)^2/2.
        """
class ExtraInsensitive:
    """
    An extra-insensitive shaper, with the zeros and maxima of its residual.
    """
    @property
    def humps_hz(self) -> list[float]:
        """
        Natural frequencies in Hz, ascending, at which the residual is the vibration limit.
        """
    @property
    def shaper(self) -> Shaper:
        """
        The shaper, humps+2 non-negative impulses.
        """
    @property
    def zeros_hz(self) -> list[float]:
        """
        Natural frequencies without residual in Hz, ascending, one more than humps.
        """
class WorstResidual:
    """
    The largest residual over a band of frequencies.
    """
    @property
    def frequency_hz(self) -> float:
        """
        Natural frequency in Hz at which it was found.
        """
    @property
    def residual_ratio(self) -> float:
        """
        Residual ratio at frequency_hz, no unit.
        """
    @property
    def upper_bound(self) -> float:
        """
        No frequency of the band has a larger residual ratio; above residual_ratio by at most 1e-6 of it, or 1e-12.
        """
class FrequencyBand:
    """
    A band of frequencies.
    """
    @property
    def highest_hz(self) -> float:
        """
        Upper end in Hz.
        """
    @property
    def lowest_hz(self) -> float:
        """
        Lower end in Hz.
        """
class MinimalShapers:
    """
    The minimal shapers of some modes, and what is known about others.
    """
    @property
    def boxes(self) -> int:
        """
        Boxes of times examined by the proof.
        """
    @property
    def complete(self) -> bool:
        """
        True if every box of times was decided: there is no other shaper in the range.
        """
    @property
    def complete_up_to_s(self) -> float:
        """
        Duration in s up to which there is no other shaper; 0: nothing is proven.
        """
    @property
    def converged(self) -> int:
        """
        Starts that reached a shaper in the range.
        """
    @property
    def found_once(self) -> int:
        """
        Shapers reached by one start only. Divided by `converged`, the number estimates the ratio of starts that would reach a shaper not yet listed (Good 1953).
        """
    @property
    def max_abs_sum(self) -> float:
        """
        Range of the search: largest sum of magnitudes.
        """
    @property
    def max_duration_s(self) -> float:
        """
        Range of the search: largest duration in s.
        """
    @property
    def shapers(self) -> list[Shaper]:
        """
        The shapers, ascending in duration, then in the times.
        """
    @property
    def starts(self) -> int:
        """
        Newton starts.
        """
    @property
    def unresolved(self) -> int:
        """
        Boxes too small to halve further that could not be decided: solutions there are not isolated.
        """
class MinimalBranches:
    """
    The minimal shapers of two modes over the ratio of their frequencies, joined into curves.
    """
    @property
    def amplitudes(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Amplitudes (no unit), shape (n_branches, n_ratios, 3), NaN as in `times_s`; read-only view.
        """
    @property
    def ratios(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Frequency ratios (no unit), shape (n_ratios,), read-only view.
        """
    @property
    def times_s(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Times of the impulses in s, shape (n_branches, n_ratios, 3), NaN where a curve has no shaper; read-only view.
        
        [..., 2] is the duration.
        """
class SegmentKind:
    """
    Kind of a canonical move.
    
    Members:
    
      rapid
    
      line
    
      arc
    """
    __members__: typing.ClassVar[dict[str, SegmentKind]]
    arc: typing.ClassVar[SegmentKind]
    line: typing.ClassVar[SegmentKind]
    rapid: typing.ClassVar[SegmentKind]
    @typing.overload
    def __eq__(self, other: SegmentKind) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: SegmentKind) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class Segment:
    """
    One canonical move in mm.
    """
    @staticmethod
    def arc(start_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], end_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], centre_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], sweep_rad: typing.SupportsFloat | typing.SupportsIndex, feed_mm_per_s: typing.SupportsFloat | typing.SupportsIndex, normal: typing.SupportsInt | typing.SupportsIndex = 2) -> Segment:
        """
        An arc or helix about the axis `normal` (0 X, 1 Y, 2 Z); `sweep_rad` > 0 turns counter-clockwise seen from the positive end of this axis. Raises ArgumentError on a zero radius or sweep.
        """
    @staticmethod
    def line(start_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], end_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], feed_mm_per_s: typing.SupportsFloat | typing.SupportsIndex) -> Segment:
        """
        A straight move.
        """
    def chords_within(self, tolerance_mm: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Number of equal chords that approximate an arc within a tolerance; 1 for a line.
        
        Raises ArgumentError if the tolerance is not above 0.
        """
    def point_at(self, s_mm: typing.SupportsFloat | typing.SupportsIndex) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Position at a distance from the start, shape (3,), mm.
        """
    @property
    def centre_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Centre of an arc, shape (3,), mm.
        """
    @property
    def end_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        End, shape (3,), mm.
        """
    @property
    def feed_mm_per_s(self) -> float:
        """
        Programmed feed, mm/s; 0 for a rapid.
        """
    @property
    def kind(self) -> SegmentKind:
        """
        Kind of the move.
        """
    @property
    def length_mm(self) -> float:
        """
        Length, mm.
        """
    @property
    def line_number(self) -> int:
        """
        Source line, from 1; 0 if there is none.
        """
    @property
    def normal(self) -> int:
        """
        Axis perpendicular to the plane of an arc: 0 X, 1 Y, 2 Z.
        """
    @property
    def radius_mm(self) -> float:
        """
        Radius of an arc at its start, mm.
        """
    @property
    def start_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Start, shape (3,), mm.
        """
    @property
    def sweep_rad(self) -> float:
        """
        Signed sweep of an arc, rad.
        """
class Path:
    """
    A connected sequence of segments.
    """
    def __getitem__(self, index: typing.SupportsInt | typing.SupportsIndex) -> Segment:
        """
        Segment at an index.
        """
    def __init__(self, segments: collections.abc.Sequence[Segment]) -> None:
        """
        Raises ArgumentError if a segment does not start where its predecessor ends (1e-6 mm).
        """
    def __len__(self) -> int:
        ...
    def moves_as(self, other: Path) -> bool:
        """
        Whether the motion is the same: geometry, feeds and stops, regardless of line numbers.
        """
    def polyline(self, step_rad: typing.SupportsFloat | typing.SupportsIndex = 0.05) -> numpy.ndarray:
        """
        Points along the path, (n, 3), mm: its start, segment ends, arcs in steps of at most `step_rad`.
        """
    @property
    def arcs_in_xy(self) -> bool:
        """
        Whether every arc lies in the XY plane (G17).
        """
    @property
    def end_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        End, shape (3,), mm.
        """
    @property
    def extent_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Size of the box around it, shape (3,), mm; arcs as in `polyline`.
        """
    @property
    def fastest_feed_mm_per_s(self) -> float:
        """
        Largest programmed feed, mm/s; 0 for an empty path.
        """
    @property
    def largest_sweep_rad(self) -> float:
        """
        Largest sweep of any arc, rad; 0 without arcs.
        """
    @property
    def length_mm(self) -> float:
        """
        Whole length, mm.
        """
    @property
    def programmed_time_s(self) -> float:
        """
        Time at the programmed feeds without any acceleration, s; infinity with a rapid.
        """
    @property
    def segment_ends_mm(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Distance of each segment's end from the start, (n,), mm.
        """
    @property
    def segment_feeds_mm_per_s(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Programmed feed of each segment, (n,), mm/s.
        """
    @property
    def segment_lines(self) -> numpy.typing.NDArray[numpy.uint32]:
        """
        Source line of each segment, (n,), from 1; 0 if there is none.
        """
    @property
    def slowest_feed_mm_per_s(self) -> float:
        """
        Smallest programmed feed, mm/s: 0 with a rapid, infinity for an empty path.
        """
    @property
    def start_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Start, shape (3,), mm.
        """
class AccelerationLaw:
    """
    Law of a change of speed.
    
    Members:
    
      constant_time : A ramp lasts the time constant whatever the speed step, if the path is long enough.
    
      jerk_limited : The acceleration of the axes, smoothed by the jerk time.
    """
    __members__: typing.ClassVar[dict[str, AccelerationLaw]]
    constant_time: typing.ClassVar[AccelerationLaw]
    jerk_limited: typing.ClassVar[AccelerationLaw]
    @typing.overload
    def __eq__(self, other: AccelerationLaw) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: AccelerationLaw) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class MotionLimits:
    """
    Limits of the look-ahead; infinity switches a limit off.
    """
    def __init__(self) -> None:
        ...
    @property
    def arc_feed_ratio(self) -> float:
        """
        Feed on arcs relative to the programmed one.
        """
    @arc_feed_ratio.setter
    def arc_feed_ratio(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def block_time_s(self) -> float:
        """
        Minimum duration of a block, s.
        """
    @block_time_s.setter
    def block_time_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def centripetal_acceleration_mm_per_s2(self) -> float:
        """
        Centripetal acceleration on arcs, mm/s^2.
        """
    @centripetal_acceleration_mm_per_s2.setter
    def centripetal_acceleration_mm_per_s2(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def contour_acceleration_mm_per_s2(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Acceleration of each axis by a change of direction, on arcs and along polylines, shape (3,), mm/s^2.
        """
    @contour_acceleration_mm_per_s2.setter
    def contour_acceleration_mm_per_s2(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def corner_speed_difference_mm_per_s(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Maximum speed difference per axis at a corner, shape (3,), mm/s.
        """
    @corner_speed_difference_mm_per_s.setter
    def corner_speed_difference_mm_per_s(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def corner_stop_angle_rad(self) -> float:
        """
        A corner that turns by this angle or more is a stop, rad.
        """
    @corner_stop_angle_rad.setter
    def corner_stop_angle_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def feed_excess_ratio(self) -> float:
        """
        Neighbours faster by up to this ratio need no `feed_spread_s`.
        """
    @feed_excess_ratio.setter
    def feed_excess_ratio(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def feed_override(self) -> float:
        """
        Scales the programmed feeds.
        """
    @feed_override.setter
    def feed_override(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def feed_spread_s(self) -> float:
        """
        Time by which a lower programmed feed is reached before its segment and held after it, s.
        """
    @feed_spread_s.setter
    def feed_spread_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def jerk_time_s(self) -> float:
        """
        Smoothing of the acceleration, s; 0 = none.
        """
    @jerk_time_s.setter
    def jerk_time_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def junction_deviation_mm(self) -> float:
        """
        A corner is as fast as an arc that cuts it by this distance, mm.
        """
    @junction_deviation_mm.setter
    def junction_deviation_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def law(self) -> AccelerationLaw:
        """
        Law of a change of speed.
        """
    @law.setter
    def law(self, arg0: AccelerationLaw) -> None:
        ...
    @property
    def max_acceleration_mm_per_s2(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Per axis, shape (3,).
        """
    @max_acceleration_mm_per_s2.setter
    def max_acceleration_mm_per_s2(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def max_feed_mm_per_s(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Per axis, shape (3,).
        """
    @max_feed_mm_per_s.setter
    def max_feed_mm_per_s(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def max_jerk_mm_per_s3(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Per axis, shape (3,).
        """
    @max_jerk_mm_per_s3.setter
    def max_jerk_mm_per_s3(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def polyline_acceleration_mm_per_s2(self) -> float:
        """
        Centripetal acceleration along polylines, mm/s^2.
        """
    @polyline_acceleration_mm_per_s2.setter
    def polyline_acceleration_mm_per_s2(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def time_constant_s(self) -> float:
        """
        Ramp from rest to the programmed feed, s.
        """
    @time_constant_s.setter
    def time_constant_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
class FilterTolerance:
    """
    Deviation permitted to a filter after the interpolation, at corners and on arcs; none if its variance and mean deviation are 0.
    """
    def __init__(self) -> None:
        ...
    @property
    def contour_tolerance_mm(self) -> float:
        """
        Deviation allowed to the filter, mm; infinity: any.
        """
    @contour_tolerance_mm.setter
    def contour_tolerance_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def corner_share(self) -> float:
        """
        Part of the tolerance for one corner: deviations of corners within one filter length add up.
        """
    @corner_share.setter
    def corner_share(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def mean_deviation_s(self) -> float:
        """
        Mean absolute deviation of the filter from its mean delay, s.
        """
    @mean_deviation_s.setter
    def mean_deviation_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def variance_s2(self) -> float:
        """
        Second central moment of the filter, s^2.
        """
    @variance_s2.setter
    def variance_s2(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
class SpeedProfile:
    """
    Distance along a path as a function of time.
    """
    @property
    def duration_s(self) -> float:
        """
        Whole time, s.
        """
    @property
    def length_mm(self) -> float:
        """
        Distance at the end, mm.
        """
    @property
    def phases(self) -> numpy.ndarray:
        """
        (n, 5): start s, duration s, distance mm, speed mm/s, acceleration mm/s^2.
        """
class Interpolator:
    """
    Set-points of a path, one per interpolation period (real-time form).
    """
    def __init__(self, path: Path, profile: SpeedProfile, period_s: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        Raises ArgumentError on a period <= 0.
        """
    def step(self) -> tuple[bool, typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]]:
        """
        Returns (moving, position of shape (3,)); moving is False after the last set-point.
        """
    @property
    def sample_count(self) -> int:
        """
        Set-points from start to end.
        """
class ControllerKind:
    """
    The control whose rules plan a program.
    
    Members:
    
      fanuc
    
      linuxcnc
    
      klipper
    
      grbl
    """
    __members__: typing.ClassVar[dict[str, ControllerKind]]
    fanuc: typing.ClassVar[ControllerKind]
    grbl: typing.ClassVar[ControllerKind]
    klipper: typing.ClassVar[ControllerKind]
    linuxcnc: typing.ClassVar[ControllerKind]
    @typing.overload
    def __eq__(self, other: ControllerKind) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: ControllerKind) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class PlannerRules:
    """
    Settings of the open planners.
    """
    def __init__(self) -> None:
        ...
    @property
    def arc_resolution_mm(self) -> float:
        """
        klipper: length of the chords of an arc.
        """
    @arc_resolution_mm.setter
    def arc_resolution_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def arc_tolerance_mm(self) -> float:
        """
        grbl: chords of an arc lie within it ($12).
        """
    @arc_tolerance_mm.setter
    def arc_tolerance_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def blend_tolerance_mm(self) -> float:
        """
        linuxcnc: G64 P; 0: only half of a segment limits.
        """
    @blend_tolerance_mm.setter
    def blend_tolerance_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def chord_tolerance_mm(self) -> float:
        """
        klipper, grbl: arcs are emitted as chords within it; 0: as arcs.
        """
    @chord_tolerance_mm.setter
    def chord_tolerance_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def junction_deviation_mm(self) -> float:
        """
        grbl: a corner is as fast as an arc that cuts it by this distance ($11).
        """
    @junction_deviation_mm.setter
    def junction_deviation_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def kind(self) -> ControllerKind:
        """
        The control whose rules are used.
        """
    @kind.setter
    def kind(self, arg0: ControllerKind) -> None:
        ...
    @property
    def kink_ratio(self) -> float:
        """
        linuxcnc: part of the acceleration that a kink may take.
        """
    @kink_ratio.setter
    def kink_ratio(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def look_ahead_blocks(self) -> int:
        """
        grbl: blocks of its planner's buffer.
        """
    @look_ahead_blocks.setter
    def look_ahead_blocks(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def max_feed_override(self) -> float:
        """
        linuxcnc: override for which it plans.
        """
    @max_feed_override.setter
    def max_feed_override(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def minimum_cruise_ratio(self) -> float:
        """
        klipper: max_accel_to_decel is max_accel times (1 - ratio).
        """
    @minimum_cruise_ratio.setter
    def minimum_cruise_ratio(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def naive_cam_tolerance_mm(self) -> float:
        """
        linuxcnc: G64 Q: lines of one feed within it are joined, an arc in XY within it becomes two lines.
        """
    @naive_cam_tolerance_mm.setter
    def naive_cam_tolerance_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def optimization_depth(self) -> int:
        """
        linuxcnc: segments in its look-ahead.
        """
    @optimization_depth.setter
    def optimization_depth(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def period_s(self) -> float:
        """
        linuxcnc: period of the servo thread, which plans, s.
        """
    @period_s.setter
    def period_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def ramp_frequency_hz(self) -> float:
        """
        linuxcnc: segments that take less than 1/it are ramps.
        """
    @ramp_frequency_hz.setter
    def ramp_frequency_hz(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def rapid_follows(self) -> bool:
        """
        linuxcnc: a rapid follows the path; otherwise the path's last segment has half of the acceleration.
        """
    @rapid_follows.setter
    def rapid_follows(self, arg0: bool) -> None:
        ...
    @property
    def square_corner_velocity_mm_per_s(self) -> float:
        """
        klipper: speed at a corner of 90 degrees.
        """
    @square_corner_velocity_mm_per_s.setter
    def square_corner_velocity_mm_per_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
class LinuxcncSlowing:
    """
    Effect of LinuxCNC's rules for short segments (kinks and ramps) on a path.
    """
    @property
    def angle_rad(self) -> float:
        """
        Change of direction at that junction, rad.
        """
    @property
    def kinks(self) -> int:
        """
        Junctions that need at least the kink ratio of the acceleration.
        """
    @property
    def largest_ratio(self) -> float:
        """
        Largest ratio of the acceleration that a junction needs.
        """
    @property
    def line(self) -> int:
        """
        Source line of that junction.
        """
    @property
    def ramps(self) -> int:
        """
        Number of segments whose speed is a ramp.
        """
    @property
    def segments(self) -> int:
        """
        Number of segments.
        """
    @property
    def speed_mm_per_s(self) -> float:
        """
        Speed at that junction, mm/s.
        """
class PushResult:
    """
    Result of pushing a segment to a MotionController.
    
    Members:
    
      accepted : It is in the queue.
    
      queue_full : It was not accepted: push it again later.
    
      not_connected : It does not start where the one before ended, or an arc misses its end (1e-6 mm).
    
      no_length : It moves no axis by more than 1e-9 mm or degrees.
    
      no_feed : A feed that is not above zero, or not finite.
    
      not_finite : A position that is not finite.
    
      wrong_axes : Not as many following axes as the control has.
    
      aborted : Nothing is accepted between abort() and restart().
    
      flushing : Nothing is accepted between flush() and flushed().
    
      no_time : A dwell below zero, above 1e6 s, or not a number.
    
      beyond_travel : It leads out of the travel of an axis.
    
      bad_limit : A limit of the segment that is not above zero.
    
      not_straight : Synchronous with the spindle, but not a line.
    """
    __members__: typing.ClassVar[dict[str, PushResult]]
    aborted: typing.ClassVar[PushResult]
    accepted: typing.ClassVar[PushResult]
    bad_limit: typing.ClassVar[PushResult]
    beyond_travel: typing.ClassVar[PushResult]
    flushing: typing.ClassVar[PushResult]
    no_feed: typing.ClassVar[PushResult]
    no_length: typing.ClassVar[PushResult]
    no_time: typing.ClassVar[PushResult]
    not_connected: typing.ClassVar[PushResult]
    not_finite: typing.ClassVar[PushResult]
    not_straight: typing.ClassVar[PushResult]
    queue_full: typing.ClassVar[PushResult]
    wrong_axes: typing.ClassVar[PushResult]
    @typing.overload
    def __eq__(self, other: PushResult) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: PushResult) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class JogResult:
    """
    Result of a jog of a MotionController.
    
    Members:
    
      accepted : The axis moves.
    
      path_moves : The control is neither held nor flushed nor aborted, or not yet at rest.
    
      no_axis : There is no such axis.
    
      not_finite : A number that is not finite, or a distance of retrace() below zero.
    
      no_speed : The speed of a jog by a distance is not above zero.
    
      beyond_travel : The distance leads out of the travel, or the axis is at its end already.
    
      no_record : No periods are stored for retrace().
    """
    __members__: typing.ClassVar[dict[str, JogResult]]
    accepted: typing.ClassVar[JogResult]
    beyond_travel: typing.ClassVar[JogResult]
    no_axis: typing.ClassVar[JogResult]
    no_record: typing.ClassVar[JogResult]
    no_speed: typing.ClassVar[JogResult]
    not_finite: typing.ClassVar[JogResult]
    path_moves: typing.ClassVar[JogResult]
    @typing.overload
    def __eq__(self, other: JogResult) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: JogResult) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class FeedRate:
    """
    Unit of a programmed feed, and the override that applies.
    
    Members:
    
      per_time : Per s; the feed override.
    
      rapid : Per s; the rapid override.
    
      per_revolution : Per revolution of the spindle; the feed override.
    
      synchronous : Likewise, synchronous with the spindle angle from rest to rest; no override.
    """
    __members__: typing.ClassVar[dict[str, FeedRate]]
    per_revolution: typing.ClassVar[FeedRate]
    per_time: typing.ClassVar[FeedRate]
    rapid: typing.ClassVar[FeedRate]
    synchronous: typing.ClassVar[FeedRate]
    @typing.overload
    def __eq__(self, other: FeedRate) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: FeedRate) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class FeedOf:
    """
    To which motion a feed refers if X, Y and Z move together with following axes.
    
    Members:
    
      path : X, Y and Z along their path; if these do not move (1e-9 mm), the axis with the longest travel.
    
      all_axes : The root of the sum of squares of all axes, degrees counted as mm.
    
      dominant : X, Y and Z along their path, or the following axis with a longer travel.
    
      time : Inverse time: the segment lasts one over the feed, s or revolutions.
    """
    __members__: typing.ClassVar[dict[str, FeedOf]]
    all_axes: typing.ClassVar[FeedOf]
    dominant: typing.ClassVar[FeedOf]
    path: typing.ClassVar[FeedOf]
    time: typing.ClassVar[FeedOf]
    @typing.overload
    def __eq__(self, other: FeedOf) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: FeedOf) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class SegmentRules:
    """
    Rules for running a segment, besides its geometry and its feed. Immutable.
    
    Args:
        feed_rate: Unit of its feed, and the override that applies.
        feed_of: Motion to which its feed refers.
        max_acceleration: Along its path, besides the limits of the axes, mm/s^2.
        max_jerk: Likewise, mm/s^3.
    """
    def __init__(self, *, feed_rate: FeedRate = FeedRate.per_time, feed_of: FeedOf = FeedOf.path, max_acceleration: typing.SupportsFloat | typing.SupportsIndex = ..., max_jerk: typing.SupportsFloat | typing.SupportsIndex = ...) -> None:
        """
        Values are checked by the control that uses them.
        """
    def __repr__(self) -> str:
        ...
    @property
    def feed_of(self) -> FeedOf:
        """
        Motion to which its feed refers.
        """
    @property
    def feed_rate(self) -> FeedRate:
        """
        Unit of its feed, and the override that applies.
        """
    @property
    def max_acceleration(self) -> float:
        """
        mm/s^2.
        """
    @property
    def max_jerk(self) -> float:
        """
        mm/s^3.
        """
class OffsetLimits:
    """
    Limits of an offset that is added to an axis during motion. Immutable.
    
    Args:
        max_feed: Highest speed in the axis' unit (mm or degrees) per s; 0: no offset.
        max_acceleration: Likewise per s^2.
        max_jerk: Likewise per s^3.
        backlash: Backlash of the drive in the axis' unit, subtracted from its position in negative motion; the control
            starts as after positive motion.
    """
    def __init__(self, *, max_feed: typing.SupportsFloat | typing.SupportsIndex = 0.0, max_acceleration: typing.SupportsFloat | typing.SupportsIndex = 0.0, max_jerk: typing.SupportsFloat | typing.SupportsIndex = 0.0, backlash: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        """
        Values are checked by the control that uses them.
        """
    def __repr__(self) -> str:
        ...
    @property
    def backlash(self) -> float:
        """
        Unit.
        """
    @property
    def max_acceleration(self) -> float:
        """
        Unit per s^2.
        """
    @property
    def max_feed(self) -> float:
        """
        Unit per s.
        """
    @property
    def max_jerk(self) -> float:
        """
        Unit per s^3.
        """
class Activity:
    """
    What a MotionController does in a period.
    
    Members:
    
      idle : At rest, nothing left to do.
    
      moving : Along the path, or the shaper's output is not yet at rest.
    
      stopping : Decelerating for hold(), flush() or abort().
    
      held : At rest after hold(), or at a programmed stop.
    
      starved : Decelerating: the queue ran empty, and its last segment has no `stop_at_end`. Idle once at rest.
    
      aborted : At rest after abort() or emergency_stop(); the path is discarded.
    
      jogging : An axis moves away from the position where the path rests, or back to it.
    """
    __members__: typing.ClassVar[dict[str, Activity]]
    aborted: typing.ClassVar[Activity]
    held: typing.ClassVar[Activity]
    idle: typing.ClassVar[Activity]
    jogging: typing.ClassVar[Activity]
    moving: typing.ClassVar[Activity]
    starved: typing.ClassVar[Activity]
    stopping: typing.ClassVar[Activity]
    @typing.overload
    def __eq__(self, other: Activity) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: Activity) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class FollowingLimits:
    """
    Limits of an axis that follows the path. Immutable.
    
    Args:
        max_feed: Highest speed in its own unit (mm or degrees) per s.
        max_acceleration: Likewise per s^2.
        max_jerk: Likewise per s^3.
        tolerance: Permitted deviation where its speed along the path changes abruptly, in its unit; 0: the motion stops
            there.
    """
    def __init__(self, *, max_feed: typing.SupportsFloat | typing.SupportsIndex = ..., max_acceleration: typing.SupportsFloat | typing.SupportsIndex = ..., max_jerk: typing.SupportsFloat | typing.SupportsIndex = ..., tolerance: typing.SupportsFloat | typing.SupportsIndex = ...) -> None:
        """
        Values are checked by the control that uses them.
        """
    def __repr__(self) -> str:
        ...
    @property
    def max_acceleration(self) -> float:
        """
        Unit per s^2.
        """
    @property
    def max_feed(self) -> float:
        """
        Unit per s.
        """
    @property
    def max_jerk(self) -> float:
        """
        Unit per s^3.
        """
    @property
    def tolerance(self) -> float:
        """
        Unit.
        """
class ControllerEvent:
    """
    An event at a position of the path. Immutable.
    """
    def __repr__(self) -> str:
        ...
    @property
    def id(self) -> int:
        """
        Identifier of the caller, as it was pushed.
        """
    @property
    def step(self) -> int:
        """
        The step with which it was reached, from 1.
        """
    @property
    def word(self) -> int:
        """
        Data of the caller, as they were pushed.
        """
class ControllerState:
    """
    A snapshot of a MotionController. Immutable.
    """
    def __repr__(self) -> str:
        ...
    @property
    def activity(self) -> Activity:
        """
        What the control does.
        """
    @property
    def distance_mm(self) -> float:
        """
        Distance since the last rest.
        """
    @property
    def feed_override(self) -> float:
        """
        Ratio of the programmed feeds.
        """
    @property
    def late_plans(self) -> int:
        """
        How often the motion slowed down because no section was planned in time.
        """
    @property
    def line(self) -> int:
        """
        Line of the present segment.
        """
    @property
    def offset(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Offset of each axis before smoothing and shaper, (n_axes,), mm or the axis' unit.
        """
    @property
    def rapid_override(self) -> float:
        """
        Ratio of the rapid rates.
        """
    @property
    def segments_done(self) -> int:
        """
        Segments run to their ends.
        """
    @property
    def segments_waiting(self) -> int:
        """
        Number of segments pushed and not yet run to their ends.
        """
    @property
    def set_point(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Last set-point, (n_axes,), mm or the axis' unit.
        """
    @property
    def set_point_distance_mm(self) -> float:
        """
        `distance_mm` at the last set-point, which correction, smoothing and shaper delay by `delay_periods`, rounded.
        """
    @property
    def set_point_line(self) -> int:
        """
        `line` at that set-point.
        """
    @property
    def shaper(self) -> int:
        """
        Number of the active shaper, or of the one being faded to.
        """
    @property
    def speed_mm_per_s(self) -> float:
        """
        Speed along the path, before smoothing and shaper.
        """
    @property
    def spindle_error_mm(self) -> float:
        """
        Of a synchronous segment: the motion less that required by the spindle angle.
        """
    @property
    def spindle_speed(self) -> float:
        """
        Revolutions per s.
        """
    @property
    def starvations(self) -> int:
        """
        How often the queue ran empty.
        """
    @property
    def steps(self) -> int:
        """
        Number of set-points so far.
        """
    @property
    def travel_stops(self) -> int:
        """
        How often the control was held because the path would have left the travel.
        """
class MotionController:
    """
    Runs a path that grows during motion: what a control does between blocks and drives.
    
    Look-ahead over a window of segments, junctions rounded within the tolerance, motion nearly as fast as the limits of the
    axes allow, one set-point per period through contour correction, smoothing and shaper. The set-points keep every finite
    limit. One thread may push and call flushed(), one may step, one may plan, any may call the rest except restart();
    step(), run() and plan() release the global interpreter lock. The real-time form is the C++ class of the same name.
    
    Args:
        period_s: Time between set-points in s.
        limits: Limits, with the rules for corners. None: only the next three, under the jerk-limited law if there is an
            acceleration.
        max_feed_mm_per_s: Of X, Y and Z, shape (3,), or one number for all; instead of that in `limits`.
        max_acceleration_mm_per_s2: Likewise.
        max_jerk_mm_per_s3: Likewise; requires an acceleration.
        following: Limits of the axes that follow the path, at most six.
        contour_tolerance_mm: Permitted deviation from the path by rounded corners, smoothing and shaper. 0 (only without
            smoothing and shaper): corners are exact stops; inf: corners are rounded up to the middle between neighbours.
        smoothing_time_s: Duration of each of two moving averages of every axis in s; 0: none.
        shaper: A Shaper on the grid of the period, a Fir, or a Mode (for its ZV on the grid) for all axes; a list with one
            of these for each axis; or a FollowingFir. None: no shaper.
        contour_correction: Compensate, to the second order, the radius error of arcs caused by smoothing and shaper.
        window: Segments that the look-ahead sees, 8 at least.
        queue: Segments in the whole queue, including the window; rounded up to a power of two.
        lead_periods: Periods by which plan(), called by another thread, is ahead of the motion. None: step() plans when the
            planned motion runs out.
        travel: Travel range of each axis, (low, high); empty: no limits.
        offset: Limits of the offset of each axis, by which the limits of the path are reduced; empty: no offset. Not with
            a FollowingFir.
        emergency_acceleration: Acceleration of each axis for emergency_stop(), at least its maximum; empty: it decelerates
            as abort() does.
        spindle_bandwidth_hz: Bandwidth for following a spindle in Hz.
        retrace_periods: Periods of motion stored for retrace().
        other_shapers: Shapers that can replace `shaper` (number 0) in motion, numbers 1 and up: each one for all axes, or a
            list with one for each. Not with a FollowingFir or a contour correction.
        fade_time_s: Duration of an exchange in s. Exchanges reduce the limits of the path, less if they take longer.
    
    Raises:
        ArgumentError: A value outside its range.
        DesignError: A Shaper whose times are not on the grid of the period.
    
    Source: this project, as time_optimal_trajectory.
    """
    def __init__(self, *, period_s: typing.SupportsFloat | typing.SupportsIndex = 0.001, limits: MotionLimits | None = None, max_feed_mm_per_s: typing.SupportsFloat | typing.SupportsIndex | typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"] | None = None, max_acceleration_mm_per_s2: typing.SupportsFloat | typing.SupportsIndex | typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"] | None = None, max_jerk_mm_per_s3: typing.SupportsFloat | typing.SupportsIndex | typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"] | None = None, following: collections.abc.Sequence[FollowingLimits] = (), contour_tolerance_mm: typing.SupportsFloat | typing.SupportsIndex = 0.05, smoothing_time_s: typing.SupportsFloat | typing.SupportsIndex = 0.0, shaper: Shaper | Fir | Mode | collections.abc.Sequence[Shaper | Fir | Mode] | FollowingFir | None = None, contour_correction: bool = False, window: typing.SupportsInt | typing.SupportsIndex = 128, queue: typing.SupportsInt | typing.SupportsIndex = 1024, lead_periods: typing.SupportsInt | typing.SupportsIndex | None = None, travel: collections.abc.Sequence[tuple[typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex]] = (), offset: collections.abc.Sequence[OffsetLimits] = (), emergency_acceleration: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex] = (), spindle_bandwidth_hz: typing.SupportsFloat | typing.SupportsIndex = 20.0, retrace_periods: typing.SupportsInt | typing.SupportsIndex = 0, other_shapers: collections.abc.Sequence[Shaper | Fir | Mode | collections.abc.Sequence[Shaper | Fir | Mode]] = (), fade_time_s: typing.SupportsFloat | typing.SupportsIndex = 0.5) -> None:
        """
        Raises ArgumentError or DesignError as the class states.
        """
    def abort(self) -> None:
        """
        Decelerates to rest along the path and discards the rest of it; nothing is accepted until restart().
        """
    def emergency_stop(self) -> None:
        """
        Decelerates to rest along the path with `emergency_acceleration`, without a jerk limit; then as abort().
        """
    def exchange_shaper(self, number: typing.SupportsInt | typing.SupportsIndex) -> bool:
        """
        Fades to another shaper, in motion or at rest, within the limits.
        
        Begins with the next period, or after an earlier fade or synchronous segment; a synchronous segment waits for the fade.
        
        Args:
            number: 0: `shaper`; 1 and up: `other_shapers`.
        
        Returns:
            False: there is no such number.
        """
    def feed_override(self, ratio: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        Sets the feed override, a ratio of 0 to 2; up to 2.54 it is limited to this range, more is refused. It acts on motion not yet planned: after 8 to 32 periods and the lead; 0 is a hold.
        """
    def flush(self) -> None:
        """
        Decelerates to rest along the path and discards the rest of it; at rest, flushed() lets new segments start there.
        """
    def flushed(self) -> numpy.typing.NDArray[numpy.float64] | None:
        """
        Completes a flush(): accepts segments again, from the position of rest.
        
        Returns:
            That position, (n_axes,). None: it is not yet at rest, or plan() is running, or there was no flush().
        """
    def hold(self) -> None:
        """
        Decelerates to rest along the path.
        """
    def jog(self, axis: typing.SupportsInt | typing.SupportsIndex, speed: typing.SupportsFloat | typing.SupportsIndex) -> JogResult:
        """
        Jogs an axis while the path rests; it stops at the end of its travel.
        
        Allowed after hold(), at a programmed stop, after flush() until flushed(), and after abort(). resume() first leads back
        to the path, each axis at its last jog speed; flushed() and restart() begin at the new position.
        
        Args:
            axis: Its index, from 0.
            speed: With its sign, unit per s; a new speed acts from the next period; 0: stop.
        
        Returns:
            JogResult; unless it is `accepted`, nothing has changed.
        """
    def jog_by(self, axis: typing.SupportsInt | typing.SupportsIndex, distance: typing.SupportsFloat | typing.SupportsIndex, speed: typing.SupportsFloat | typing.SupportsIndex) -> JogResult:
        """
        Jogs an axis by a distance, where jog() is allowed.
        
        Args:
            axis: Its index, from 0.
            distance: With its sign; further distances before its end are added.
            speed: Unit per s.
        
        Returns:
            JogResult; unless it is `accepted`, nothing has changed.
        """
    def offset(self, axis: typing.SupportsInt | typing.SupportsIndex, value: typing.SupportsFloat | typing.SupportsIndex) -> bool:
        """
        Sets an offset, which the axis approaches within the limits of its offset, at rest and in motion.
        
        Args:
            axis: Its index, from 0.
            value: mm or the axis' unit.
        
        Returns:
            False: the axis has no such limits, or the value is not finite.
        """
    def plan(self) -> bool:
        """
        Plans until enough motion lies ahead; only with `lead_periods`, from one thread. False: nothing to do.
        """
    def probe(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Reports a probe contact in the period of the last step, and flushes.
        
        Returns:
            The set-point of that period, (n_axes,).
        """
    def push(self, segment: Segment, following: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex] | None = None, rules: SegmentRules | None = None) -> PushResult:
        """
        Appends the next segment; never waits.
        
        Args:
            segment: Starts where the previous one ended, the first one at the position of rest.
            following: Positions of the following axes at its end, (n_axes - 3,); they move in proportion to the path length.
                None: they do not move.
            rules: Rules for running it. None: the feed is per s along the path.
        
        Returns:
            PushResult; unless it is `accepted`, nothing has changed.
        """
    def push_arc(self, end_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], centre_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], sweep_rad: typing.SupportsFloat | typing.SupportsIndex, feed_mm_per_s: typing.SupportsFloat | typing.SupportsIndex, normal: typing.SupportsInt | typing.SupportsIndex = 2, following: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex] | None = None, *, rules: SegmentRules | None = None, line: typing.SupportsInt | typing.SupportsIndex = 0, stop_at_end: bool = False) -> PushResult:
        """
        Appends an arc or helix from the end of the previous segment, as Segment.arc makes it.
        
        Args:
            end_mm: Shape (3,), mm.
            centre_mm: Shape (3,), mm; its value along `normal` has no effect.
            sweep_rad: Above zero: X towards Y about Z, Y towards Z about X, Z towards X about Y.
            feed_mm_per_s: Along the path.
            normal: Axis perpendicular to its plane: 0 X, 1 Y, 2 Z.
            following: As in push().
            rules: Rules for running it. None: the feed is per s along the path.
            line: Shown by the state while the segment runs.
            stop_at_end: Exact stop.
        
        Returns:
            PushResult; unless it is `accepted`, nothing has changed.
        
        Raises:
            ArgumentError: No radius, no sweep, no such `normal`, or a number that is not finite.
        """
    def push_dwell(self, time_s: typing.SupportsFloat | typing.SupportsIndex) -> PushResult:
        """
        Appends a dwell after the last pushed segment. A hold during the dwell restarts it.
        
        Args:
            time_s: Time for which the set-points rest in s, 0 to 1e6.
        
        Returns:
            `accepted`, `no_time`, `flushing`, `aborted`.
        """
    def push_event(self, id: typing.SupportsInt | typing.SupportsIndex, word: typing.SupportsInt | typing.SupportsIndex = 0) -> PushResult:
        """
        Appends an event after the last pushed segment: spindle, coolant, an output.
        
        Args:
            id: Identifier of the caller, below 2^32.
            word: Further data of the caller, below 2^64.
        
        Returns:
            `accepted`, `queue_full` (as many may wait as segments), `flushing`, `aborted`.
        """
    def push_line(self, end_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], feed_mm_per_s: typing.SupportsFloat | typing.SupportsIndex, following: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex] | None = None, *, rules: SegmentRules | None = None, line: typing.SupportsInt | typing.SupportsIndex = 0, stop_at_end: bool = False) -> PushResult:
        """
        Appends a straight move from the end of the previous segment, at first from the position of rest.
        
        Args:
            end_mm: Shape (3,), mm.
            feed_mm_per_s: Along the path, unless `rules` state otherwise.
            following: As in push().
            rules: Rules for running it. None: the feed is per s along the path.
            line: Shown by the state while the segment runs.
            stop_at_end: Exact stop; marks the last segment of a program, after which none is missing.
        
        Returns:
            PushResult; unless it is `accepted`, nothing has changed.
        """
    def push_path(self, path: Path, first: typing.SupportsInt | typing.SupportsIndex = 0) -> tuple[int, PushResult]:
        """
        Appends the segments of a path, as many as are accepted; the following axes do not move.
        
        Args:
            path: Its segment `first` starts where the previous segment ended.
            first: Index of the segment to begin with.
        
        Returns:
            (index of the segment to continue with, PushResult of the last one that was tried): (len(path), accepted) if all
            were accepted.
        
        Raises:
            ArgumentError: `first` below 0.
        """
    def push_stop(self) -> PushResult:
        """
        Appends a programmed stop (M00) after the last pushed segment: the control is held there until resume().
        """
    def rapid_override(self, ratio: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        Sets the override of rapids, likewise. The feed override has no effect on them.
        """
    def restart(self, position: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> None:
        """
        Sets the control at rest at a position (n_axes,), with an empty queue. Raises ArgumentError on another shape or a value that is not finite.
        """
    def resume(self) -> None:
        """
        Continues after hold() or a programmed stop.
        """
    def retrace(self, distance_mm: typing.SupportsFloat | typing.SupportsIndex) -> JogResult:
        """
        Moves back along the path, at half the original speed.
        
        Allowed when a jog is; resume() returns to the position where the path rests, then continues.
        
        Args:
            distance_mm: From the position of rest, as far as periods are stored; a smaller one than before: forward.
        
        Returns:
            JogResult; unless it is `accepted`, nothing has changed.
        """
    def run(self, max_periods: typing.SupportsInt | typing.SupportsIndex = 1000000) -> numpy.typing.NDArray[numpy.float64]:
        """
        Steps until the control is idle, held or aborted.
        
        Args:
            max_periods: Maximum number of steps.
        
        Returns:
            (n, n_axes), mm or the unit of a following axis.
        
        Raises:
            ArgumentError: `max_periods` below 0.
        """
    def step(self, periods: typing.SupportsInt | typing.SupportsIndex = 1, spindle: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None = None) -> numpy.typing.NDArray[numpy.float64]:
        """
        The next set-points, one for each period.
        
        Args:
            periods: Number of set-points, >= 0.
            spindle: Spindle position in each period, in continuously counted revolutions, (periods,). None: not measured.
        
        Returns:
            (periods, n_axes), mm or the unit of a following axis; `state.activity` is that of the last one.
        
        Raises:
            ArgumentError: Periods below 0, or another number of spindle positions.
        """
    def step_motion(self, periods: typing.SupportsInt | typing.SupportsIndex = 1) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """
        The next set-points with velocity and acceleration, for the feed-forward of a drive.
        
        All three pass through the same smoothing and shaper. The effect of changing taps of a FollowingFir is not included.
        
        Args:
            periods: Number of set-points, >= 0.
        
        Returns:
            Positions, velocities (per s) and accelerations (per s^2), each (periods, n_axes), in mm or the axis' unit.
        
        Raises:
            ArgumentError: Periods below 0.
        """
    def take_events(self) -> list[ControllerEvent]:
        """
        Returns the events reached since the last call.
        
        A junction passed in motion is reached when its position has come through smoothing and shaper (`delay_periods`,
        rounded); a junction at which the motion stops, when the set-points come to rest.
        
        Returns:
            The events in the order in which they were pushed, each with its step.
        """
    def travel(self, axis: typing.SupportsInt | typing.SupportsIndex, low: typing.SupportsFloat | typing.SupportsIndex, high: typing.SupportsFloat | typing.SupportsIndex) -> bool:
        """
        Sets the travel range of an axis.
        
        If the path to be run next would leave it, the control is held and stops where the motion already planned ends.
        
        Args:
            axis: Its index, from 0.
            low: mm or the axis' unit.
            high: Likewise.
        
        Returns:
            False: there is no such axis, or `low` is above `high`.
        """
    @property
    def correction_delay(self) -> int:
        """
        Part of `delay_periods` caused by the contour correction, in periods.
        """
    @property
    def delay_periods(self) -> float:
        """
        Mean delay of correction, smoothing and the shaper requested last, in periods.
        """
    @property
    def end_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Start of the next segment, (3,), mm.
        """
    @property
    def following_end(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Positions of the following axes at the end of the last segment, (n_axes - 3,).
        """
    @property
    def n_axes(self) -> int:
        """
        Number of axes of a set-point.
        """
    @property
    def state(self) -> ControllerState:
        """
        A snapshot: ControllerState.
        """
class ModalState:
    """
    Modal state of the controller, as G numbers.
    """
    def __init__(self) -> None:
        ...
    @property
    def compensation(self) -> int:
        """
        Group 07: 40, 41, 42.
        """
    @compensation.setter
    def compensation(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def coordinate_number(self) -> int:
        """
        P of G54.1.
        """
    @coordinate_number.setter
    def coordinate_number(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def coordinate_system(self) -> int:
        """
        Group 14: 54 ... 59; 541 for G54.1.
        """
    @coordinate_system.setter
    def coordinate_system(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def cycle(self) -> int:
        """
        Group 09: 73 ... 89, 80 = none.
        """
    @cycle.setter
    def cycle(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def cycle_return(self) -> int:
        """
        Group 10: 98, 99.
        """
    @cycle_return.setter
    def cycle_return(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def distance(self) -> int:
        """
        Group 03: 90, 91.
        """
    @distance.setter
    def distance(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def exact_stop(self) -> int:
        """
        Group 15: 61 ... 64.
        """
    @exact_stop.setter
    def exact_stop(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def feed(self) -> float:
        """
        F as programmed; 0 before the first.
        """
    @feed.setter
    def feed(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def feed_mode(self) -> int:
        """
        Group 05: 93, 94, 95.
        """
    @feed_mode.setter
    def feed_mode(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def known(self) -> typing.Annotated[list[bool], "FixedSize(3)"]:
        """
        Whether each axis' position is known.
        """
    @property
    def length_number(self) -> int:
        """
        H.
        """
    @length_number.setter
    def length_number(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def length_offset(self) -> int:
        """
        Group 08: 43, 44, 49.
        """
    @length_offset.setter
    def length_offset(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def motion(self) -> int:
        """
        Group 01: 0, 1, 2, 3.
        """
    @motion.setter
    def motion(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def plane(self) -> int:
        """
        Group 02: 17, 18, 19.
        """
    @plane.setter
    def plane(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def position_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Position in the active work coordinates, shape (3,), mm.
        """
    @property
    def spindle_rev_per_min(self) -> float:
        """
        S; 0 before the first.
        """
    @spindle_rev_per_min.setter
    def spindle_rev_per_min(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def uncertain(self) -> bool:
        """
        Whether a modal code depends on the block-skip switch.
        """
    @property
    def units(self) -> int:
        """
        Group 06: 20, 21.
        """
    @units.setter
    def units(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
class StepKind:
    """
    What a step of a program is.
    
    Members:
    
      region
    
      move
    
      function
    """
    __members__: typing.ClassVar[dict[str, StepKind]]
    function: typing.ClassVar[StepKind]
    move: typing.ClassVar[StepKind]
    region: typing.ClassVar[StepKind]
    @typing.overload
    def __eq__(self, other: StepKind) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: StepKind) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class ToolOffset:
    """
    Offsets of one tool, mm; None: not known.
    """
    def __init__(self) -> None:
        ...
    @property
    def length_mm(self) -> float | None:
        """
        Geometry of H.
        """
    @length_mm.setter
    def length_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex | None) -> None:
        ...
    @property
    def length_wear_mm(self) -> float | None:
        """
        Wear of H.
        """
    @length_wear_mm.setter
    def length_wear_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex | None) -> None:
        ...
    @property
    def radius_mm(self) -> float | None:
        """
        Geometry of D.
        """
    @radius_mm.setter
    def radius_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex | None) -> None:
        ...
    @property
    def radius_wear_mm(self) -> float | None:
        """
        Wear of D.
        """
    @radius_wear_mm.setter
    def radius_wear_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex | None) -> None:
        ...
class CodeBindings:
    """
    Codes that the machine builder bound to programs.
    """
    def __init__(self) -> None:
        ...
    @property
    def g_macros(self) -> dict[int, int]:
        """
        G code in tenths to program, called like G65.
        """
    @g_macros.setter
    def g_macros(self, arg0: collections.abc.Mapping[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]) -> None:
        ...
    @property
    def m_macros(self) -> dict[int, int]:
        """
        M code to program, called like G65.
        """
    @m_macros.setter
    def m_macros(self, arg0: collections.abc.Mapping[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]) -> None:
        ...
    @property
    def m_subprograms(self) -> dict[int, int]:
        """
        M code to program, called like M98.
        """
    @m_subprograms.setter
    def m_subprograms(self, arg0: collections.abc.Mapping[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]) -> None:
        ...
    @property
    def tool_program(self) -> int:
        """
        T calls it with T in #149; -1: none.
        """
    @tool_program.setter
    def tool_program(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
class WorkLimits:
    """
    Limits of the work that a program may cause, checked while it is read.
    """
    def __init__(self) -> None:
        ...
    @property
    def bytes(self) -> int:
        """
        Bytes of program texts read.
        """
    @bytes.setter
    def bytes(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def expansion_bytes(self) -> int:
        """
        Bytes by which the expanded program is longer.
        """
    @expansion_bytes.setter
    def expansion_bytes(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def expansion_moves(self) -> int:
        """
        Moves beyond one for each line of the texts.
        """
    @expansion_moves.setter
    def expansion_moves(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def feed_mm_per_s(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Highest speed of each axis while cutting, mm/s.
        """
    @feed_mm_per_s.setter
    def feed_mm_per_s(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def m_function_s(self) -> float:
        """
        Time of any other M code, s.
        """
    @m_function_s.setter
    def m_function_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def moves(self) -> int:
        """
        Moves, dwells, and blocks with machine functions.
        """
    @moves.setter
    def moves(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def rapid_mm_per_s(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Highest speed of each axis in a rapid, mm/s.
        """
    @rapid_mm_per_s.setter
    def rapid_mm_per_s(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def seconds(self) -> float:
        """
        Minimum time: moves at their feed, dwells, tool changes and M codes, s.
        """
    @seconds.setter
    def seconds(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def steps(self) -> int:
        """
        Lines executed, not counting the first time of each.
        """
    @steps.setter
    def steps(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def tool_change_s(self) -> float:
        """
        Time of an M06, s.
        """
    @tool_change_s.setter
    def tool_change_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
class ReaderOptions:
    """
    Settings of the control that change the meaning of a program.
    """
    def __init__(self) -> None:
        ...
    @property
    def absolute_arc_centres(self) -> bool:
        """
        I J K are positions (not FANUC).
        """
    @absolute_arc_centres.setter
    def absolute_arc_centres(self, arg0: bool) -> None:
        ...
    @property
    def arc_tolerance_mm(self) -> float:
        """
        Largest difference of an arc's radii, mm (parameter 3410).
        """
    @arc_tolerance_mm.setter
    def arc_tolerance_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def arc_without_centre_is_line(self) -> bool:
        """
        G02, G03 without R, I, J, K are lines (parameter 3403#5 = 0); False: alarm 0022.
        """
    @arc_without_centre_is_line.setter
    def arc_without_centre_is_line(self, arg0: bool) -> None:
        ...
    @property
    def bindings(self) -> CodeBindings:
        """
        Codes bound to programs.
        """
    @bindings.setter
    def bindings(self, arg0: CodeBindings) -> None:
        ...
    @property
    def block_skip(self) -> typing.Annotated[list[bool | None], "FixedSize(9)"]:
        """
        Switch of / ... /9: on, off, or None: not known.
        """
    @block_skip.setter
    def block_skip(self, arg0: typing.Annotated[collections.abc.Sequence[bool | None], "FixedSize(9)"]) -> None:
        ...
    @property
    def calculator_decimal_point(self) -> bool:
        """
        True: X10 is 10 mm; False: 10 least increments (parameter 3401#0).
        """
    @calculator_decimal_point.setter
    def calculator_decimal_point(self, arg0: bool) -> None:
        ...
    @property
    def collect_alarms(self) -> bool:
        """
        Continue after an alarm, and store all in ProgramText.alarms.
        """
    @collect_alarms.setter
    def collect_alarms(self, arg0: bool) -> None:
        ...
    @property
    def compensation_start_up(self) -> str:
        """
        Start-up of cutter compensation, A or B (parameter 5003).
        """
    @compensation_start_up.setter
    def compensation_start_up(self, arg1: str) -> None:
        ...
    @property
    def expand_compensation(self) -> bool:
        """
        G41/G42 become simple moves; False: left unchanged.
        """
    @expand_compensation.setter
    def expand_compensation(self, arg0: bool) -> None:
        ...
    @property
    def extra_work_offsets_mm(self) -> dict[int, typing.Annotated[list[float], "FixedSize(3)"]]:
        """
        G54.1 P number to offsets, mm.
        """
    @extra_work_offsets_mm.setter
    def extra_work_offsets_mm(self, arg0: collections.abc.Mapping[typing.SupportsInt | typing.SupportsIndex, typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"]]) -> None:
        ...
    @property
    def least_increment_inch(self) -> float:
        """
        Inch least increment, inch.
        """
    @least_increment_inch.setter
    def least_increment_inch(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def least_increment_mm(self) -> float:
        """
        Metric least increment, mm.
        """
    @least_increment_mm.setter
    def least_increment_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def limits(self) -> WorkLimits:
        """
        Limits of the work that a program may cause.
        """
    @limits.setter
    def limits(self, arg0: WorkLimits) -> None:
        ...
    @property
    def load_program(self) -> bool:
        """
        Called with an O number that the file does not contain; returns (name, bytes) or None.
        """
    @load_program.setter
    def load_program(self, arg1: typing.Any) -> None:
        ...
    @property
    def max_line_length(self) -> int:
        """
        Maximum length of a line in characters.
        """
    @max_line_length.setter
    def max_line_length(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def offset_memory(self) -> str:
        """
        Offset memory A, B or C.
        """
    @offset_memory.setter
    def offset_memory(self, arg1: str) -> None:
        ...
    @property
    def opaque_programs(self) -> typing.Annotated[list[int], "FixedSize(2)"]:
        """
        First and last number of the programs whose calls are left unchanged if they are not found.
        """
    @opaque_programs.setter
    def opaque_programs(self, arg0: typing.Annotated[collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], "FixedSize(2)"]) -> None:
        ...
    @property
    def peck_clearance_mm(self) -> float:
        """
        Clearance to which a peck of G73 and G83 returns, mm (parameters 5114, 5115).
        """
    @peck_clearance_mm.setter
    def peck_clearance_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def power_on(self) -> ModalState:
        """
        Modal state before the first block.
        """
    @power_on.setter
    def power_on(self, arg0: ModalState) -> None:
        ...
    @property
    def probe_lines(self) -> list[int]:
        """
        Ascending lines of the source after which the modal state is stored (ProgramText.probed).
        """
    @probe_lines.setter
    def probe_lines(self, arg0: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex]) -> None:
        ...
    @property
    def program(self) -> int:
        """
        O number of the program to read; -1: the first.
        """
    @program.setter
    def program(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def program_index(self) -> int:
        """
        Index in `list_programs` of the program to read, of which alone `text` then consists; -1: by number.
        """
    @program_index.setter
    def program_index(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def retained_variables(self) -> dict[int, float]:
        """
        #500 ... #999.
        """
    @retained_variables.setter
    def retained_variables(self, arg0: collections.abc.Mapping[typing.SupportsInt | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex]) -> None:
        ...
    @property
    def scale_unit(self) -> float:
        """
        Unit of the factors of G51 without a decimal point.
        """
    @scale_unit.setter
    def scale_unit(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def subprogram_nesting(self) -> int:
        """
        Deepest nesting of M98.
        """
    @subprogram_nesting.setter
    def subprogram_nesting(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def tool_offsets(self) -> dict[int, ToolOffset]:
        """
        H or D number to ToolOffset.
        """
    @tool_offsets.setter
    def tool_offsets(self, arg0: collections.abc.Mapping[typing.SupportsInt | typing.SupportsIndex, ToolOffset]) -> None:
        ...
    @property
    def unknown_after_tool_change(self) -> typing.Annotated[list[bool], "FixedSize(3)"]:
        """
        Axes whose position is not known after M06.
        """
    @unknown_after_tool_change.setter
    def unknown_after_tool_change(self, arg0: typing.Annotated[collections.abc.Sequence[bool], "FixedSize(3)"]) -> None:
        ...
    @property
    def work_offsets_mm(self) -> list[typing.Annotated[list[float], "FixedSize(3)"]]:
        """
        G54 ... G59, mm; empty: not known.
        """
    @work_offsets_mm.setter
    def work_offsets_mm(self, arg0: collections.abc.Sequence[typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"]]) -> None:
        ...
class RegionNote:
    """
    An N word or a comment inside a region.
    """
    @property
    def comment_length(self) -> int:
        """
        Bytes; 0: no comment.
        """
    @property
    def comment_offset(self) -> int:
        """
        Byte offset of its comment in the text.
        """
    @property
    def n_digits(self) -> int:
        """
        Digits of it as written: N0010 has four.
        """
    @property
    def n_number(self) -> int:
        """
        -1: none.
        """
    @property
    def segment(self) -> int:
        """
        Index of the segment that follows it.
        """
class Region:
    """
    Cutting moves between two stops.
    """
    def __init__(self, *, path: Path, entry: ModalState, exit: ModalState, line: typing.SupportsInt | typing.SupportsIndex, text_begin: typing.SupportsInt | typing.SupportsIndex, text_end: typing.SupportsInt | typing.SupportsIndex) -> None:
        """
        One line of a text as a region that ends with an exact stop: cutting moves instead of a rapid. `path`: its move; `entry`, `exit`: modal state before and after it; `text_begin`, `text_end`: its bytes.
        """
    @property
    def blocks(self) -> int:
        """
        Source blocks with a cutting move.
        """
    @property
    def entry(self) -> ModalState:
        """
        Modal state before it.
        """
    @property
    def exact_stop_at_end(self) -> bool:
        """
        Whether its last block has G09 or is in G61.
        """
    @property
    def exit(self) -> ModalState:
        """
        Modal state after it.
        """
    @property
    def first_line(self) -> int:
        """
        From 1.
        """
    @property
    def incremental(self) -> bool:
        """
        Moves an axis of unknown position: its origin is arbitrary.
        """
    @property
    def last_line(self) -> int:
        """
        From 1, inclusive.
        """
    @property
    def look_ahead_mode(self) -> bool:
        """
        The program switched a look-ahead mode on before it (G05.1 Q1, G08 P1, G05 P10000).
        """
    @property
    def notes(self) -> list[RegionNote]:
        """
        N words and comments in order.
        """
    @property
    def path(self) -> Path:
        """
        Its moves.
        """
    @property
    def shaped(self) -> bool:
        """
        Whether the program marks it as shaped blocks.
        """
    @property
    def text_begin(self) -> int:
        """
        Byte offset of its first line.
        """
    @property
    def text_end(self) -> int:
        """
        Byte offset after its last line.
        """
    @property
    def was_rapid(self) -> bool:
        """
        Whether its shaped blocks replace a rapid.
        """
class ProgramText:
    """
    A program after reading: its exact text and its regions.
    """
    def cutting_path(self, first_line: typing.SupportsInt | typing.SupportsIndex, last_line: typing.SupportsInt | typing.SupportsIndex) -> Path:
        """
        The cutting moves of the regions within a range of lines of the source, as one path.
        """
    def find(self, what: bytes, begin: typing.SupportsInt | typing.SupportsIndex = 0) -> int:
        """
        Index of the first occurrence of bytes in the text from `begin` on, or -1.
        """
    def lead_back(self, source: bytes, lines: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], line_files: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], files: collections.abc.Sequence[str], notes: collections.abc.Sequence[tuple[typing.SupportsInt | typing.SupportsIndex, str]]) -> None:
        """
        Relates the program to `source`, the text (bytes) in another control's dialect from which it was translated. `lines`: for each line of the program's original text the line of the source; `line_files`: its file, 0 the source, n the n-th of `files`; empty: all of the source; `notes`: (line of the source, message), added to the warnings. Raises ArgumentError if lines are missing.
        """
    def origin(self, line: typing.SupportsInt | typing.SupportsIndex) -> tuple:
        """
        (line, file) of the source from which a line of `text` comes.
        """
    def overwrite(self, begin: typing.SupportsInt | typing.SupportsIndex, what: bytes) -> None:
        """
        Overwrites the text from `begin` on with the bytes `what`. Raises ArgumentError beyond the text's end.
        """
    def slice(self, begin: typing.SupportsInt | typing.SupportsIndex, end: typing.SupportsInt | typing.SupportsIndex) -> bytes:
        """
        Bytes of the text between two offsets.
        """
    def view(self) -> memoryview:
        """
        The text without a copy.
        """
    @property
    def alarms(self) -> list:
        """
        What a control would refuse, as `warnings`; only with ReaderOptions.collect_alarms.
        """
    @property
    def block_count(self) -> int:
        """
        Lines with at least one word.
        """
    @property
    def called(self) -> list[int]:
        """
        Indices in `list_programs` of programs of the file that others called.
        """
    @property
    def compensated_moves(self) -> int:
        """
        Cutting moves under G41 or G42, expanded.
        """
    @property
    def expanded(self) -> bool:
        """
        Whether `text` is the expanded program, with calls, macros and coordinate modes resolved.
        """
    @property
    def expanded_radii_mm(self) -> dict[int, float]:
        """
        D number to radius, mm, where cutter compensation was expanded.
        """
    @property
    def final_state(self) -> ModalState:
        """
        Modal state at the end.
        """
    @property
    def functions(self) -> list:
        """
        (M codes, T or -1, S or -1) of blocks with M, S or T words.
        """
    @property
    def header_offset(self) -> int:
        """
        Byte offset at which a header comment may be inserted.
        """
    @property
    def kept_compensated_moves(self) -> int:
        """
        Cutting moves under G41 or G42, left unchanged.
        """
    @property
    def least_time_s(self) -> float:
        """
        Minimum time: moves at their feed within the axis limits, without acceleration; dwells, tool changes and M codes, s.
        """
    @property
    def line_count(self) -> int:
        """
        Lines.
        """
    @property
    def line_end(self) -> str:
        """
        Line end of the text.
        """
    @property
    def move_count(self) -> int:
        """
        Moves, dwells, and blocks with machine functions.
        """
    @property
    def other_moves(self) -> list:
        """
        Moves and waits outside of the regions as (Segment, dwell_s) pairs, for the cycle time.
        """
    @property
    def probed(self) -> list[ModalState]:
        """
        Modal state after each of ReaderOptions.probe_lines.
        """
    @property
    def program_number(self) -> int:
        """
        O number; -1: none.
        """
    @property
    def program_numbers(self) -> list[int]:
        """
        All O numbers in the file.
        """
    @property
    def regions(self) -> list[Region]:
        """
        Regions in order.
        """
    @property
    def size(self) -> int:
        """
        Bytes.
        """
    @property
    def steps(self) -> list:
        """
        (StepKind, index into regions, other_moves or functions, line) in program order.
        """
    @property
    def text(self) -> bytes:
        """
        The whole text.
        """
    @property
    def unexpanded(self) -> bytes:
        """
        The original text, if `text` is the expanded program; else empty.
        """
    @property
    def warnings(self) -> list:
        """
        (line, column, alarm, message, file) each; alarm 0: none; file empty: the program's own.
        """
class ProgramEntry:
    """
    A program of a file that may contain several.
    """
    @property
    def first_line(self) -> int:
        """
        From 1.
        """
    @property
    def folder(self) -> str:
        """
        Folder in the &F= line before it, as written; empty: none.
        """
    @property
    def name(self) -> str:
        """
        Name in a line <NAME> or O<NAME>, with its brackets; empty: none.
        """
    @property
    def number(self) -> int:
        """
        O number; -1: it has none.
        """
    @property
    def text_begin(self) -> int:
        """
        Byte offset of its first line.
        """
    @property
    def text_end(self) -> int:
        """
        Byte offset after its last line.
        """
class LinearPlant:
    """
    A linear plant x' = A x + B u, y = C x + D u, propagated exactly from sample to sample.
    
    The input is linear between samples (first-order hold), as a servo's set-points are. The matrix exponential propagates
    the state over a period, so stiff, undamped and integrating plants are as exact as any other. Any consistent units, time
    in s.
    
    Args:
        a: System matrix, (n, n).
        b: Input matrix, (n, m).
        c: Output matrix, (p, n).
        d: Feed-through, (p, m).
        period_s: Time between samples in s, above 0.
    
    Raises:
        ArgumentError: Shapes that do not fit, an empty one, a value that is not finite, or a period not above 0.
        NumericError: The plant overflows within a period.
    """
    def __init__(self, a: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"], b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"], c: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"], d: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"], period_s: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        Make a plant, at rest with state and input 0.
        """
    def reset(self, state: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> None:
        """
        Sets the state (n,) and the input (m,) at that instant. Raises ArgumentError on another shape.
        """
    def reset_at_rest(self, input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], near: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"] | None = None) -> None:
        """
        Sets the steady state under a constant input.
        
        Args:
            input: Input, (m,).
            near: If integrators leave the state undetermined, the steady state nearest to this one, (n,); None: nearest to 0.
        
        Raises:
            ArgumentError: There is no steady state (the input makes an integrator grow), or another shape.
        """
    def respond(self, inputs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"], state: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"] | None = None) -> numpy.ndarray:
        """
        Outputs for a whole record of inputs; identical to step(), to the last bit.
        
        Args:
            inputs: One row per sample, (n_samples, m), at least one row.
            state: State at the first row, (n,); None: at rest under the first row.
        
        Returns:
            Output at each row, (n_samples, p).
        
        Raises:
            ArgumentError: Another shape, a value that is not finite, or no steady state.
        """
    def step(self, input: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Advances by a period, with `input` (m,) at its end. Returns the output (p,) there.
        """
    @property
    def output(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Output at the last sample, (p,).
        """
    @property
    def period_s(self) -> float:
        """
        Time between samples in s.
        """
    @property
    def state(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        State at the last sample, (n,).
        """
class ModeTable:
    """
    Dependence of a mode on the position of an axis. Immutable.
    
    Frequency and damping ratio are linear between the rows and constant beyond the ends; without rows the mode is constant.
    
    Args:
        axis: Axis of the position: 0, 1, 2 for X, Y, Z.
        position_mm: Strictly ascending positions in mm, shape (n,).
        frequency_hz: Undamped natural frequencies in Hz, one per position, above 0.
        damping_ratio: Damping ratios (no unit), one per position, 0 <= zeta < 1; none: that of the mode.
    
    Raises:
        ArgumentError: Unequal lengths, positions that do not ascend, or a value outside its range.
    """
    def __init__(self, axis: typing.SupportsInt | typing.SupportsIndex = 0, position_mm: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex] = [], frequency_hz: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex] = [], damping_ratio: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex] = []) -> None:
        """
        Raises ArgumentError on a value outside its range.
        """
    def mode_at(self, mode: Mode, position_mm: typing.SupportsFloat | typing.SupportsIndex) -> Mode:
        """
        Mode at a position (mm) of the axis, with the same participation.
        """
    @property
    def axis(self) -> int:
        """
        Axis of the position.
        """
    @property
    def damping_ratio(self) -> list[float]:
        """
        Damping ratios, or none.
        """
    @property
    def frequency_hz(self) -> list[float]:
        """
        Frequencies in Hz.
        """
    @property
    def position_mm(self) -> list[float]:
        """
        Positions in mm.
        """
class FrictionModel:
    """
    Friction of a sliding pair.
    
    Members:
    
      viscous : In proportion to the speed alone.
    
      stribeck : Coulomb, static and Stribeck, smooth through zero speed.
    
      lugre : The same with bristles: presliding, stick, frictional lag.
    """
    __members__: typing.ClassVar[dict[str, FrictionModel]]
    lugre: typing.ClassVar[FrictionModel]
    stribeck: typing.ClassVar[FrictionModel]
    viscous: typing.ClassVar[FrictionModel]
    @typing.overload
    def __eq__(self, other: FrictionModel) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: FrictionModel) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class FrictionParameters:
    """
    Friction of one sliding pair. Immutable.
    
    Args:
        model: See FrictionModel.
        viscous_n_s_per_m: Viscous friction in N s/m, >= 0.
        coulomb_n: Sliding friction in N, > 0 unless viscous.
        static_n: Friction to be overcome from rest in N, >= coulomb_n.
        stribeck_velocity_m_per_s: Speed of the transition from static to sliding friction in m/s, > 0 unless viscous.
        smoothing_velocity_m_per_s: Stribeck: sign(v) is tanh(v / this), m/s, > 0.
        bristle_stiffness_n_per_m: LuGre: force over displacement before sliding in N/m, > 0.
        bristle_damping_n_s_per_m: LuGre: damping of the bristles in N s/m, >= 0.
    
    Raises:
        ArgumentError: A value outside its range.
    """
    def __init__(self, model: FrictionModel = ..., *, viscous_n_s_per_m: typing.SupportsFloat | typing.SupportsIndex = 0.0, coulomb_n: typing.SupportsFloat | typing.SupportsIndex = 0.0, static_n: typing.SupportsFloat | typing.SupportsIndex = 0.0, stribeck_velocity_m_per_s: typing.SupportsFloat | typing.SupportsIndex = 0.0, smoothing_velocity_m_per_s: typing.SupportsFloat | typing.SupportsIndex = 0.0, bristle_stiffness_n_per_m: typing.SupportsFloat | typing.SupportsIndex = 0.0, bristle_damping_n_s_per_m: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        """
        Raises ArgumentError on a value outside its range.
        """
    @property
    def bristle_damping_n_s_per_m(self) -> float:
        """
        N s/m.
        """
    @property
    def bristle_stiffness_n_per_m(self) -> float:
        """
        N/m.
        """
    @property
    def coulomb_n(self) -> float:
        """
        N.
        """
    @property
    def model(self) -> FrictionModel:
        """
        Model.
        """
    @property
    def smoothing_velocity_m_per_s(self) -> float:
        """
        m/s.
        """
    @property
    def static_n(self) -> float:
        """
        N.
        """
    @property
    def stribeck_velocity_m_per_s(self) -> float:
        """
        m/s.
        """
    @property
    def viscous_n_s_per_m(self) -> float:
        """
        N s/m.
        """
class PositionFeedback:
    """
    What the position loop compares with the set-point.
    
    Members:
    
      motor : Encoder on the motor (semi-closed loop).
    
      table : Linear scale on the table (fully closed loop).
    """
    __members__: typing.ClassVar[dict[str, PositionFeedback]]
    motor: typing.ClassVar[PositionFeedback]
    table: typing.ClassVar[PositionFeedback]
    @typing.overload
    def __eq__(self, other: PositionFeedback) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: PositionFeedback) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class FeedDriveParameters:
    """
    Feed drive of one axis, referred to the travel of
    the table. Immutable.
    
    Args:
        motor_mass_kg: Inertia of motor, coupling and screw in kg, > 0.
        table_mass_kg: Table with its load in kg, > 0.
        stiffness_n_per_m: Motor to table, axial, in N/m, > 0.
        damping_n_s_per_m: Damping parallel to the stiffness in N s/m, >= 0.
        position_gain_per_s: Gain of the position loop in 1/s, > 0.
        velocity_gain_n_s_per_m: Force over speed error in N s/m, > 0.
        velocity_integral_time_s: Integral time of the speed controller in s; 0: none.
        velocity_feed_forward_ratio: Ratio of the set-points' speed that is fed forward, 0 ... 1.
        acceleration_feed_forward_ratio: Ratio of acceleration times both masses that is fed forward, 0 ... 1.
        position_feedback: What the position loop measures; the speed is always taken from the motor.
        backlash_m: Whole gap between motor and table in m, >= 0.
        force_limit_n: Force limit of the motor in N; 0: none.
        table_friction: Friction of the guideways.
        motor_friction: Friction of bearings, seals and nut.
        modes: Modes of the structure, excited by the table.
    
    Raises:
        ArgumentError: A value outside its range.
    """
    def __init__(self, *, motor_mass_kg: typing.SupportsFloat | typing.SupportsIndex, table_mass_kg: typing.SupportsFloat | typing.SupportsIndex, stiffness_n_per_m: typing.SupportsFloat | typing.SupportsIndex, damping_n_s_per_m: typing.SupportsFloat | typing.SupportsIndex, position_gain_per_s: typing.SupportsFloat | typing.SupportsIndex, velocity_gain_n_s_per_m: typing.SupportsFloat | typing.SupportsIndex, velocity_integral_time_s: typing.SupportsFloat | typing.SupportsIndex = 0.0, velocity_feed_forward_ratio: typing.SupportsFloat | typing.SupportsIndex = 0.0, acceleration_feed_forward_ratio: typing.SupportsFloat | typing.SupportsIndex = 0.0, position_feedback: PositionFeedback = ..., backlash_m: typing.SupportsFloat | typing.SupportsIndex = 0.0, force_limit_n: typing.SupportsFloat | typing.SupportsIndex = 0.0, table_friction: FrictionParameters = ..., motor_friction: FrictionParameters = ..., modes: collections.abc.Sequence[Mode] = []) -> None:
        """
        Raises ArgumentError on a value outside its range.
        """
    @property
    def acceleration_feed_forward_ratio(self) -> float:
        """
        0 ... 1.
        """
    @property
    def backlash_m(self) -> float:
        """
        m.
        """
    @property
    def damping_n_s_per_m(self) -> float:
        """
        N s/m.
        """
    @property
    def force_limit_n(self) -> float:
        """
        N; 0: none.
        """
    @property
    def modes(self) -> list[Mode]:
        """
        Modes of the structure, excited by the table.
        """
    @property
    def motor_friction(self) -> FrictionParameters:
        """
        Of bearings, seals and nut.
        """
    @property
    def motor_mass_kg(self) -> float:
        """
        kg.
        """
    @property
    def position_feedback(self) -> PositionFeedback:
        """
        What the position loop measures.
        """
    @property
    def position_gain_per_s(self) -> float:
        """
        1/s.
        """
    @property
    def stiffness_n_per_m(self) -> float:
        """
        N/m.
        """
    @property
    def table_friction(self) -> FrictionParameters:
        """
        Of the guideways.
        """
    @property
    def table_mass_kg(self) -> float:
        """
        kg.
        """
    @property
    def velocity_feed_forward_ratio(self) -> float:
        """
        0 ... 1.
        """
    @property
    def velocity_gain_n_s_per_m(self) -> float:
        """
        N s/m.
        """
    @property
    def velocity_integral_time_s(self) -> float:
        """
        s; 0: none.
        """
class FeedDrive:
    """
    Feed drive of one axis, integrated by CVODE.
    
    Set-points come once per period and are joined by straight lines.
    
    Args:
        parameters: The drive.
        period_s: Time between set-points in s.
        rtol: Relative tolerance of following error, deflections and speeds.
        atol_mm: Absolute tolerance of lengths in mm; that of speeds is 100 atol_mm per second.
    
    Raises:
        ArgumentError: A value outside its range.
    """
    def __copy__(self) -> FeedDrive:
        ...
    def __init__(self, parameters: FeedDriveParameters, period_s: typing.SupportsFloat | typing.SupportsIndex, rtol: typing.SupportsFloat | typing.SupportsIndex = 1e-06, atol_mm: typing.SupportsFloat | typing.SupportsIndex = 1e-06) -> None:
        """
        ArgumentError on a value outside its range.
        """
    def reset(self, position_mm: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        At rest at a position (mm).
        """
    def respond(self, setpoints_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.ndarray:
        """
        Takes many set-points and returns the motion of the drive.
        
        Args:
            setpoints_mm: Shape (n,), mm.
        
        Returns:
            (n, 6): response, table and motor in mm, friction on the table, force of the motor and of the spring in N, each
            at the instant of its set-point.
        
        Raises:
            ArgumentError: Another shape or a value that is not finite.
            NumericError: The integrator failed; the message carries CVODE's flag and the time.
        """
    def step(self, setpoint_mm: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Takes the next set-point (mm) and returns the response at that instant in mm. Raises ArgumentError on a set-point that is not finite, NumericError with CVODE's flag and the time if the integrator fails.
        """
    @property
    def motor_mm(self) -> float:
        """
        Angle of the motor as travel, mm.
        """
    @property
    def parameters(self) -> FeedDriveParameters:
        """
        The drive.
        """
    @property
    def response_mm(self) -> float:
        """
        Table and modes, mm.
        """
    @property
    def rhs_evaluations(self) -> int:
        """
        Evaluations of the equations so far.
        """
    @property
    def steps(self) -> int:
        """
        Internal steps so far.
        """
    @property
    def table_mm(self) -> float:
        """
        mm.
        """
    @property
    def time_s(self) -> float:
        """
        Time since reset(), s.
        """
class FeedDriveRealTime:
    """
    FeedDrive with fixed steps and without error control: the real-time form.
    
    Args:
        parameters: The drive.
        period_s: Time between set-points in s.
        substeps: Steps in a period, 1 ... 1000.
    
    Raises:
        ArgumentError: A value outside its range.
    """
    def __init__(self, parameters: FeedDriveParameters, period_s: typing.SupportsFloat | typing.SupportsIndex, substeps: typing.SupportsInt | typing.SupportsIndex = 4) -> None:
        """
        ArgumentError on a value outside its range.
        """
    def reset(self, position_mm: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        At rest at a position (mm).
        """
    def respond(self, setpoints_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.ndarray:
        """
        Responses (n,) in mm at many set-points (n,) in mm. Raises ArgumentError on another shape.
        """
    def step(self, setpoint_mm: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Takes the next set-point (mm) and returns the response at that instant in mm.
        """
class Arma:
    """
    ARMA(2n, 2n-1) model: response = B(z)/A(z) force, A = 1 - phi_1/z - ... - phi_2n/z^2n.
    
    For a free decay the force is a unit impulse at the first sample. Source: paper 003, eq. 1-4.
    """
    @property
    def converged(self) -> bool:
        """
        True if phi converged; otherwise this is the best of all rounds.
        """
    @property
    def iterations(self) -> int:
        """
        Rounds of least squares.
        """
    @property
    def numerator(self) -> numpy.ndarray:
        """
        b_0, b_1, ...: shape (1, 2n+1) for impacts, (records, 2n) for free decays.
        """
    @property
    def phi(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        phi_1 ... phi_2n, shape (2n,): lambda^2n - phi_1 lambda^(2n-1) - ... = 0 gives the poles.
        """
    @property
    def poles(self) -> numpy.typing.NDArray[numpy.complex128]:
        """
        Roots lambda, complex, shape (2n,).
        """
    @property
    def residual_rms(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        RMS of response minus B/A force per record, shape (records,), in the response's unit.
        """
    @property
    def theta(self) -> numpy.ndarray:
        """
        theta_k = -b_k/b_0, one column less than the numerator; nan where b_0 is 0.
        """
class ModalFit:
    """
    Modes fitted to impacts by fit_modes, with their covariance.
    """
    @property
    def compliance(self) -> float:
        """
        Contribution of modes far above: compliance of a spring without mass, m/N; 0 without it.
        """
    @property
    def converged(self) -> bool:
        """
        True if a minimum was reached.
        """
    @property
    def covariance(self) -> numpy.ndarray:
        """
        Covariance, shape (3n, 3n), of omega, zeta, 1/m of the first mode, then of the second, ...
        """
    @property
    def damping_ratio(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Damping ratios, no unit, shape (n,).
        """
    @property
    def fitted(self) -> list[numpy.typing.NDArray[numpy.float64]]:
        """
        Response of the model per record, each of shape (n,), offset included.
        """
    @property
    def inverse_mass(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Residues 1/m in 1/kg, shape (n,); negative where the mode shape has opposite signs at impact and sensor.
        """
    @property
    def iterations(self) -> int:
        """
        Steps of the search.
        """
    @property
    def log_likelihood(self) -> float:
        """
        Logarithm of the likelihood, for white normal residuals of the same variance in all records.
        """
    @property
    def mass_line(self) -> float:
        """
        Contribution of modes far below: inverse mass of a free mass, 1/kg; 0 without it.
        """
    @property
    def offset(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Offset per record, shape (records,), in the response's unit.
        """
    @property
    def omega_rad_s(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Undamped natural frequencies in rad/s, shape (n,), in the order of the starts.
        """
    @property
    def parameters(self) -> int:
        """
        Fitted parameters, offsets and amplitudes included.
        """
    @property
    def reason(self) -> str:
        """
        Why it has not converged; else empty.
        """
    @property
    def residual_autocorrelation(self) -> float:
        """
        Autocorrelation of the residuals at a lag of one sample, no unit; about 0 where they are white.
        """
    @property
    def residual_rms(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        RMS of the residuals per record, shape (records,), in the response's unit.
        """
    @property
    def samples(self) -> int:
        """
        Samples of all records together.
        """
    @property
    def sum_of_squares(self) -> float:
        """
        Sum of the squared residuals, in the response's unit squared.
        """
class DecayFit:
    """
    Modes fitted to free decays by fit_decay, with their covariance.
    """
    @property
    def amplitude(self) -> numpy.ndarray:
        """
        Amplitudes at the first sample, shape (records, n), in the response's unit.
        """
    @property
    def converged(self) -> bool:
        """
        True if a minimum was reached.
        """
    @property
    def covariance(self) -> numpy.ndarray:
        """
        Covariance, shape (2n, 2n), of omega, zeta of the first mode, then of the second, ...
        """
    @property
    def damping_ratio(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Damping ratios, no unit, shape (n,).
        """
    @property
    def fitted(self) -> list[numpy.typing.NDArray[numpy.float64]]:
        """
        Response of the model per record, each of shape (n,), offset included.
        """
    @property
    def iterations(self) -> int:
        """
        Steps of the search.
        """
    @property
    def log_likelihood(self) -> float:
        """
        Logarithm of the likelihood, for white normal residuals of the same variance in all records.
        """
    @property
    def offset(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Offset per record, shape (records,), in the response's unit.
        """
    @property
    def omega_rad_s(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Undamped natural frequencies in rad/s, shape (n,), in the order of the starts.
        """
    @property
    def parameters(self) -> int:
        """
        Fitted parameters, offsets and amplitudes included.
        """
    @property
    def phase_rad(self) -> numpy.ndarray:
        """
        Phases of the cosines at the first sample in rad, shape (records, n).
        """
    @property
    def reason(self) -> str:
        """
        Why it has not converged; else empty.
        """
    @property
    def residual_autocorrelation(self) -> float:
        """
        Autocorrelation of the residuals at a lag of one sample, no unit; about 0 where they are white.
        """
    @property
    def residual_rms(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        RMS of the residuals per record, shape (records,), in the response's unit.
        """
    @property
    def samples(self) -> int:
        """
        Samples of all records together.
        """
    @property
    def sum_of_squares(self) -> float:
        """
        Sum of the squared residuals, in the response's unit squared.
        """
class ModeRanking:
    """
    Candidates in the order in which each explains most of the residual.
    """
    @property
    def chosen(self) -> list[int]:
        """
        Indices into the candidates, best first.
        """
    @property
    def sum_of_squares(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Sum of squares of the residual after each choice, shape (len(chosen),), in the response's unit squared.
        """
    @property
    def total(self) -> float:
        """
        Sum of squares of the responses, without offsets.
        """
class EquivalentMass:
    """
    Mass whose simulated response has the measured RMS.
    """
    @property
    def converged(self) -> bool:
        """
        True if both RMS agree within the tolerance.
        """
    @property
    def halvings(self) -> int:
        """
        Number of halvings of the range of masses; 0 in closed form.
        """
    @property
    def mass_kg(self) -> float:
        """
        Equivalent mass in kg.
        """
    @property
    def measured_rms(self) -> float:
        """
        RMS of the measured response, in its unit.
        """
    @property
    def simulated_rms(self) -> float:
        """
        RMS of the simulated response, in the same unit.
        """
class ContourTarget:
    """
    Which motion is to follow the programmed path.
    
    Members:
    
      none : None: shaping without contour compensation.
    
      command : The shaped command.
    
      response : The plant's response to it: the part.
    """
    __members__: typing.ClassVar[dict[str, ContourTarget]]
    command: typing.ClassVar[ContourTarget]
    none: typing.ClassVar[ContourTarget]
    response: typing.ClassVar[ContourTarget]
    @typing.overload
    def __eq__(self, other: ContourTarget) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: ContourTarget) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class CommandPlanner:
    """
    What plans the command of a motion before it is shaped.
    
    Members:
    
      look_ahead : Ramps along the path, corners passed slowly.
    
      time_optimal : Corners rounded within the contour tolerance, jerk of every axis limited.
    """
    __members__: typing.ClassVar[dict[str, CommandPlanner]]
    look_ahead: typing.ClassVar[CommandPlanner]
    time_optimal: typing.ClassVar[CommandPlanner]
    @typing.overload
    def __eq__(self, other: CommandPlanner) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: CommandPlanner) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class ShapingOptions:
    """
    How a region is turned into a shaped command on the block grid.
    """
    def __init__(self) -> None:
        ...
    @property
    def axis_shapers(self) -> list[Fir]:
        """
        A shaper for each of X, Y and Z, of one mean delay, instead of the common one; empty: none.
        """
    @axis_shapers.setter
    def axis_shapers(self, arg0: collections.abc.Sequence[Fir]) -> None:
        ...
    @property
    def block_period_s(self) -> float:
        """
        s.
        """
    @block_period_s.setter
    def block_period_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def contour_smoothness(self) -> float:
        """
        Weight of the correction's second differences.
        """
    @contour_smoothness.setter
    def contour_smoothness(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def feed_excess_ratio(self) -> float:
        """
        Ratio by which the shaped command may exceed the programmed feed along the path.
        """
    @feed_excess_ratio.setter
    def feed_excess_ratio(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def following(self) -> FollowingFir | None:
        """
        Shapers along an axis instead of the one shaper, taps in whole block periods; None: none.
        """
    @following.setter
    def following(self, arg0: FollowingFir | None) -> None:
        ...
    @property
    def further_stops(self) -> list[int]:
        """
        Ascending indices of segments before which the command also stops.
        """
    @further_stops.setter
    def further_stops(self, arg0: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex]) -> None:
        ...
    @property
    def interpolation_period_s(self) -> float:
        """
        s.
        """
    @interpolation_period_s.setter
    def interpolation_period_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def least_feed_mm_per_s(self) -> float:
        """
        Lowest feed of the controller: no motion is slowed below it for the tolerance, mm/s.
        """
    @least_feed_mm_per_s.setter
    def least_feed_mm_per_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def limits(self) -> MotionLimits:
        """
        Limits of the look-ahead.
        """
    @limits.setter
    def limits(self, arg0: MotionLimits) -> None:
        ...
    @property
    def mode_tables(self) -> typing.Annotated[list[list[ModeTable]], "FixedSize(3)"]:
        """
        How the modes vary with the position of the axis of `following`, for the response as target.
        """
    @mode_tables.setter
    def mode_tables(self, arg0: typing.Annotated[collections.abc.Sequence[collections.abc.Sequence[ModeTable]], "FixedSize(3)"]) -> None:
        ...
    @property
    def modes(self) -> typing.Annotated[list[list[Mode]], "FixedSize(3)"]:
        """
        Modes of X, Y and Z, for the response as target.
        """
    @modes.setter
    def modes(self, arg0: typing.Annotated[collections.abc.Sequence[collections.abc.Sequence[Mode]], "FixedSize(3)"]) -> None:
        ...
    @property
    def planner(self) -> CommandPlanner:
        """
        What plans the command; `time_optimal` needs feed, acceleration and jerk of every axis in `limits`.
        """
    @planner.setter
    def planner(self, arg0: CommandPlanner) -> None:
        ...
    @property
    def plunge_axis_angle_rad(self) -> float:
        """
        Largest angle from the tool axis Z that still counts as a plunge, rad.
        """
    @plunge_axis_angle_rad.setter
    def plunge_axis_angle_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def plunge_corner_angle_rad(self) -> float:
        """
        Smallest change of direction of a corner with a plunge that is a forced stop, rad.
        """
    @plunge_corner_angle_rad.setter
    def plunge_corner_angle_rad(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def rest_at_stop_s(self) -> float:
        """
        Pause at a forced stop, s.
        """
    @rest_at_stop_s.setter
    def rest_at_stop_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def target(self) -> ContourTarget:
        """
        Motion that contour compensation brings back to the path, within the contour tolerance.
        """
    @target.setter
    def target(self, arg0: ContourTarget) -> None:
        ...
    @property
    def tolerance(self) -> FilterTolerance:
        """
        Tolerance for the shaper and the filters after it.
        """
    @tolerance.setter
    def tolerance(self, arg0: FilterTolerance) -> None:
        ...
class ShapedCommand:
    """
    A shaped command on the block grid.
    """
    @property
    def arc_normal(self) -> list[int]:
        """
        Per period the axis perpendicular to the plane of an arc, or -1.
        """
    @property
    def first_period(self) -> int:
        """
        Periods of the region before this part.
        """
    @property
    def grid_mm(self) -> numpy.ndarray:
        """
        (n+1, 3) positions at multiples of the block period, mm, read-only view.
        """
    @property
    def middle_mm(self) -> numpy.ndarray:
        """
        (n, 3) positions half a period later, mm, read-only view.
        """
    @property
    def run_ends(self) -> list[int]:
        """
        Periods of this part at which the command is at rest.
        """
    @property
    def segment_periods(self) -> list[int]:
        """
        Per marked segment the period of the region in which its start is reached.
        """
class RegionShaper:
    """
    A region's shaped command in parts, so that memory does not grow with the region.
    
    Args:
        path: The programmed path.
        shaper: Taps in whole block periods, common to all axes.
        marked_segments: Ascending indices of segments whose start time is wanted.
        options: How the region is shaped.
    
    Raises:
        ArgumentError: The block period is no multiple of the interpolation period, or a limit is not above 0.
    """
    def __init__(self, path: Path, shaper: Fir, marked_segments: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], options: ShapingOptions) -> None:
        """
        See the class.
        """
    def begin_anew(self) -> bool:
        """
        Restarts the region from its beginning, with the feed that the search then finds.
        
        Returns:
            False, and nothing is done, if begin_early() was not called or had no effect.
        """
    def begin_early(self) -> None:
        """
        Lets next() return parts before the search for the feed has ended; call it before the first part.
        
        If the region is one motion from rest to rest, with a target, next() returns parts while the search measures them, as if
        its first plan kept the tolerance. If it does not, next() returns None and is_withdrawn is True: all parts returned are
        invalid.
        """
    def next(self, periods: typing.SupportsInt | typing.SupportsIndex) -> ShapedCommand | None:
        """
        Next part of at most `periods` periods. None: there is none left, or is_withdrawn.
        """
    @property
    def is_slowed(self) -> bool:
        """
        Whether any motion so far is slower than without a tolerance; True without a target.
        """
    @property
    def is_withdrawn(self) -> bool:
        """
        Whether the returned parts are invalid.
        """
    @property
    def largest_deviation_mm(self) -> float:
        """
        Largest deviation of the target from the path, over the motions returned so far, mm.
        """
    @property
    def share(self) -> float:
        """
        Progress in the region, 0 to 1.
        """
    @property
    def stops(self) -> int:
        """
        Number of stops at junctions that exceed the tolerance at every speed.
        """
class ContourSolver:
    """
    Correction of a command before shaping that brings the shaped command back to the path.
    
    Minimises |e + f*c|^2 + w |second differences of c|^2 for one axis.
    
    Args:
        kernel: f, taps at delays 0, 1, ... samples.
        smoothness: w, above 0.
    
    Raises:
        ArgumentError: An empty or not finite kernel, or a smoothness that is not above 0.
    
    Source: this project.
    """
    def __init__(self, kernel: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], smoothness: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        See the class.
        """
    def solve(self, error: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], carried: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], stiffness: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] = ...) -> numpy.typing.NDArray[numpy.float64]:
        """
        Corrections (m,) for errors (m + len(kernel) - 1,); `carried`: the len(kernel) + 1 corrections before; `stiffness`: empty, or m + 2 factors of the smoothness.
        """
class FitOptions:
    """
    Grid on which blocks are fitted.
    """
    def __init__(self) -> None:
        ...
    def end_with_arc(self, clockwise: bool, normal: typing.SupportsInt | typing.SupportsIndex, radius_mm: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        The last block must be an arc, so that the modal motion code after it is G02 or G03.
        """
    @property
    def arc_min_chord_mm(self) -> float:
        """
        Arcs with a shorter chord are lines, mm.
        """
    @arc_min_chord_mm.setter
    def arc_min_chord_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def block_period_s(self) -> float:
        """
        s.
        """
    @block_period_s.setter
    def block_period_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def equal_above_increments(self) -> float:
        """
        Blocks may be longer if the command moves no further per interpolation period, increments.
        """
    @equal_above_increments.setter
    def equal_above_increments(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def equal_periods(self) -> int:
        """
        Likewise blocks this far from both ends of a section at constant velocity; 0: none.
        """
    @equal_periods.setter
    def equal_periods(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def feed_unit_mm_per_s(self) -> float:
        """
        One step of the last F digit, mm/s.
        """
    @feed_unit_mm_per_s.setter
    def feed_unit_mm_per_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def increment_mm(self) -> float:
        """
        Least increment of the words, mm.
        """
    @increment_mm.setter
    def increment_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def interpolation_period_s(self) -> float:
        """
        s.
        """
    @interpolation_period_s.setter
    def interpolation_period_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def lent_periods(self) -> int:
        """
        Periods by which the blocks before were too short.
        """
    @lent_periods.setter
    def lent_periods(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def merge_tolerance_increments(self) -> float:
        """
        Permitted deviation of merged blocks from the shaped command, per axis, least increments.
        """
    @merge_tolerance_increments.setter
    def merge_tolerance_increments(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def minimum_feed(self) -> int:
        """
        In feed units.
        """
    @minimum_feed.setter
    def minimum_feed(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def modes(self) -> typing.Annotated[list[list[Mode]], "FixedSize(3)"]:
        """
        Modes of X, Y, Z, which the rounding of block ends leaves at rest; none: ends are rounded to the nearest increment.
        """
    @modes.setter
    def modes(self, arg0: typing.Annotated[collections.abc.Sequence[collections.abc.Sequence[Mode]], "FixedSize(3)"]) -> None:
        ...
    @property
    def most_periods(self) -> int:
        """
        Longest block, block periods. 1: all blocks have the same duration, for other feed overrides.
        """
    @most_periods.setter
    def most_periods(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def smooth_arcs_mm(self) -> float:
        """
        Distance by which the middle of an arc may be moved to reduce the angle to its neighbours, mm.
        """
    @smooth_arcs_mm.setter
    def smooth_arcs_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
class FittedBlocks:
    """
    Blocks ready to be written.
    """
    def __len__(self) -> int:
        ...
    @property
    def ends(self) -> numpy.typing.NDArray[numpy.int64]:
        """
        Absolute end positions in least increments, (n, 3).
        """
    @property
    def first_periods(self) -> numpy.typing.NDArray[numpy.uint32]:
        """
        Block period of the command in which each begins, (n,).
        """
    @property
    def left_periods(self) -> int:
        """
        Periods by which the blocks are too short: `FitOptions.lent_periods` of the next piece.
        """
    @property
    def periods(self) -> numpy.typing.NDArray[numpy.uint32]:
        """
        Whole block periods that each lasts, (n,).
        """
class BlockMark:
    """
    An N word and a comment, written before the first block that begins at `period` or later.
    """
    def __init__(self, period: typing.SupportsInt | typing.SupportsIndex, n_number: typing.SupportsInt | typing.SupportsIndex = -1, comment: bytes = b'', n_digits: typing.SupportsInt | typing.SupportsIndex = 0) -> None:
        ...
class WriterOptions:
    """
    How fitted blocks are written.
    """
    def __init__(self) -> None:
        ...
    @property
    def exact_stop_at_end(self) -> bool:
        """
        G09 on the last block.
        """
    @exact_stop_at_end.setter
    def exact_stop_at_end(self, arg0: bool) -> None:
        ...
    @property
    def feed_decimals(self) -> int:
        """
        Decimals of F.
        """
    @feed_decimals.setter
    def feed_decimals(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def incremental(self) -> bool:
        """
        G91 words.
        """
    @incremental.setter
    def incremental(self, arg0: bool) -> None:
        ...
    @property
    def line_end(self) -> str:
        """
        Line end.
        """
    @line_end.setter
    def line_end(self, arg0: str) -> None:
        ...
    @property
    def motion(self) -> int:
        """
        Motion code active before the first block.
        """
    @motion.setter
    def motion(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def plane(self) -> int:
        """
        Plane active before the first block.
        """
    @plane.setter
    def plane(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def position_decimals(self) -> int:
        """
        Decimals of a position word.
        """
    @position_decimals.setter
    def position_decimals(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
class LinearBlock:
    """
    A block of linear feed that replaces blocks of constant feed.
    """
    def __init__(self, end_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], length_mm: typing.SupportsFloat | typing.SupportsIndex, start_feed_mm_per_min: typing.SupportsFloat | typing.SupportsIndex, feed_mm_per_min: typing.SupportsFloat | typing.SupportsIndex, radius_mm: typing.SupportsFloat | typing.SupportsIndex = 0.0, sweep_rad: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        """
        A line, or an arc in the XY plane.
        """
    @property
    def duration_s(self) -> float:
        """
        Duration, s.
        """
    @property
    def end_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        (3,) where it ends, mm.
        """
    @property
    def feed_mm_per_min(self) -> float:
        """
        At its end, mm/min.
        """
    @property
    def first(self) -> int:
        """
        Index of the first block that it replaces.
        """
    @property
    def is_linear(self) -> bool:
        """
        False: its feed is constant.
        """
    @property
    def last(self) -> int:
        """
        Index of the last one.
        """
    @property
    def length_mm(self) -> float:
        """
        Of its path, mm.
        """
    @property
    def radius_mm(self) -> float:
        """
        Of an arc, mm; 0: a line.
        """
    @property
    def sets_feed(self) -> bool:
        """
        Its start feed differs from the feed of the block before: a line before it sets the feed.
        """
    @property
    def start_feed_mm_per_min(self) -> float:
        """
        At its start, mm/min.
        """
    @property
    def sweep_rad(self) -> float:
        """
        Of an arc, rad.
        """
class BlockEnd:
    """
    When a block's successor starts.
    
    Members:
    
      ceil : At the next interpolation period (paper 004).
    
      carry : At once: the remainder of a period is carried over.
    """
    __members__: typing.ClassVar[dict[str, BlockEnd]]
    carry: typing.ClassVar[BlockEnd]
    ceil: typing.ClassVar[BlockEnd]
    @typing.overload
    def __eq__(self, other: BlockEnd) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: BlockEnd) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class DeviationStats:
    """
    Statistics of a signed deviation.
    """
    @property
    def count(self) -> int:
        """
        Samples.
        """
    @property
    def max_abs_mm(self) -> float:
        """
        Largest magnitude, mm.
        """
    @property
    def most_negative_mm(self) -> float:
        """
        Right of the path or below, mm.
        """
    @property
    def most_positive_mm(self) -> float:
        """
        Left of the path or above, mm.
        """
    @property
    def rms_mm(self) -> float:
        """
        mm.
        """
    @property
    def sum_of_squares_mm2(self) -> float:
        """
        mm^2.
        """
class ContourTracker:
    """
    Tracks the distance of a moving point from a path.
    """
    def __init__(self, path: Path) -> None:
        """
        Raises ArgumentError on a path without segments.
        """
class SimulationOptions:
    """
    Options of a simulation and of its measurements.
    """
    def __init__(self) -> None:
        ...
    @property
    def arrived_mm(self) -> float:
        """
        Drives: the residual is the vibration of the table relative to its motor once the motor is within this distance of the command, mm; 0: |response - command| from the stop on.
        """
    @arrived_mm.setter
    def arrived_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def axis_filters(self) -> list[Fir]:
        """
        Filters after the set-points, in order.
        """
    @axis_filters.setter
    def axis_filters(self, arg0: collections.abc.Sequence[Fir]) -> None:
        ...
    @property
    def drives(self) -> list[FeedDriveParameters]:
        """
        Feed drives of X, Y and Z in place of the modes; none: modes alone.
        """
    @drives.setter
    def drives(self, arg0: collections.abc.Sequence[FeedDriveParameters]) -> None:
        ...
    @property
    def feed_slack_mm(self) -> float:
        """
        Distance that rounding may add within `feed_window_s`, mm.
        """
    @feed_slack_mm.setter
    def feed_slack_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def feed_window_s(self) -> float:
        """
        Averaging time of the speed for its largest ratio to the programmed feed, s; four and sixteen times it are used, too; 0: not measured.
        """
    @feed_window_s.setter
    def feed_window_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def last_seconds(self) -> float:
        """
        Blocks only: simulate only this time before the end, s; 0: all.
        """
    @last_seconds.setter
    def last_seconds(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def measure_command(self) -> bool:
        """
        False: the deviation of the response alone, no orbit errors.
        """
    @measure_command.setter
    def measure_command(self, arg0: bool) -> None:
        ...
    @property
    def measure_contour(self) -> bool:
        """
        Whether deviations and orbit errors are measured.
        """
    @measure_contour.setter
    def measure_contour(self, arg0: bool) -> None:
        ...
    @property
    def measure_response(self) -> bool:
        """
        False: the command alone; no figures of the response.
        """
    @measure_response.setter
    def measure_response(self, arg0: bool) -> None:
        ...
    @property
    def measure_response_orbit(self) -> bool:
        """
        Also orbit errors of the response, if the contour is measured.
        """
    @measure_response_orbit.setter
    def measure_response_orbit(self, arg0: bool) -> None:
        ...
    @property
    def mode_tables(self) -> typing.Annotated[list[list[ModeTable]], "FixedSize(3)"]:
        """
        How the modes of X, Y and Z vary with position, one table per mode; none: constant modes.
        """
    @mode_tables.setter
    def mode_tables(self, arg0: typing.Annotated[collections.abc.Sequence[collections.abc.Sequence[ModeTable]], "FixedSize(3)"]) -> None:
        ...
    @property
    def modes(self) -> typing.Annotated[list[list[Mode]], "FixedSize(3)"]:
        """
        Modes of X, Y and Z.
        """
    @modes.setter
    def modes(self, arg0: typing.Annotated[collections.abc.Sequence[collections.abc.Sequence[Mode]], "FixedSize(3)"]) -> None:
        ...
    @property
    def other_overrides(self) -> list[float]:
        """
        Blocks only: also compute the largest deviations at these feed overrides.
        """
    @other_overrides.setter
    def other_overrides(self, arg0: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> None:
        ...
    @property
    def period_s(self) -> float:
        """
        Interpolation period, s.
        """
    @period_s.setter
    def period_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def record_samples(self) -> int:
        """
        Maximum number of stored samples; 0: none.
        """
    @record_samples.setter
    def record_samples(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def settling_band_mm(self) -> float:
        """
        Band of the settling time, mm; 0: not measured.
        """
    @settling_band_mm.setter
    def settling_band_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def settling_limit_s(self) -> float:
        """
        Time after the stop in which the settling time is determined; with drives also the residual, s.
        """
    @settling_limit_s.setter
    def settling_limit_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def starved_blocks(self) -> list[int]:
        """
        Blocks only: also simulate a buffer underrun after each of these (ascending), one at a time.
        """
    @starved_blocks.setter
    def starved_blocks(self, arg0: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex]) -> None:
        ...
    @property
    def starved_memory_s(self) -> float:
        """
        Time simulated after such a wait, s; 0: all.
        """
    @starved_memory_s.setter
    def starved_memory_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def starved_s(self) -> float:
        """
        Duration of the wait in a buffer underrun, s.
        """
    @starved_s.setter
    def starved_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def tracker(self) -> ContourTracker:
        """
        Tracker of the path, whose geometry several simulations share; None: each makes its own.
        """
    @tracker.setter
    def tracker(self, arg1: ContourTracker) -> None:
        ...
class FeedExcess:
    """
    The largest ratio of the speed to the programmed feed at the same position.
    """
    @property
    def line(self) -> int:
        """
        Line of the segment that is programmed there.
        """
    @property
    def programmed_mm_per_s(self) -> float:
        """
        Feed programmed there, mm/s.
        """
    @property
    def ratio(self) -> float:
        """
        Speed over feed; 0 where nothing was measured.
        """
    @property
    def speed_mm_per_s(self) -> float:
        """
        Speed there, mm/s.
        """
class StarvedFigures:
    """
    Effect of a buffer underrun.
    """
    @property
    def block(self) -> int:
        """
        Index of the block after which the set-points wait.
        """
    @property
    def command(self) -> DeviationStats:
        """
        Deviation of the command from the path.
        """
    @property
    def residual_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Largest |response - command| while the set-points rest, during the wait and at the end, (3,), mm.
        """
    @property
    def response(self) -> DeviationStats:
        """
        Deviation of the response from the path.
        """
class OverrideFigures:
    """
    The largest deviations at another feed override.
    """
    @property
    def command_mm(self) -> float:
        """
        Of the command from the path, mm.
        """
    @property
    def override_ratio(self) -> float:
        """
        1 = 100 %.
        """
    @property
    def response_mm(self) -> float:
        """
        Of the response from the path, mm.
        """
class SimulationFigures:
    """
    Figures of one motion from rest to rest.
    """
    @property
    def command(self) -> DeviationStats:
        """
        Deviation of the command from the path.
        """
    @property
    def duration_s(self) -> float:
        """
        Time until the set-points rest, s.
        """
    @property
    def end_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Last set-point, (3,), mm.
        """
    @property
    def feed_excess(self) -> FeedExcess:
        """
        Of the command, if requested.
        """
    @property
    def orbit_error_percent(self) -> list[float]:
        """
        Orbit error of the command per arc of the path, in percent.
        """
    @property
    def other_overrides(self) -> list[OverrideFigures]:
        """
        One per SimulationOptions.other_overrides.
        """
    @property
    def peak_acceleration_mm_per_s2(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Of the command, (3,), mm/s^2.
        """
    @property
    def peak_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Largest |response - command| in motion, (3,), mm.
        """
    @property
    def recorded_command(self) -> numpy.ndarray:
        """
        (n, 3), mm.
        """
    @property
    def recorded_response(self) -> numpy.ndarray:
        """
        (n, 3), mm.
        """
    @property
    def residual_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Largest |response - command| from the instant at which the set-points rest, (3,), mm.
        """
    @property
    def response(self) -> DeviationStats:
        """
        Deviation of the response from the path.
        """
    @property
    def response_orbit_error_percent(self) -> list[float]:
        """
        Orbit error of the response per arc of the path, in percent, if requested.
        """
    @property
    def settling_s(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Time from the rest of the set-points until |response - command| stays within the band, (3,), s; inf: it leaves the band in the last fifth of `settling_limit_s`.
        """
    @property
    def starved(self) -> list[StarvedFigures]:
        """
        One per SimulationOptions.starved_blocks.
        """
class SectionKind:
    """
    Kind of a section of a path.
    
    Members:
    
      line : Lines of one direction.
    
      arc : Arcs about one centre.
    
      curve : Anything else.
    """
    __members__: typing.ClassVar[dict[str, SectionKind]]
    arc: typing.ClassVar[SectionKind]
    curve: typing.ClassVar[SectionKind]
    line: typing.ClassVar[SectionKind]
    @typing.overload
    def __eq__(self, other: SectionKind) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: SectionKind) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class PathSection:
    """
    A section of a path that is measured separately.
    """
    @property
    def begin_mm(self) -> float:
        """
        Distance of its start from the path's start, mm.
        """
    @property
    def end_mm(self) -> float:
        """
        Distance of its end from the path's start, mm.
        """
    @property
    def first(self) -> int:
        """
        Index of its first segment.
        """
    @property
    def first_line(self) -> int:
        """
        Source line of its first segment, from 1.
        """
    @property
    def kind(self) -> SectionKind:
        """
        Line, arc or curve.
        """
    @property
    def last(self) -> int:
        """
        Index of its last segment.
        """
    @property
    def last_line(self) -> int:
        """
        Source line of its last segment.
        """
    @property
    def length_mm(self) -> float:
        """
        mm.
        """
    @property
    def stops_at_end(self) -> bool:
        """
        The path stops at its end.
        """
class CircleFit:
    """
    Least-squares circle through points (radial distances).
    """
    @property
    def centre_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        (2,), mm.
        """
    @property
    def form_mm(self) -> float:
        """
        Largest less smallest radial distance from the circle, mm.
        """
    @property
    def radius_mm(self) -> float:
        """
        mm.
        """
    @property
    def rms_mm(self) -> float:
        """
        Root mean square of the radial distances, mm.
        """
class Roughness:
    """
    Figures of a profile after ISO 4287.
    """
    @property
    def cutoff_mm(self) -> float:
        """
        Cut-off lambda c, mm.
        """
    @property
    def evaluated_mm(self) -> float:
        """
        Evaluation length: without one cut-off at each end, mm.
        """
    @property
    def ra_mm(self) -> float:
        """
        Arithmetic mean height of the roughness, mm.
        """
    @property
    def rz_mm(self) -> float:
        """
        Mean peak-to-valley height over sampling lengths, mm.
        """
    @property
    def wa_mm(self) -> float:
        """
        Arithmetic mean height of the waviness, mm.
        """
class RestVibration:
    """
    Vibration of a plant while its command is at rest.
    """
    @property
    def begin_s(self) -> float:
        """
        Start of the rest of the command, s.
        """
    @property
    def observed_s(self) -> float:
        """
        Duration of the rest, s.
        """
    @property
    def residual_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Largest |response - command|, (3,), mm.
        """
    @property
    def settling_s(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Time until |response - command| stays within the band, (3,), s; NaN if it left the band in the last eighth of the rest.
        """
class WallFigures:
    """
    One wall of a section, or the width between both.
    """
    @property
    def band_mm(self) -> float:
        """
        Largest less least, mm.
        """
    @property
    def largest_mm(self) -> float:
        """
        mm.
        """
    @property
    def least_mm(self) -> float:
        """
        mm.
        """
    @property
    def mean_mm(self) -> float:
        """
        mm.
        """
    @property
    def stations(self) -> int:
        """
        Number of positions at which it could be measured.
        """
class ArcFigures:
    """
    A circle fitted to the motion or to the wall cut on an arc.
    """
    @property
    def fit(self) -> CircleFit:
        """
        Least-squares circle.
        """
    @property
    def mean_radius_mm(self) -> float:
        """
        Mean distance from the programmed centre, mm.
        """
class SideFigures:
    """
    Largest distance from the path on each side of it.
    """
    @property
    def above_mm(self) -> float:
        """
        Above: more along Z than across the path, mm.
        """
    @property
    def below_mm(self) -> float:
        """
        Below: likewise, mm.
        """
    @property
    def left_mm(self) -> float:
        """
        mm.
        """
    @property
    def right_mm(self) -> float:
        """
        mm.
        """
class SectionFigures:
    """
    What was measured in one section.
    """
    @property
    def command(self) -> DeviationStats:
        """
        Deviation of the command from the path.
        """
    @property
    def command_arc(self) -> ArcFigures | None:
        """
        Circle through the command; arcs from 10 degrees on.
        """
    @property
    def command_orbit_percent(self) -> float | None:
        """
        Orbit error; arcs only.
        """
    @property
    def command_sides(self) -> SideFigures:
        """
        Deviation of the command, by side of the path.
        """
    @property
    def left(self) -> WallFigures:
        """
        Left wall less the programmed wall, positive to the left.
        """
    @property
    def left_roughness(self) -> Roughness | None:
        """
        Roughness of the wall, or None if too short.
        """
    @property
    def left_wall_arc(self) -> ArcFigures | None:
        """
        Circle through the left wall; XY plane only.
        """
    @property
    def nominal_centre_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        (2,) in the plane of the arc, mm.
        """
    @property
    def nominal_radius_mm(self) -> float:
        """
        Programmed radius, mm; arcs only.
        """
    @property
    def peak_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Largest |response - command| during motion, (3,), mm.
        """
    @property
    def response(self) -> DeviationStats:
        """
        Deviation of the response from the path.
        """
    @property
    def response_arc(self) -> ArcFigures | None:
        """
        Circle through the response.
        """
    @property
    def response_orbit_percent(self) -> float | None:
        """
        Orbit error; arcs only.
        """
    @property
    def response_sides(self) -> SideFigures:
        """
        Deviation of the response, by side of the path.
        """
    @property
    def rest(self) -> RestVibration | None:
        """
        Worst stop of the command in it (largest residual); in the section where the motion ends, its last stop; or None.
        """
    @property
    def right(self) -> WallFigures:
        """
        Right wall less the programmed wall, positive to the left.
        """
    @property
    def right_roughness(self) -> Roughness | None:
        """
        Roughness of the wall, or None if too short.
        """
    @property
    def right_wall_arc(self) -> ArcFigures | None:
        """
        Circle through the right wall.
        """
    @property
    def section(self) -> PathSection:
        """
        The section.
        """
    @property
    def time_s(self) -> float:
        """
        Time in which the command moves in it, s.
        """
    @property
    def turns_left(self) -> bool:
        """
        The left wall is the inside one; arcs only.
        """
    @property
    def width(self) -> WallFigures:
        """
        Left less right wall plus the tool's diameter.
        """
class TrackFigures:
    """
    Figures of all samples measured.
    """
    @property
    def command(self) -> DeviationStats:
        """
        Deviation from the path; missed corners count.
        """
    @property
    def command_sides(self) -> SideFigures:
        """
        By sides, without missed corners.
        """
    @property
    def duration_s(self) -> float:
        """
        Time until the command rests for the last time, s.
        """
    @property
    def response(self) -> DeviationStats:
        """
        Deviation from the path; missed corners count.
        """
    @property
    def response_sides(self) -> SideFigures:
        """
        By sides, without missed corners.
        """
    @property
    def rest(self) -> RestVibration:
        """
        The stop at the end.
        """
    @property
    def sections(self) -> list[SectionFigures]:
        """
        In the order of the path.
        """
class MetrologyOptions:
    """
    Options of SectionMetrology.
    """
    def __init__(self) -> None:
        ...
    @property
    def band_mm(self) -> float:
        """
        Band in which the response counts as settled, mm.
        """
    @band_mm.setter
    def band_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def cutoff_mm(self) -> float:
        """
        Cut-off lambda c, mm; 0: as in ISO 4288.
        """
    @cutoff_mm.setter
    def cutoff_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def lambda_s_mm(self) -> float:
        """
        Short-wave cut-off, mm; 0: none.
        """
    @lambda_s_mm.setter
    def lambda_s_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def least_rest_s(self) -> float:
        """
        A shorter rest within the path is no stop, s.
        """
    @least_rest_s.setter
    def least_rest_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def period_s(self) -> float:
        """
        Time between two samples, s.
        """
    @period_s.setter
    def period_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def station_spacing_mm(self) -> float:
        """
        Largest distance of two stations, mm.
        """
    @station_spacing_mm.setter
    def station_spacing_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def tool_radius_mm(self) -> float:
        """
        Radius of the disc that is swept, mm.
        """
    @tool_radius_mm.setter
    def tool_radius_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
class SectionMetrology:
    """
    Measures a motion per section of a path, sample by sample.
    """
    def __init__(self, path: Path, sections: collections.abc.Sequence[PathSection], options: MetrologyOptions) -> None:
        """
        Raises ArgumentError on a path without length, sections of another path, or an option outside its range.
        """
    def feed(self, command_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], response_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> None:
        """
        Takes the next samples of command and response, (n, 3), mm. Raises ArgumentError on other shapes or values that are not finite.
        """
    def finish(self) -> TrackFigures:
        """
        Everything measured so far. Raises NumericError if a circle fit does not converge.
        """
    def wall_profile(self, section: typing.SupportsInt | typing.SupportsIndex) -> tuple[float, float, numpy.ndarray, numpy.ndarray, numpy.ndarray, numpy.ndarray]:
        """
        Returns distance of the first station from the path's start, mm; spacing, mm; deviations of the left and of the right wall, (n,), mm, positive to the left, NaN where there is no wall; the path's points and its left normals, both seen from above, (n, 2).
        """
    @property
    def station_spacing_mm(self) -> float:
        """
        Largest distance of two stations, mm.
        """
class PathFollower:
    """
    Deviation vectors of a response from the path that its command follows.
    """
    def __init__(self, path: Path) -> None:
        """
        Raises ArgumentError on a path without segments.
        """
    def step(self, command_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], response_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Takes the next samples of command and response, (k, 3), mm. Returns the vectors from the foot on the path to the response, (k, 3), mm. Raises ArgumentError on other or unequal shapes, or values that are not finite.
        """
class MotionKind:
    """
    Where the controller accelerates a cutting move.
    
    Members:
    
      look_ahead : Before interpolation: the speed is planned along the path.
    
      after_interpolation : After it: each axis is filtered, and cutting blocks overlap (paper 004).
    """
    __members__: typing.ClassVar[dict[str, MotionKind]]
    after_interpolation: typing.ClassVar[MotionKind]
    look_ahead: typing.ClassVar[MotionKind]
    @typing.overload
    def __eq__(self, other: MotionKind) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: MotionKind) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class FilterShape:
    """
    Shape of the acceleration after interpolation.
    
    Members:
    
      linear : Moving average over the time constant; with a bell time a second one after it.
    
      exponential : Geometric weights of the time constant.
    """
    __members__: typing.ClassVar[dict[str, FilterShape]]
    exponential: typing.ClassVar[FilterShape]
    linear: typing.ClassVar[FilterShape]
    @typing.overload
    def __eq__(self, other: FilterShape) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: FilterShape) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class RapidPath:
    """
    Path of a rapid (1401#1).
    
    Members:
    
      linear : Straight: the slowest axis determines the tangential rate.
    
      non_linear : Every axis at its own rate.
    """
    __members__: typing.ClassVar[dict[str, RapidPath]]
    linear: typing.ClassVar[RapidPath]
    non_linear: typing.ClassVar[RapidPath]
    @typing.overload
    def __eq__(self, other: RapidPath) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: RapidPath) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class InPosition:
    """
    How the wait for in-position is determined.
    
    Members:
    
      measured : A constant per axis; the largest of the axes that moved (paper 004, section 2.3).
    
      servo_lag : Until the position error of a first-order servo loop is within the width (1825, 1826).
    """
    __members__: typing.ClassVar[dict[str, InPosition]]
    measured: typing.ClassVar[InPosition]
    servo_lag: typing.ClassVar[InPosition]
    @typing.overload
    def __eq__(self, other: InPosition) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: InPosition) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class ShapedRegions:
    """
    Which cuts of a program run as shaped blocks.
    
    Members:
    
      marked : Regions marked in the program.
    
      all : Every cut.
    
      none : No cut.
    """
    __members__: typing.ClassVar[dict[str, ShapedRegions]]
    all: typing.ClassVar[ShapedRegions]
    marked: typing.ClassVar[ShapedRegions]
    none: typing.ClassVar[ShapedRegions]
    @typing.overload
    def __eq__(self, other: ShapedRegions) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: ShapedRegions) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class FanucModel:
    """
    Parameters of a control that determine cycle time and deviation by acceleration.
    """
    def __init__(self) -> None:
        ...
    @property
    def bell_time_s(self) -> float:
        """
        After interpolation, linear: second moving average, s; 0: none.
        """
    @bell_time_s.setter
    def bell_time_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def block_end(self) -> BlockEnd:
        """
        When a block's successor starts.
        """
    @block_end.setter
    def block_end(self, arg0: BlockEnd) -> None:
        ...
    @property
    def chord_tolerance_mm(self) -> float:
        """
        Arcs of shaped programs are emitted as chords within it, mm; 0: as arcs.
        """
    @chord_tolerance_mm.setter
    def chord_tolerance_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def exponential_rest(self) -> float:
        """
        Exponential: ratio of the sum of the weights that is cut off at the end.
        """
    @exponential_rest.setter
    def exponential_rest(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def feed_forward_ratio(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Per axis, 0 ... 1, shape (3,) (2092).
        """
    @feed_forward_ratio.setter
    def feed_forward_ratio(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def feed_override(self) -> float:
        """
        Scales every programmed feed.
        """
    @feed_override.setter
    def feed_override(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def filter_shape(self) -> FilterShape:
        """
        After interpolation: linear or exponential.
        """
    @filter_shape.setter
    def filter_shape(self, arg0: FilterShape) -> None:
        ...
    @property
    def in_position(self) -> InPosition:
        """
        Measured or from the servo lag.
        """
    @in_position.setter
    def in_position(self, arg0: InPosition) -> None:
        ...
    @property
    def in_position_s(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Measured wait, per axis, s, shape (3,).
        """
    @in_position_s.setter
    def in_position_s(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def in_position_width_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Per axis, mm, shape (3,) (1826).
        """
    @in_position_width_mm.setter
    def in_position_width_mm(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def last_tool_in_spindle(self) -> bool:
        """
        The program's last tool is in the spindle at the start: an M06 that calls it changes nothing.
        """
    @last_tool_in_spindle.setter
    def last_tool_in_spindle(self, arg0: bool) -> None:
        ...
    @property
    def limits(self) -> MotionLimits:
        """
        Limits of the look-ahead; the axes' feed limits hold always.
        """
    @limits.setter
    def limits(self, arg0: MotionLimits) -> None:
        ...
    @property
    def look_ahead_filter_time_constant_s(self) -> float:
        """
        Moving average after look-ahead, s (1769); 0: none.
        """
    @look_ahead_filter_time_constant_s.setter
    def look_ahead_filter_time_constant_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def m_code_s(self) -> dict[int, float]:
        """
        M codes with individual times: code -> s.
        """
    @m_code_s.setter
    def m_code_s(self, arg0: collections.abc.Mapping[typing.SupportsInt | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex]) -> None:
        ...
    @property
    def m_function_s(self) -> float:
        """
        Every M code not in `m_code_s`, s.
        """
    @m_function_s.setter
    def m_function_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def motion(self) -> MotionKind:
        """
        Where a cutting move is accelerated.
        """
    @motion.setter
    def motion(self, arg0: MotionKind) -> None:
        ...
    @property
    def period_s(self) -> float:
        """
        Interpolation period, s.
        """
    @period_s.setter
    def period_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def planner(self) -> PlannerRules:
        """
        Kinds other than fanuc: look-ahead by their rules, also for shaped blocks.
        """
    @planner.setter
    def planner(self, arg0: PlannerRules) -> None:
        ...
    @property
    def position_gain_per_s(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Per axis, 1/s, shape (3,) (1825).
        """
    @position_gain_per_s.setter
    def position_gain_per_s(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def program_start_s(self) -> float:
        """
        From the start key to the first block, s.
        """
    @program_start_s.setter
    def program_start_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def rapid_bell_time_s(self) -> float:
        """
        s (1621); 0: none.
        """
    @rapid_bell_time_s.setter
    def rapid_bell_time_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def rapid_override(self) -> float:
        """
        Scales the rapid rates; the acceleration of a rapid does not change.
        """
    @rapid_override.setter
    def rapid_override(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def rapid_path(self) -> RapidPath:
        """
        Straight, or every axis at its own rate.
        """
    @rapid_path.setter
    def rapid_path(self, arg0: RapidPath) -> None:
        ...
    @property
    def rapid_rate_mm_per_s(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Per axis, shape (3,) (1420).
        """
    @rapid_rate_mm_per_s.setter
    def rapid_rate_mm_per_s(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def rapid_time_constant_s(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Ramp from rest to the rate at override 1, per axis, s, shape (3,) (1620).
        """
    @rapid_time_constant_s.setter
    def rapid_time_constant_s(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
    @property
    def shaped_bell_time_s(self) -> float:
        """
        After shaped blocks, linear: second moving average, s; 0: none.
        """
    @shaped_bell_time_s.setter
    def shaped_bell_time_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def shaped_block_end(self) -> BlockEnd:
        """
        When a shaped block's successor starts; ceil is the slower rule.
        """
    @shaped_block_end.setter
    def shaped_block_end(self, arg0: BlockEnd) -> None:
        ...
    @property
    def shaped_filter_shape(self) -> FilterShape:
        """
        Acceleration after shaped blocks.
        """
    @shaped_filter_shape.setter
    def shaped_filter_shape(self, arg0: FilterShape) -> None:
        ...
    @property
    def shaped_regions(self) -> ShapedRegions:
        """
        Which cuts run as shaped blocks.
        """
    @shaped_regions.setter
    def shaped_regions(self, arg0: ShapedRegions) -> None:
        ...
    @property
    def shaped_time_constant_s(self) -> float:
        """
        Time constant after shaped blocks, s; 0: no filter.
        """
    @shaped_time_constant_s.setter
    def shaped_time_constant_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def spindle_start_s(self) -> list[tuple[float, float]]:
        """
        Pairs of a spindle speed in 1/min and the time from rest to it in s.
        """
    @spindle_start_s.setter
    def spindle_start_s(self, arg1: collections.abc.Sequence[tuple[typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    @property
    def spindle_stop_s(self) -> list[tuple[float, float]]:
        """
        Pairs of a spindle speed in 1/min and the time from it to rest in s.
        """
    @spindle_stop_s.setter
    def spindle_stop_s(self, arg1: collections.abc.Sequence[tuple[typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        ...
    @property
    def time_constant_s(self) -> float:
        """
        Time constant after interpolation, s (1622).
        """
    @time_constant_s.setter
    def time_constant_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def tool_change_s(self) -> float:
        """
        M06, s.
        """
    @tool_change_s.setter
    def tool_change_s(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def unknown_move_s(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Per axis: time of a rapid whose start or end the program does not give, s, shape (3,).
        """
    @unknown_move_s.setter
    def unknown_move_s(self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        ...
class ServoLag:
    """
    Position loop of each axis as a first-order lag with feed-forward: x' = K (r - x) + a r'.
    """
    def __init__(self, position_gain_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], feed_forward_ratio: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], period_s: typing.SupportsFloat | typing.SupportsIndex) -> None:
        """
        At rest at zero. Raises ArgumentError on a period or gain <= 0 or a ratio outside 0 ... 1.
        """
    def reset(self, position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> None:
        """
        Rest at `position`, shape (3,).
        """
    def step(self, setpoint: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Position of the axes at the set-point's instant, shape (3,).
        """
    @property
    def error_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Set-point minus position, shape (3,), mm.
        """
class CircleFigures:
    """
    Effect of acceleration and servo lag on a circle.
    """
    @property
    def command_error_mm(self) -> float:
        """
        Programmed radius minus radius of the set-points after the filters, mm.
        """
    @property
    def radial_error_mm(self) -> float:
        """
        Programmed radius minus radius of the axes after the servo loop, mm.
        """
class BlockKind:
    """
    Kind of a row of CycleTime.blocks, which has it as a number.
    
    Members:
    
      cutting
    
      rapid
    
      dwell
    
      tool_change
    
      function
    """
    __members__: typing.ClassVar[dict[str, BlockKind]]
    cutting: typing.ClassVar[BlockKind]
    dwell: typing.ClassVar[BlockKind]
    function: typing.ClassVar[BlockKind]
    rapid: typing.ClassVar[BlockKind]
    tool_change: typing.ClassVar[BlockKind]
    @typing.overload
    def __eq__(self, other: BlockKind) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: BlockKind) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class ToolTime:
    """
    All uses of one tool.
    """
    @property
    def acceleration_s(self) -> float:
        """
        Time added to cutting blocks and rapids by acceleration and, in look-ahead, by its other limits, s.
        """
    @property
    def cutting_s(self) -> float:
        """
        Cutting blocks at their feed, s.
        """
    @property
    def dwell_s(self) -> float:
        """
        G04 and dwells of cycles, s.
        """
    @property
    def first_line(self) -> int:
        """
        Line of its first use, from 1.
        """
    @property
    def function_s(self) -> float:
        """
        Other M codes, start of the program, waits for the spindle, rapids of unknown length, s.
        """
    @property
    def in_position_s(self) -> float:
        """
        Waits after rapids and exact stops, s.
        """
    @property
    def rapid_s(self) -> float:
        """
        Rapids at their rate, s.
        """
    @property
    def tool(self) -> int:
        """
        T number; -1: before the first tool is known.
        """
    @property
    def tool_change_s(self) -> float:
        """
        M06, s.
        """
    @property
    def total_s(self) -> float:
        """
        Sum of all parts, s.
        """
class CycleTime:
    """
    Cycle time of a program.
    """
    @property
    def acceleration_s(self) -> float:
        """
        Time added to cutting blocks and rapids by acceleration and, in look-ahead, by its other limits, s.
        """
    @property
    def blocks(self) -> numpy.ndarray:
        """
        One row per block, structured and read-only: line, kind (a BlockKind number), start_s, duration_s, feed_mm_per_s reached; empty unless requested.
        """
    @property
    def cutting_length_mm(self) -> float:
        """
        mm.
        """
    @property
    def cutting_s(self) -> float:
        """
        Cutting blocks at their feed, s.
        """
    @property
    def dwell_s(self) -> float:
        """
        G04 and dwells of cycles, s.
        """
    @property
    def function_s(self) -> float:
        """
        Other M codes, start of the program, waits for the spindle, rapids of unknown length, s.
        """
    @property
    def in_position_s(self) -> float:
        """
        Waits after rapids and exact stops, s.
        """
    @property
    def outside_regions_s(self) -> float:
        """
        Whole time without cutting and acceleration of the regions, s.
        """
    @property
    def rapid_length_mm(self) -> float:
        """
        mm.
        """
    @property
    def rapid_s(self) -> float:
        """
        Rapids at their rate, s.
        """
    @property
    def regions(self) -> numpy.ndarray:
        """
        One row per region, structured and read-only: first_line, last_line, tool, start_s, duration_s and its parts cutting_s, acceleration_s and in_position_s, length_mm.
        """
    @property
    def tool_change_s(self) -> float:
        """
        M06, s.
        """
    @property
    def tools(self) -> list[ToolTime]:
        """
        ToolTime in the order of first use.
        """
    @property
    def total_s(self) -> float:
        """
        Sum of all parts, s.
        """
class InterpolatedTime:
    """
    Cycle time of a program by full interpolation.
    """
    @property
    def cutting_s(self) -> float:
        """
        Cutting blocks with their acceleration, s.
        """
    @property
    def dwell_s(self) -> float:
        """
        s.
        """
    @property
    def function_s(self) -> float:
        """
        As in CycleTime, s.
        """
    @property
    def in_position_s(self) -> float:
        """
        Waits after rapids and exact stops, s.
        """
    @property
    def rapid_s(self) -> float:
        """
        Rapids with their acceleration, s.
        """
    @property
    def region_s(self) -> list[float]:
        """
        Per region, wait included, s.
        """
    @property
    def set_points(self) -> int:
        """
        Number of set-points.
        """
    @property
    def tool_change_s(self) -> float:
        """
        s.
        """
    @property
    def total_s(self) -> float:
        """
        Sum of all parts, s.
        """
class SimulationChunk:
    """
    A section of a simulated motion, one row per period.
    """
    def __len__(self) -> int:
        ...
    @property
    def command_mm(self) -> numpy.ndarray:
        """
        Set-points after every filter, (k, 3), mm.
        """
    @property
    def first_sample(self) -> int:
        """
        Number of its first sample; time is number * period.
        """
    @property
    def friction_force_n(self) -> numpy.ndarray:
        """
        Feed drives: friction of the table, against its motion, (k, 3), N; without drives: (0, 0).
        """
    @property
    def kind(self) -> numpy.ndarray:
        """
        Value of its BlockKind, (k,).
        """
    @property
    def line(self) -> numpy.ndarray:
        """
        Line of the present block, (k,).
        """
    @property
    def motor_force_n(self) -> numpy.ndarray:
        """
        Feed drives: force of the motor, (k, 3), N; without drives: (0, 0).
        """
    @property
    def motor_mm(self) -> numpy.ndarray:
        """
        Feed drives: motor as travel of the table, (k, 3), mm; without drives: (0, 0).
        """
    @property
    def response_mm(self) -> numpy.ndarray:
        """
        (k, 3), mm.
        """
    @property
    def velocity_mm_per_s(self) -> numpy.ndarray:
        """
        Of the command over the period that ends with the row, without the jumps of coordinates, (k, 3), mm/s.
        """
class SimulationStream:
    """
    Simulates a motion through filters and plant and returns it in pieces.
    """
    @staticmethod
    def of_blocks(blocks: Path, block_end: BlockEnd, override_ratio: typing.SupportsFloat | typing.SupportsIndex, options: SimulationOptions, rest_s: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> SimulationStream:
        """
        Blocks at their feed; after their end the set-points rest for `rest_s`.
        """
    @staticmethod
    def of_path(path: Path, profile: SpeedProfile, options: SimulationOptions, rest_s: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> SimulationStream:
        """
        A path under a speed profile; after its end the set-points rest for `rest_s`.
        """
    @staticmethod
    def of_program(program: ProgramText, model: FanucModel, options: SimulationOptions, region_offsets_mm: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]] = [], rest_s: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> SimulationStream:
        """
        A whole program on one time axis. `region_offsets_mm`: from the positions of each region to machine positions, for modes that vary with them. Raises ArgumentError on an invalid model, options with another period, or not one offset per region.
        """
    def read(self, most: typing.SupportsInt | typing.SupportsIndex) -> SimulationChunk:
        """
        Returns the next rows, at most `most`; none after the end.
        """
class SpindleSense:
    """
    Direction of spindle rotation, seen towards the workpiece.
    
    Members:
    
      clockwise : M03.
    
      counter_clockwise : M04.
    """
    __members__: typing.ClassVar[dict[str, SpindleSense]]
    clockwise: typing.ClassVar[SpindleSense]
    counter_clockwise: typing.ClassVar[SpindleSense]
    @typing.overload
    def __eq__(self, other: SpindleSense) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: SpindleSense) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class EndMill:
    """
    A cylindrical end mill with a flat end.
    """
    def __init__(self, diameter_mm: typing.SupportsFloat | typing.SupportsIndex, flutes: typing.SupportsInt | typing.SupportsIndex, helix_rad: typing.SupportsFloat | typing.SupportsIndex = 0.0, runout_mm: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex] = []) -> None:
        """
        `helix_rad`: helix angle of a right-hand cutter; `runout_mm`: radius of each flute less the mean radius, in the order in which they cut. Raises ArgumentError on a value outside its range.
        """
    @property
    def diameter_mm(self) -> float:
        """
        mm.
        """
    @property
    def flutes(self) -> int:
        """
        Number of flutes.
        """
    @property
    def helix_rad(self) -> float:
        """
        rad.
        """
    @property
    def radius_mm(self) -> float:
        """
        mm.
        """
    @property
    def runout_mm(self) -> list[float]:
        """
        One per flute, or none, mm.
        """
class EngagementTrack:
    """
    Engagement of the tool along a path, sample by sample. Azimuths in rad from the direction of feed, positive to its left; with a clockwise spindle a tooth passes from +pi/2 (up milling) to -pi/2 (down milling).
    """
    def __len__(self) -> int:
        ...
    def arcs_of(self, sample: typing.SupportsInt | typing.SupportsIndex) -> numpy.ndarray:
        """
        The rows of `arcs` that belong to a sample, (k, 4).
        """
    @property
    def arcs(self) -> numpy.ndarray:
        """
        Engaged sections of the circumference, (m, 4): from and to azimuth, rad, bottom and top above the tip, mm.
        """
    @property
    def direction_rad(self) -> numpy.ndarray:
        """
        Direction of feed in the XY plane, from +X, (n,), rad; 0 where the tool only plunges.
        """
    @property
    def first_arc(self) -> numpy.ndarray:
        """
        Index of each sample's first row of `arcs`, (n + 1,).
        """
    @property
    def horizontal(self) -> numpy.ndarray:
        """
        Component of the travel in the XY plane, (n,): 1 level, 0 a plunge.
        """
    @property
    def plunged_mm2(self) -> numpy.ndarray:
        """
        Area of material below the end of a descending tool, (n,), mm2.
        """
    @property
    def radial_depth_mm(self) -> numpy.ndarray:
        """
        Width of cut, perpendicular to the feed, (n,), mm.
        """
    @property
    def s_mm(self) -> numpy.ndarray:
        """
        Distance along the path, (n,), mm.
        """
    @property
    def section_mm2(self) -> numpy.ndarray:
        """
        Area of cut, perpendicular to the feed, (n,), mm2; times feed: material removal rate.
        """
    @property
    def segment(self) -> numpy.ndarray:
        """
        Index of the path's segment, (n,).
        """
    @property
    def x_mm(self) -> numpy.ndarray:
        """
        Of the tool's axis, (n,), mm.
        """
    @property
    def y_mm(self) -> numpy.ndarray:
        """
        Of the tool's axis, (n,), mm.
        """
class Material:
    """
    A workpiece of horizontal layers, each represented by the distance from its boundary on a grid.
    """
    def __init__(self, rings_mm: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]], borders_mm: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], resolution_mm: typing.SupportsFloat | typing.SupportsIndex, memory_limit_bytes: typing.SupportsInt | typing.SupportsIndex = 2147483648) -> None:
        """
        `rings_mm`: outlines of the stock, each (n, 2), holes included (even-odd rule); `borders_mm`: heights between the layers from bottom to top (see layer_borders); `resolution_mm`: grid spacing (a hundredth of the tool's diameter is a good choice). Raises ArgumentError on an outline or heights that enclose nothing, or a grid that needs more memory than the limit.
        """
    def __len__(self) -> int:
        ...
    def compact(self) -> None:
        """
        Frees the memory of tiles that have become uniform.
        """
    def copy(self) -> Material:
        """
        An independent copy of the material in its present state.
        """
    def distance_mm(self, layer: typing.SupportsInt | typing.SupportsIndex, x_mm: typing.SupportsFloat | typing.SupportsIndex, y_mm: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Distance from the boundary of a layer, positive in material, limited to twice the grid spacing, mm.
        """
    def heights_mm(self, low_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"], high_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"], rows: typing.SupportsInt | typing.SupportsIndex, columns: typing.SupportsInt | typing.SupportsIndex) -> numpy.ndarray:
        """
        Top of the material over a rectangle, rows along Y, columns along X, mm, from its low corner on; NaN where there is none. Raises ArgumentError on less than one row or column.
        """
    def is_material(self, x_mm: typing.SupportsFloat | typing.SupportsIndex, y_mm: typing.SupportsFloat | typing.SupportsIndex, z_mm: typing.SupportsFloat | typing.SupportsIndex) -> bool:
        """
        Whether there is material at a point.
        """
    def take_whole_layers(self) -> None:
        """
        From now on removes a layer only if the tip reaches its bottom. The remaining material is then never underestimated, also under a ramp.
        """
    def volume_in_cylinder_mm3(self, x_mm: typing.SupportsFloat | typing.SupportsIndex, y_mm: typing.SupportsFloat | typing.SupportsIndex, radius_mm: typing.SupportsFloat | typing.SupportsIndex, bottom_mm: typing.SupportsFloat | typing.SupportsIndex, top_mm: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Material in a vertical cylinder, mm3, such as a tool at its start position.
        """
    @property
    def borders_mm(self) -> list[float]:
        """
        Heights between the layers, ascending, mm.
        """
    @property
    def bottom_mm(self) -> float:
        """
        Bottom of the stock, mm.
        """
    @property
    def bytes(self) -> int:
        """
        Memory in use.
        """
    @property
    def high_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        High corner of the original stock, (2,), mm.
        """
    @property
    def low_mm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        Low corner of the original stock, (2,), mm.
        """
    @property
    def resolution_mm(self) -> float:
        """
        Grid spacing, mm.
        """
    @property
    def top_mm(self) -> float:
        """
        Top of the original stock, mm.
        """
    @property
    def volume_mm3(self) -> float:
        """
        Remaining volume, mm3.
        """
class CornerSection:
    """
    Sections S1 to S4 of paper 001.
    
    Members:
    
      s1 : Straight, the tool enters at the straight rough wall.
    
      s2 : Straight, the tool enters in the rough corner.
    
      s3 : On the arc of the finished corner.
    
      s4 : On the straight after it.
    """
    __members__: typing.ClassVar[dict[str, CornerSection]]
    s1: typing.ClassVar[CornerSection]
    s2: typing.ClassVar[CornerSection]
    s3: typing.ClassVar[CornerSection]
    s4: typing.ClassVar[CornerSection]
    @typing.overload
    def __eq__(self, other: CornerSection) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: CornerSection) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class CornerEngagement:
    """
    Engagement of the tool at one position of a corner.
    """
    @property
    def direction_rad(self) -> float:
        """
        Direction of feed, from +X, rad.
        """
    @property
    def from_rad(self) -> float:
        """
        Engaged azimuths, from the direction of feed, rad.
        """
    @property
    def radial_depth_mm(self) -> float:
        """
        Width of cut: from the end of the engagement on the rough boundary to the finished wall's tangent at the contact, mm.
        """
    @property
    def section(self) -> CornerSection:
        """
        Section of the path.
        """
    @property
    def to_rad(self) -> float:
        """
        rad.
        """
    @property
    def turned_rad(self) -> float:
        """
        Angle turned on the tool centre's arc so far, rad.
        """
    @property
    def x_mm(self) -> float:
        """
        Of the tool's axis, mm.
        """
    @property
    def y_mm(self) -> float:
        """
        Of the tool's axis, mm.
        """
class CornerCut:
    """
    The corner of a pocket that is finished after roughing (paper 001).
    """
    def __init__(self, tool_radius_mm: typing.SupportsFloat | typing.SupportsIndex, rough_radius_mm: typing.SupportsFloat | typing.SupportsIndex, finish_radius_mm: typing.SupportsFloat | typing.SupportsIndex, allowance_mm: typing.SupportsFloat | typing.SupportsIndex, turn_rad: typing.SupportsFloat | typing.SupportsIndex = 1.5707963267948966, before_mm: typing.SupportsFloat | typing.SupportsIndex = 10.0, after_mm: typing.SupportsFloat | typing.SupportsIndex = 10.0, mirrored: bool = False) -> None:
        """
        The tool moves along +X with the wall to its right, turns left by `turn_rad` and follows the second wall; the finished walls meet at the origin. `mirrored`: wall to the left. Equal tool and finish radius: the path has a sharp vertex. Raises ArgumentError on corner radii below the tool's, an allowance above the radius of the tool, or a rough corner that leaves no material.
        """
    def at(self, s_mm: typing.SupportsFloat | typing.SupportsIndex, behind_vertex: bool = False) -> CornerEngagement:
        """
        Engagement at a distance along the path, in closed form; `behind_vertex`: at a sharp vertex, after the turn.
        """
    def path(self, feed_mm_per_s: typing.SupportsFloat | typing.SupportsIndex, z_mm: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> Path:
        """
        The tool's path: line, arc if the radii differ, line.
        """
    def stock(self, beyond_mm: typing.SupportsFloat | typing.SupportsIndex) -> numpy.ndarray:
        """
        The material before finishing as a ring (n, 2), mm, to `beyond_mm` outside of the walls.
        """
    def track(self, axial_depth_mm: typing.SupportsFloat | typing.SupportsIndex, step_mm: typing.SupportsFloat | typing.SupportsIndex) -> EngagementTrack:
        """
        The closed form as a track with samples at most `step_mm` apart; at a sharp vertex two share one position.
        """
    @property
    def after_mm(self) -> float:
        """
        Straight path after the corner, mm.
        """
    @property
    def allowance_mm(self) -> float:
        """
        Allowance left on both walls by roughing, mm.
        """
    @property
    def before_mm(self) -> float:
        """
        Straight path before the corner, mm.
        """
    @property
    def finish_radius_mm(self) -> float:
        """
        Radius of the corner to be made, mm.
        """
    @property
    def length_mm(self) -> float:
        """
        Length of the tool's path, mm.
        """
    @property
    def mirrored(self) -> bool:
        """
        The wall is to the left.
        """
    @property
    def rough_radius_mm(self) -> float:
        """
        Radius of the corner after roughing, mm.
        """
    @property
    def tool_radius_mm(self) -> float:
        """
        mm.
        """
    @property
    def turn_rad(self) -> float:
        """
        Turning angle of the path, rad.
        """
class ChipThickness:
    """
    Chip thickness used in the specific cutting force.
    
    Members:
    
      mean : Of the whole engagement, as paper 001 fits its coefficients.
    
      local : Of each element of a flute.
    """
    __members__: typing.ClassVar[dict[str, ChipThickness]]
    local: typing.ClassVar[ChipThickness]
    mean: typing.ClassVar[ChipThickness]
    @typing.overload
    def __eq__(self, other: ChipThickness) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: ChipThickness) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class CuttingCoefficients:
    """
    Power laws of the cutting force (paper 001 eq. 2, 3, 8, 9), with edge forces.
    
    Per mm of a flute's height, t being the chip thickness in mm: tangential k1 t + K_te, radial k2 k1 t + K_re in N/mm,
    with k1 = specific_n_per_mm2 * t**specific_exponent, k2 = ratio * t**ratio_exponent.
    """
    def __init__(self, specific_n_per_mm2: typing.SupportsFloat | typing.SupportsIndex, specific_exponent: typing.SupportsFloat | typing.SupportsIndex = 0.0, ratio: typing.SupportsFloat | typing.SupportsIndex = 0.0, ratio_exponent: typing.SupportsFloat | typing.SupportsIndex = 0.0, tangential_edge_n_per_mm: typing.SupportsFloat | typing.SupportsIndex = 0.0, radial_edge_n_per_mm: typing.SupportsFloat | typing.SupportsIndex = 0.0, thickness: ChipThickness = ChipThickness.mean) -> None:
        """
        Raises ArgumentError on a value that is not finite, a force or ratio below 0, or an exponent (tangential, or sum of both) of -1 or less.
        """
    @property
    def radial_edge_n_per_mm(self) -> float:
        """
        K_re, N/mm.
        """
    @property
    def ratio(self) -> float:
        """
        k2 at a chip of 1 mm.
        """
    @property
    def ratio_exponent(self) -> float:
        """
        Of k2.
        """
    @property
    def specific_exponent(self) -> float:
        """
        Of k1.
        """
    @property
    def specific_n_per_mm2(self) -> float:
        """
        k1 at a chip of 1 mm, N/mm2.
        """
    @property
    def tangential_edge_n_per_mm(self) -> float:
        """
        K_te, N/mm.
        """
    @property
    def thickness(self) -> ChipThickness:
        """
        Mean or local.
        """
class ToolBeam:
    """
    An end mill as a beam clamped at its overhang: shank, and a fluted part that is as stiff as a round bar of an effective diameter. Heights count from the tip.
    """
    def __init__(self, overhang_mm: typing.SupportsFloat | typing.SupportsIndex, fluted_length_mm: typing.SupportsFloat | typing.SupportsIndex, effective_diameter_mm: typing.SupportsFloat | typing.SupportsIndex, shank_diameter_mm: typing.SupportsFloat | typing.SupportsIndex, young_modulus_gpa: typing.SupportsFloat | typing.SupportsIndex, holder_n_per_um: typing.SupportsFloat | typing.SupportsIndex = ..., spindle_n_per_um: typing.SupportsFloat | typing.SupportsIndex = ...) -> None:
        """
        Lengths and diameters in mm, modulus in GPa, springs between the clamped end and the frame in N/um (inf: rigid). Raises ArgumentError on a value that is not positive.
        """
    def compliance_um_per_n(self, at_mm: typing.SupportsFloat | typing.SupportsIndex, load_mm: typing.SupportsFloat | typing.SupportsIndex) -> float:
        """
        Deflection at one height under 1 N across the axis at another, um/N (both count from the tip).
        """
    @property
    def effective_diameter_mm(self) -> float:
        """
        Of the fluted part, mm.
        """
    @property
    def fluted_length_mm(self) -> float:
        """
        From the tip, mm.
        """
    @property
    def holder_n_per_um(self) -> float:
        """
        N/um.
        """
    @property
    def overhang_mm(self) -> float:
        """
        Tip to clamped end, mm.
        """
    @property
    def shank_diameter_mm(self) -> float:
        """
        mm.
        """
    @property
    def spindle_n_per_um(self) -> float:
        """
        N/um.
        """
    @property
    def young_modulus_gpa(self) -> float:
        """
        GPa.
        """
class ForceFigures:
    """
    Figures over one revolution; forces on the tool, x along the feed and y to its left.
    """
    @property
    def mean_n(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        Mean of the vector, (2,), N.
        """
    @property
    def mean_power_w(self) -> float:
        """
        Mean torque times angular speed, W.
        """
    @property
    def mean_resultant_n(self) -> float:
        """
        Mean of the magnitude, N.
        """
    @property
    def mean_torque_nm(self) -> float:
        """
        N m.
        """
    @property
    def peak_chip_mm(self) -> float:
        """
        Thickest chip, mm.
        """
    @property
    def peak_flute_n(self) -> float:
        """
        Largest magnitude on a single flute, N.
        """
    @property
    def peak_resultant_n(self) -> float:
        """
        Largest magnitude, N.
        """
    @property
    def peak_torque_nm(self) -> float:
        """
        N m.
        """
class ForceCurve:
    """
    Forces on the tool over one revolution, in the frame of the tool.
    """
    @property
    def flute_n(self) -> list[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 2]"]]:
        """
        Of each flute, (n_angles, 2), N.
        """
    @property
    def force_n(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 2]"]:
        """
        (n_angles, 2), N.
        """
    @property
    def torque_nm(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        (n_angles,), N m.
        """
    @property
    def turned_rad(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Spindle angle in its direction of rotation, rad, (n_angles,); at 0 the first flute's tip points along the feed.
        """
class MillingForce:
    """
    Forces of an end mill at one engagement; reuse one object, which stores tables.
    
    The chip at azimuth p is feed per tooth * cos p thick (paper 001 eq. 1); with runout that of flute i is the minimum of
    m * feed per tooth * cos p + r_i - r_(i-m), m >= 1, and not below 0. A counter-clockwise spindle mirrors everything,
    helix included. `arcs`: (n_arcs, 4): from and to in rad from the direction of feed, positive to its left, bottom and top
    in mm above the tip. `feed_mm_per_min`: along the path. Not thread-safe.
    
    Raises:
        ArgumentError: A speed that is not positive; in all members also an arc beyond -pi/2 ... pi/2 or below the tip, or a
            feed that is negative or not finite.
    """
    def __init__(self, tool: EndMill, coefficients: CuttingCoefficients, spindle_rev_per_min: typing.SupportsFloat | typing.SupportsIndex, sense: SpindleSense = SpindleSense.clockwise) -> None:
        """
        Spindle speed in 1/min. Raises ArgumentError unless it is positive.
        """
    def curve(self, arcs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], feed_mm_per_min: typing.SupportsFloat | typing.SupportsIndex, angles: typing.SupportsInt | typing.SupportsIndex = 360) -> ForceCurve:
        """
        Forces at equal steps of the spindle. Raises ArgumentError on angles < 1.
        """
    def deflection_um(self, arcs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], feed_mm_per_min: typing.SupportsFloat | typing.SupportsIndex, turned_rad: typing.SupportsFloat | typing.SupportsIndex, height_mm: typing.SupportsFloat | typing.SupportsIndex, beam: ToolBeam) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        Deflection at a height above the tip and an angle of the spindle (as in ForceCurve), (2,), um, frame of the tool.
        """
    def figures(self, arcs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], feed_mm_per_min: typing.SupportsFloat | typing.SupportsIndex) -> ForceFigures:
        """
        Figures over one revolution: means exact, peaks and mean of the magnitude to 0.1 %; zeros without engagement.
        """
    def figures_of(self, track: EngagementTrack, feed_mm_per_min: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], beam: ToolBeam | None = None) -> dict:
        """
        Figures of a whole track, a feed along the path for each sample.
        
        Returns:
            Arrays (n_samples,) by name: mean_x_n, mean_y_n (frame of the tool), mean_resultant_n, peak_resultant_n,
            peak_torque_nm, mean_torque_nm, mean_power_w, peak_chip_mm, peak_deflection_um (of the tip; 0 without a beam).
        
        Raises:
            ArgumentError: Another number of feeds, or as the class.
        """
    def force_centre_mm(self, arcs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], feed_mm_per_min: typing.SupportsFloat | typing.SupportsIndex, turned_rad: typing.SupportsFloat | typing.SupportsIndex, overhang_mm: typing.SupportsFloat | typing.SupportsIndex) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
        """
        Centre of the force along x and along y (paper 001 eq. 6), distance from the clamped end, (2,), mm; NaN where that force is 0.
        """
    def peak_deflection_um(self, arcs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], feed_mm_per_min: typing.SupportsFloat | typing.SupportsIndex, beam: ToolBeam) -> float:
        """
        Largest deflection of the tip over one revolution, um, quasi-static. Raises ArgumentError also where the engagement lies above the overhang.
        """
    @property
    def coefficients(self) -> CuttingCoefficients:
        """
        The power laws.
        """
    @property
    def sense(self) -> SpindleSense:
        """
        M03 or M04.
        """
    @property
    def spindle_rev_per_min(self) -> float:
        """
        1/min.
        """
    @property
    def tool(self) -> EndMill:
        """
        The cutter.
        """
class FeedLimit:
    """
    The limit that determines a feed.
    
    Members:
    
      none : The highest requested feed is within all limits.
    
      resultant : Resultant force, mean or peak.
    
      deflection : Peak deflection of the tip.
    
      torque : Peak torque.
    
      power : Mean power.
    
      chip_load : Feed per tooth or thickest chip.
    """
    __members__: typing.ClassVar[dict[str, FeedLimit]]
    chip_load: typing.ClassVar[FeedLimit]
    deflection: typing.ClassVar[FeedLimit]
    none: typing.ClassVar[FeedLimit]
    power: typing.ClassVar[FeedLimit]
    resultant: typing.ClassVar[FeedLimit]
    torque: typing.ClassVar[FeedLimit]
    @typing.overload
    def __eq__(self, other: FeedLimit) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: FeedLimit) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class FeedLimits:
    """
    Limits of a feed over one revolution of the spindle; inf: no limit.
    """
    def __init__(self, *, mean_resultant_n: typing.SupportsFloat | typing.SupportsIndex = ..., peak_resultant_n: typing.SupportsFloat | typing.SupportsIndex = ..., peak_deflection_um: typing.SupportsFloat | typing.SupportsIndex = ..., peak_torque_nm: typing.SupportsFloat | typing.SupportsIndex = ..., mean_power_w: typing.SupportsFloat | typing.SupportsIndex = ..., feed_per_tooth_mm: typing.SupportsFloat | typing.SupportsIndex = ..., peak_chip_mm: typing.SupportsFloat | typing.SupportsIndex = ..., beam: ToolBeam | None = None) -> None:
        """
        Raises ArgumentError on a limit that is not positive, or a limit of deflection without a beam.
        """
    @property
    def beam(self) -> ToolBeam | None:
        """
        The tool as a beam, or None.
        """
    @property
    def feed_per_tooth_mm(self) -> float:
        """
        mm.
        """
    @property
    def mean_power_w(self) -> float:
        """
        W.
        """
    @property
    def mean_resultant_n(self) -> float:
        """
        Mean of the magnitude of the XY force, N.
        """
    @property
    def peak_chip_mm(self) -> float:
        """
        Thickest chip, mm.
        """
    @property
    def peak_deflection_um(self) -> float:
        """
        Of the tip, um.
        """
    @property
    def peak_resultant_n(self) -> float:
        """
        Largest magnitude, N.
        """
    @property
    def peak_torque_nm(self) -> float:
        """
        N m.
        """
class LimitedFeed:
    """
    A feed, and the limit that determines it.
    """
    @property
    def feed_mm_per_min(self) -> float:
        """
        mm/min.
        """
    @property
    def limit(self) -> FeedLimit:
        """
        The limit that is reached first.
        """
    @property
    def within(self) -> bool:
        """
        False: this is the lowest feed, and it exceeds the limit.
        """
class WallSide:
    """
    The wall that a tool finishes beside its path, seen along the feed.
    
    Members:
    
      right : Down milling with a clockwise spindle.
    
      left : Up milling with a clockwise spindle.
    """
    __members__: typing.ClassVar[dict[str, WallSide]]
    left: typing.ClassVar[WallSide]
    right: typing.ClassVar[WallSide]
    @typing.overload
    def __eq__(self, other: WallSide) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: WallSide) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class FeedStretch:
    """
    A section of one feed.
    """
    def __init__(self, begin_mm: typing.SupportsFloat | typing.SupportsIndex, end_mm: typing.SupportsFloat | typing.SupportsIndex, feed_mm_per_min: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def begin_mm(self) -> float:
        """
        Along the path, mm.
        """
    @property
    def end_mm(self) -> float:
        """
        Along the path, mm.
        """
    @property
    def feed_mm_per_min(self) -> float:
        """
        mm/min.
        """
class FeedWriterOptions:
    """
    How new feeds are written into a region's blocks.
    """
    def __init__(self, increment_mm: typing.SupportsFloat | typing.SupportsIndex, unit_mm: typing.SupportsFloat | typing.SupportsIndex, position_decimals: typing.SupportsInt | typing.SupportsIndex, absolute_centres: bool, modal_feed: typing.SupportsFloat | typing.SupportsIndex = 0.0, restore_feed: bool = True) -> None:
        """
        `increment_mm`: least increment; `unit_mm`: unit of position words and of the length in F; `position_decimals`: of a position word; `absolute_centres`: I J K are positions; `modal_feed`: F in effect before the region (0: as in the original); `restore_feed`: restore the modal feed of the original at the end.
        """
class RefedRegion:
    """
    A region's text with other feeds.
    """
    @property
    def blocks(self) -> int:
        """
        Blocks with a cutting move.
        """
    @property
    def lines(self) -> list[int]:
        """
        Per block its line, counted from 0 for the first of the text.
        """
    @property
    def modal_feed(self) -> float:
        """
        F in effect after it.
        """
    @property
    def text(self) -> bytes:
        """
        Whole lines.
        """
class Travel:
    """
    Actual speeds along a path, per section from one station to the next.
    """
    @property
    def duration_s(self) -> float:
        """
        Time until the set-points rest, s.
        """
    @property
    def highest_mm_per_s(self) -> numpy.ndarray:
        """
        Largest distance within a window, divided by the window, (n,), mm/s. Except in plunges, only travel in XY in the present direction counts, converted to travel along the path.
        """
    @property
    def time_s(self) -> numpy.ndarray:
        """
        Time on each section, (n,), s.
        """
class ComparedKind:
    """
    Kinds of program contents compared, and of differences.
    
    Members:
    
      cuts
    
      rapids
    
      tools
    
      spindle
    
      coolant
    
      offsets
    
      cycles
    
      calls
    
      functions
    
      dwells
    
      stops
    
      modal
    
      feeds
    
      blocks
    
      path
    
      order
    
      shaped_rapids
    
      emission
    
      units
    
      end
    """
    __members__: typing.ClassVar[dict[str, ComparedKind]]
    blocks: typing.ClassVar[ComparedKind]
    calls: typing.ClassVar[ComparedKind]
    coolant: typing.ClassVar[ComparedKind]
    cuts: typing.ClassVar[ComparedKind]
    cycles: typing.ClassVar[ComparedKind]
    dwells: typing.ClassVar[ComparedKind]
    emission: typing.ClassVar[ComparedKind]
    end: typing.ClassVar[ComparedKind]
    feeds: typing.ClassVar[ComparedKind]
    functions: typing.ClassVar[ComparedKind]
    modal: typing.ClassVar[ComparedKind]
    offsets: typing.ClassVar[ComparedKind]
    order: typing.ClassVar[ComparedKind]
    path: typing.ClassVar[ComparedKind]
    rapids: typing.ClassVar[ComparedKind]
    shaped_rapids: typing.ClassVar[ComparedKind]
    spindle: typing.ClassVar[ComparedKind]
    stops: typing.ClassVar[ComparedKind]
    tools: typing.ClassVar[ComparedKind]
    units: typing.ClassVar[ComparedKind]
    @typing.overload
    def __eq__(self, other: ComparedKind) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: ComparedKind) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class ProgramComparison:
    """
    What differs between two programs.
    """
    @property
    def counts(self) -> list:
        """
        For each kind: (ComparedKind, number in the original, in the emitted program, unchanged).
        """
    @property
    def differences(self) -> list:
        """
        For each difference: (ComparedKind, line of the original, line of the emitted program, contents of the original, of the emitted program, distance of the paths in mm); line 0: the program has nothing there.
        """
    @property
    def path_mm(self) -> float:
        """
        Largest distance between the paths of a cut in both programs, in either direction, mm.
        """
class ExpandedProgram:
    """
    A program for another control, in FANUC's words.
    """
    @property
    def files(self) -> list[str]:
        """
        Names of other files whose lines are in it.
        """
    @property
    def line_files(self) -> list[int]:
        """
        For each line its file: 0 the source, n the n-th of `files`; empty: all of the source.
        """
    @property
    def lines(self) -> list[int]:
        """
        For each line of the text the line of the source, from 1.
        """
    @property
    def notes(self) -> list[tuple[int, str]]:
        """
        Line of the source and text of each note, ascending by line.
        """
    @property
    def text(self) -> bytes:
        """
        The program between lines `%`.
        """
class LinuxcncToolTable:
    """
    LinuxCNC's tool table: the tools by number.
    """
    def __init__(self, file: str, unit: str, unit_mm: typing.SupportsFloat | typing.SupportsIndex, tools: collections.abc.Mapping[typing.SupportsInt | typing.SupportsIndex, tuple[typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"], typing.SupportsFloat | typing.SupportsIndex]]) -> None:
        """
        `tools`: by number the offsets of X, Y, Z and the diameter, mm.
        """
class LinuxcncOptions:
    """
    Settings of the machine for reading a LinuxCNC program.
    """
    def __init__(self) -> None:
        ...
    @property
    def adds_points(self) -> bool:
        """
        Whether whole numbers need a decimal point in the expanded program.
        """
    @adds_points.setter
    def adds_points(self, arg0: bool) -> None:
        ...
    @property
    def block_skip(self) -> bool | None:
        """
        Switch of /: on, off; None: not known, taken as off.
        """
    @block_skip.setter
    def block_skip(self, arg0: bool | None) -> None:
        ...
    @property
    def file(self) -> str:
        """
        Name of the program in messages.
        """
    @file.setter
    def file(self, arg0: str) -> None:
        ...
    @property
    def find_subroutine(self) -> bool:
        """
        Called with the name of a subroutine that the program does not contain; returns (name, bytes) or None.
        """
    @find_subroutine.setter
    def find_subroutine(self, arg1: typing.Any) -> None:
        ...
    @property
    def first_codes(self) -> str:
        """
        Codes to be put before the program: LinuxCNC's initial modes where the machine's differ.
        """
    @first_codes.setter
    def first_codes(self, arg0: str) -> None:
        ...
    @property
    def inch(self) -> bool:
        """
        Whether inch is the unit at the first line.
        """
    @inch.setter
    def inch(self, arg0: bool) -> None:
        ...
    @property
    def machine_unit_mm(self) -> float:
        """
        Length of the machine's own unit.
        """
    @machine_unit_mm.setter
    def machine_unit_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def max_expansion_bytes(self) -> int:
        """
        Bytes by which the expanded program may be larger than the program.
        """
    @max_expansion_bytes.setter
    def max_expansion_bytes(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def max_steps(self) -> int:
        """
        Lines executed at most, beyond one for each line.
        """
    @max_steps.setter
    def max_steps(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def tool_length_mm(self) -> dict[int, float]:
        """
        By H number; they override the table.
        """
    @tool_length_mm.setter
    def tool_length_mm(self, arg0: collections.abc.Mapping[typing.SupportsInt | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex]) -> None:
        ...
    @property
    def tool_table(self) -> LinuxcncToolTable | None:
        """
        The tool table; None: there is none.
        """
    @tool_table.setter
    def tool_table(self, arg0: LinuxcncToolTable | None) -> None:
        ...
    @property
    def work_offset(self) -> int:
        """
        Work offset at the first line, 1 ... 9: G54 ... G59.3.
        """
    @work_offset.setter
    def work_offset(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def work_offsets_mm(self) -> dict[int, typing.Annotated[list[float], "FixedSize(3)"]]:
        """
        By work offset, 1 ... 9.
        """
    @work_offsets_mm.setter
    def work_offsets_mm(self, arg0: collections.abc.Mapping[typing.SupportsInt | typing.SupportsIndex, typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"]]) -> None:
        ...
class LinuxcncProgram:
    """
    A LinuxCNC program in FANUC's words.
    """
    @property
    def expanded(self) -> ExpandedProgram:
        """
        The program in FANUC's words.
        """
    @property
    def path_tolerance_mm(self) -> tuple[float | None, float | None] | None:
        """
        P and Q common to all its G64, mm, None for a word that is left out; None: there are several, or no G64.
        """
class SiemensOptions:
    """
    Settings for reading a SINUMERIK program.
    """
    def __init__(self) -> None:
        ...
    @property
    def arc_radius_tolerance_mm(self) -> float:
        """
        Permitted difference of start and end radius of an arc, mm.
        """
    @arc_radius_tolerance_mm.setter
    def arc_radius_tolerance_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def block_skip(self) -> bool | None:
        """
        Whether `/` blocks are skipped; None: refused.
        """
    @block_skip.setter
    def block_skip(self, arg0: bool | None) -> None:
        ...
    @property
    def called(self) -> bool:
        """
        Called with the name of a program in capitals; returns (name, bytes in UTF-8) or None.
        """
    @called.setter
    def called(self, arg1: typing.Any) -> None:
        ...
    @property
    def file(self) -> str:
        """
        Name of the program's file in messages.
        """
    @file.setter
    def file(self, arg0: str) -> None:
        ...
    @property
    def least_increment_mm(self) -> float:
        """
        Of the expanded program, mm.
        """
    @least_increment_mm.setter
    def least_increment_mm(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def left_out(self) -> dict[str, str]:
        """
        Words that are left out, each with its note.
        """
    @left_out.setter
    def left_out(self, arg0: collections.abc.Mapping[str, str]) -> None:
        ...
    @property
    def left_out_addresses(self) -> dict[str, str]:
        """
        Addresses, likewise.
        """
    @left_out_addresses.setter
    def left_out_addresses(self, arg0: collections.abc.Mapping[str, str]) -> None:
        ...
    @property
    def max_expansion_moves(self) -> int:
        """
        Maximum number of moves, likewise.
        """
    @max_expansion_moves.setter
    def max_expansion_moves(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def max_program_steps(self) -> int:
        """
        Maximum number of blocks executed, beyond one for each line.
        """
    @max_program_steps.setter
    def max_program_steps(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    @property
    def name(self) -> str:
        """
        Name of a program without a header %_N_NAME_MPF, in capitals.
        """
    @name.setter
    def name(self, arg0: str) -> None:
        ...
    @property
    def refused(self) -> collections.abc.Callable[[str], str]:
        """
        Called with a word; returns why it is refused, empty if not known.
        """
    @refused.setter
    def refused(self, arg0: collections.abc.Callable[[str], str]) -> None:
        ...
    @property
    def tool_change_unknown_axes(self) -> str:
        """
        Axes of "XYZ" whose position is not known after M6.
        """
    @tool_change_unknown_axes.setter
    def tool_change_unknown_axes(self, arg0: str) -> None:
        ...
    @property
    def work_offsets(self) -> dict[str, typing.Annotated[list[float], "FixedSize(3)"]]:
        """
        By name ("G54", "G54.1P5"), mm.
        """
    @work_offsets.setter
    def work_offsets(self, arg0: collections.abc.Mapping[str, typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"]]) -> None:
        ...
class SiemensProgram:
    """
    A SINUMERIK program in FANUC's words.
    """
    @property
    def expanded(self) -> ExpandedProgram:
        """
        The program in FANUC's words.
        """
    @property
    def names(self) -> list[tuple[str, str]]:
        """
        Pairs of a word and the word of the source that it replaces.
        """
def acceleration_filters(model: FanucModel) -> list[Fir]:
    """
    Filters after interpolation in order: none, one or two.
    """
def arma_decay(responses: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]], n_modes: typing.SupportsInt | typing.SupportsIndex, plain: bool = False) -> Arma:
    """
    ARMA model of one or several free decays: common poles, a separate initial state for each record.
    
    Args:
        responses: Response per decay, each of shape (n,), in any unit.
        n_modes: Number of modes, 1 to 50.
        plain: One round of unfiltered least squares instead of the iteration.
    
    Returns:
        The model, as from arma_driven with a unit impulse at the first sample as force.
    
    Raises:
        ArgumentError: As arma_driven.
        NumericError: No finite coefficients.
    
    Source: K. Steiglitz, L. McBride 1965; paper 003, eq. 1.
    """
def arma_driven(forces: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]], responses: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]], n_modes: typing.SupportsInt | typing.SupportsIndex, plain: bool = False) -> Arma:
    """
    ARMA model of one or several impacts at the same point, by iterated least squares.
    
    Args:
        forces: Force per impact in N, each of shape (n,); the structure is at rest at the first sample.
        responses: Response per impact at the same instants, each of shape (n,); poles and numerator are common.
        n_modes: Number of modes, 1 to 50; the model has 2*n_modes poles and 2*n_modes+1 numerator terms.
        plain: One round of unfiltered least squares instead of the iteration; noise biases its poles.
    
    Returns:
        The model whose phi converged, or the best of all rounds with converged False.
    
    Raises:
        ArgumentError: No record, unequal lengths, a value that is not finite, a force that is zero throughout, a number
            of modes outside its range, or fewer samples than 8*n_modes+8.
        NumericError: No finite coefficients.
    
    Source: K. Steiglitz, L. McBride 1965; paper 003, eq. 1.
    """
def block_overlap_time_s(lengths_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], feeds_mm_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], model: FanucModel) -> float:
    """
    Time of a sequence of overlapping cutting blocks, s: sum of ceil(l / (F T)) T (with BlockEnd.carry of l / F) plus the length of the filters (paper 004). No override. Raises ArgumentError on unequal sizes or a feed <= 0.
    """
def busiest_per_s(durations_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], amounts: typing.Annotated[numpy.typing.ArrayLike, numpy.float64] | None, stretch_s: typing.SupportsFloat | typing.SupportsIndex) -> float:
    """
    Largest amount per second in any time window; each block's amount is spread evenly over its duration.
    
    `durations_s`: of the blocks, s, (n,); `amounts`: of each block, such as its characters, (n,); None: one each; `stretch_s`: duration of the window, s; all blocks together if they are shorter.
    """
def compare_programs(original: ProgramText, emitted: ProgramText, reader: ReaderOptions, emission_lines: collections.abc.Sequence[str], joint_path_mm: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> ProgramComparison:
    """
    Compares two programs read with these options. `emission_lines`: capitals without blanks, lines that do not end a cut; `joint_path_mm`: cuts of different lengths are the same if their paths, followed in parallel, stay within it.
    """
def contour_kernel(shaper: Fir, modes: collections.abc.Sequence[Mode], period_s: typing.SupportsFloat | typing.SupportsIndex, target: ContourTarget) -> list[float]:
    """
    Kernel from a command before shaping to the motion that is to follow the path; `shaper`: taps in samples of `period_s`.
    """
def controlled_motion(path: Path, limits: MotionLimits, rules: PlannerRules) -> tuple[Path, SpeedProfile]:
    """
    The path that a control follows, and its speed along it from rest to rest: (Path, SpeedProfile). Raises ArgumentError on a segment without feed, or an invalid setting.
    """
def convolve(first: Shaper, second: Shaper) -> Shaper:
    """
    The two shapers in series: cancels the modes of both; the durations add.
    
    Args:
        first: A shaper.
        second: Another one; the order does not matter.
    
    Returns:
        The series shaper; impulses whose times agree within 1e-12 of its duration are merged.
    
    Source: paper 002, eq. 3.
    """
def convolved_zv(modes: collections.abc.Sequence[Mode]) -> Shaper:
    """
    Convolved ZV, the conventional multi-mode shaper: up to 2^n non-negative impulses.
    
    Args:
        modes: The n >= 1 modes to cancel.
    
    Returns:
        The shaper; its duration is the sum of the half damped periods.
    
    Raises:
        ArgumentError: No mode.
    
    Source: paper 002, section 2.
    """
def count_slowed_blocks(blocks: Path, corner_speed_difference_mm_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], max_feed_mm_per_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> int:
    """
    Number of blocks that a controller with look-ahead would run slower than programmed.
    """
def csv_rows(word: typing.Annotated[numpy.typing.ArrayLike, numpy.uint8], words: collections.abc.Sequence[str], table: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.f_contiguous"]) -> bytes:
    """
    Rows of a CSV file: a word and the numbers of a row of the table, (k, c), each as the shortest text that reads back as the same number. `word`: index of each row's word in `words`, (k,). Raises ArgumentError on unequal lengths or an index without a word.
    """
def divisible_segments(program: ProgramText, region: Region, options: FeedWriterOptions) -> list[bool]:
    """
    Which segments of a region's path may be divided into several blocks.
    """
def equivalent_mass_bisection(force_n: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], response: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], period_s: typing.SupportsFloat | typing.SupportsIndex, omega_rad_s: typing.SupportsFloat | typing.SupportsIndex, damping_ratio: typing.SupportsFloat | typing.SupportsIndex, low_kg: typing.SupportsFloat | typing.SupportsIndex = 0.001, high_kg: typing.SupportsFloat | typing.SupportsIndex = 1000.0, tolerance: typing.SupportsFloat | typing.SupportsIndex = 0.01, most_halvings: typing.SupportsInt | typing.SupportsIndex = 100, quantity: str = 'acceleration', theta: typing.SupportsFloat | typing.SupportsIndex = 1.4, impulse_n_s: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> EquivalentMass:
    """
    Equivalent mass by bisection: paper 003, steps 1 to 7; a check of the closed form.
    
    Args:
        force_n: Measured force in N, shape (n,).
        response: Measured response in SI units, shape (n,).
        period_s: Time between samples in s, above 0.
        omega_rad_s: Undamped natural frequency in rad/s, above 0.
        damping_ratio: 0 to 1.
        low_kg: Lower end of the range, above 0.
        high_kg: Upper end of the range.
        tolerance: Tolerance of the RMS, relative to the measured one.
        most_halvings: Number of halvings after which the search gives up, with converged False.
        quantity: "acceleration", "velocity" or "displacement".
        theta: Parameter of the Wilson theta method, at least 1.
        impulse_n_s: Besides the force: an impulse just before the first sample, in N s.
    
    Returns:
        The mass, the number of halvings and both RMS.
    
    Raises:
        ArgumentError: A value outside its range, a zero response, or a zero force without an impulse.
    
    Source: paper 003, section 2.2, steps 1-7.
    """
def equivalent_mass_closed_form(force_n: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], response: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], period_s: typing.SupportsFloat | typing.SupportsIndex, omega_rad_s: typing.SupportsFloat | typing.SupportsIndex, damping_ratio: typing.SupportsFloat | typing.SupportsIndex, quantity: str = 'acceleration', theta: typing.SupportsFloat | typing.SupportsIndex = 1.4, impulse_n_s: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> EquivalentMass:
    """
    Equivalent mass by one simulation: the response is proportional to 1/m.
    
    Args:
        force_n: Measured force in N, shape (n,).
        response: Measured response in SI units, shape (n,).
        period_s: Time between samples in s, above 0.
        omega_rad_s: Undamped natural frequency in rad/s, above 0.
        damping_ratio: 0 to 1.
        quantity: "acceleration", "velocity" or "displacement".
        theta: Parameter of the Wilson theta method, at least 1.
        impulse_n_s: Besides the force: an impulse just before the first sample, in N s.
    
    Returns:
        The mass that makes the RMS of simulated and measured response equal.
    
    Raises:
        ArgumentError: A value outside its range, a zero response, or a zero force without an impulse.
    
    Source: paper 003, section 2.2.
    """
def extra_insensitive(mode: Mode, vibration_limit: typing.SupportsFloat | typing.SupportsIndex, humps: typing.SupportsInt | typing.SupportsIndex = 1) -> ExtraInsensitive:
    """
    Extra-insensitive (EI) shaper with one, two or three humps, damped or not, solved from its definition.
    
    Between its outermost zeros the residual rises to exactly the limit at each hump. The middle hump, or with two humps the
    middle zero, lies at the mode. Without damping it is the Dolph-Chebyshev window over half periods.
    
    Args:
        mode: The mode around which the residual is to be small.
        vibration_limit: Residual ratio at the humps (no unit), above 0 and below 1.
        humps: Number of humps, 1 to 3.
    
    Returns:
        The shaper and its zeros and humps.
    
    Raises:
        ArgumentError: A value is outside its range.
        DesignError: There is no such shaper with non-negative impulses (high damping).
    
    Source: Singhose, Seering and Singer 1994; Singhose, Porter, Tuttle and Singer 1997; the solution: this project.
    """
def fastest_block_ends(blocks: Path) -> list[int]:
    """
    Indices of the blocks after which a stop excites most: for each axis the block with the highest speed at its end, except the last block; ascending, without repetition.
    """
def feeds_per_minute(program: ProgramText, region: Region) -> bool:
    """
    Whether F is a feed per minute in every block of a region, in one unit of length.
    """
def fit_blocks(command: ShapedCommand, breaks: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], options: FitOptions) -> FittedBlocks:
    """
    Blocks that each last a whole number of block periods; `breaks`: ascending periods at which a block must end. Raises ArgumentError on a position outside +-99999.999 mm.
    """
def fit_circle(points_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> CircleFit:
    """
    Geometric least-squares circle through points (n, 2), mm. Raises ArgumentError on fewer than three points or points on a line, NumericError if it does not converge.
    """
def fit_decay(responses: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]], period_s: typing.SupportsFloat | typing.SupportsIndex, omega_rad_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], damping_ratio: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, with_offset: bool = True, coloured_residuals: bool = False, most_iterations: typing.SupportsInt | typing.SupportsIndex = 60) -> DecayFit:
    """
    Least-squares fit of decaying cosines to one or several free decays; omega and zeta are common.
    
    Args:
        responses: Response per record, each of shape (n,), in any unit.
        period_s: Time between samples in s, above 0.
        omega_rad_s: Starts, undamped natural frequencies in rad/s, shape (n_modes,), below Nyquist.
        damping_ratio: Starts, 0 < zeta < 1, shape (n_modes,).
        with_offset: Fit a constant offset per record.
        coloured_residuals: The covariance also holds for residuals that are correlated over time (stationary noise).
        most_iterations: Steps after which the search gives up, with converged False.
    
    Returns:
        The fit; check converged and reason before use.
    
    Raises:
        ArgumentError: As fit_modes.
    
    Source: G. Golub, V. Pereyra 2003.
    """
def fit_modes(forces: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]], responses: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]], period_s: typing.SupportsFloat | typing.SupportsIndex, omega_rad_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], damping_ratio: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, quantity: str = 'acceleration', with_offset: bool = True, with_mass_line: bool = False, with_compliance: bool = False, coloured_residuals: bool = False, hold: str = 'linear', force_noise_n: typing.SupportsFloat | typing.SupportsIndex = 0.0, most_iterations: typing.SupportsInt | typing.SupportsIndex = 60) -> ModalFit:
    """
    Output-error fit of modes to one or several impacts at the same point (for white noise: maximum likelihood).
    
    The response is the sum over modes of (1/m) s^q/(s^2 + 2 zeta omega s + omega^2) applied to the force, from rest at the
    first sample. The search is Levenberg-Marquardt in ln omega and ln zeta with exact derivatives; linear parameters are
    eliminated.
    
    Args:
        forces: Force per impact in N, each of shape (n,).
        responses: Response per impact at the same instants in SI units, each of shape (n,).
        period_s: Time between samples in s, above 0.
        omega_rad_s: Starts, undamped natural frequencies in rad/s, shape (n_modes,), below Nyquist.
        damping_ratio: Starts, 0 < zeta < 1, shape (n_modes,).
        quantity: "acceleration", "velocity" or "displacement".
        with_offset: Fit a constant offset per record.
        with_mass_line: Add a free mass, for modes far below.
        with_compliance: Add a spring without mass, for modes far above.
        coloured_residuals: The covariance also holds for residuals that are correlated over time (stationary noise).
        hold: Course of the force between samples: "linear"; "band_limited", as after an anti-aliasing filter (sinc
            interpolation); "impulse", impulses of force times period just before the samples.
        force_noise_n: Standard deviation of white noise on the force in N. In pulses of up to 128 samples the true force is
            estimated together with the modes; otherwise the effect of the noise is added to the covariance, to first order.
        most_iterations: Steps after which the search gives up, with converged False.
    
    Returns:
        The fit; check converged and reason before use.
    
    Raises:
        ArgumentError: Records as in arma_driven, a start or option outside its range, or too few samples.
    
    Source: L. Ljung, System Identification, ch. 7; G. Golub, V. Pereyra 2003.
    """
def for_shaped_blocks(model: FanucModel) -> FanucModel:
    """
    The same controller while shaped blocks run: block by block at their feed, without look-ahead (planners other than FANUC's keep it).
    """
def gaussian_low_pass(profile_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], spacing_mm: typing.SupportsFloat | typing.SupportsIndex, cutoff_mm: typing.SupportsFloat | typing.SupportsIndex) -> numpy.ndarray:
    """
    Gaussian low-pass filter of ISO 16610-21: the part of a profile with wavelengths above the cut-off, (n,), mm.
    """
def grid_polynomial(modes: collections.abc.Sequence[Mode], period_s: typing.SupportsFloat | typing.SupportsIndex) -> Shaper:
    """
    Shortest shaper with impulses at multiples of a period that cancels every mode exactly.
    
    The polynomial with the roots z = exp(s*period) and their conjugates: two periods per mode, one for a mode whose z is
    real, none for one that aliases onto an earlier one. Amplitudes may be negative and large: check abs_sum before use.
    
    Args:
        modes: The modes to cancel, at least one; one above the grid's Nyquist frequency is allowed.
        period_s: Period of the grid in s, above 0.
    
    Returns:
        The shaper; residual_ratio of every mode is at most 1e-10, usually about 1e-16*abs_sum.
    
    Raises:
        ArgumentError: No mode, or a period that is not positive.
        DesignError: A z closer to +1 than 0.01, or round-off that leaves a residual above 1e-10.
    
    Source: this project.
    """
def in_position_wait_behind_s(error_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], moved: typing.Annotated[collections.abc.Sequence[bool], "FixedSize(3)"], model: FanucModel) -> float:
    """
    Wait for in-position after any command, s. `error_mm`: the servo lag at its end, (3,); `moved`: the axes that moved, (3,). Raises ArgumentError on an invalid model.
    """
def in_position_wait_s(travel_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], model: FanucModel) -> float:
    """
    Wait for in-position after a rapid, s. Raises ArgumentError on an invalid model.
    """
def insensitive_band(shaper: Shaper, mode: Mode, vibration_limit: typing.SupportsFloat | typing.SupportsIndex) -> FrequencyBand:
    """
    The band of natural frequencies around a mode in which the residual stays within a limit.
    
    Args:
        shaper: The shaper.
        mode: Nominal frequency and damping ratio.
        vibration_limit: Residual ratio (no unit), above 0 and below 1.
    
    Returns:
        The band; of zero width if the limit is exceeded at the mode; never beyond ten times the mode's frequency.
    
    Raises:
        ArgumentError: The limit is outside its range.
    
    Source: this project.
    """
def insensitivity(shaper: Shaper, mode: Mode, vibration_limit: typing.SupportsFloat | typing.SupportsIndex) -> float:
    """
    Insensitivity: width of `insensitive_band` over the mode's frequency.
    
    Args:
        shaper: The shaper.
        mode: Nominal frequency and damping ratio.
        vibration_limit: Residual ratio (no unit), above 0 and below 1.
    
    Returns:
        The relative width (no unit): .064 for ZV and .399 for EI at 5 % without damping.
    
    Raises:
        ArgumentError: The limit is outside its range.
    
    Source: Singer and Seering 1990.
    """
def interpolate(path: Path, profile: SpeedProfile, period_s: typing.SupportsFloat | typing.SupportsIndex) -> numpy.ndarray:
    """
    All set-points of a path, (n_samples, 3), mm, read-only. Raises ArgumentError on a period <= 0.
    """
def interpolate_program(program: ProgramText, model: FanucModel) -> InterpolatedTime:
    """
    Cycle time by full interpolation, set-point by set-point. Raises ArgumentError on an invalid model, a block without a feed, or a program of more than 4e9 set-points.
    """
def largest_difference_mm(path: Path, blocks: collections.abc.Sequence[LinearBlock], period_s: typing.SupportsFloat | typing.SupportsIndex) -> float:
    """
    Largest distance between the motions of the joined blocks and of the blocks of constant feed, at the ends of the periods, mm.
    """
def largest_feed(force: MillingForce, arcs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], limits: FeedLimits, lowest: typing.SupportsFloat | typing.SupportsIndex, highest: typing.SupportsFloat | typing.SupportsIndex) -> LimitedFeed:
    """
    Highest feed between `lowest` and `highest` (mm/min) within all limits: never above a limit, and within 0.02 % of the limit reached. Raises ArgumentError unless 0 < lowest <= highest.
    """
def largest_feeds(force: MillingForce, track: EngagementTrack, limits: FeedLimits, lowest: typing.SupportsFloat | typing.SupportsIndex, highest: typing.SupportsFloat | typing.SupportsIndex) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.uint8], numpy.typing.NDArray[numpy.bool]]:
    """
    largest_feed for every sample of a track, along the path: (feed_mm_per_min, limit as FeedLimit number, within), each (n_samples,). Without engagement, or if the tool only plunges, the highest feed.
    """
def layer_borders(paths: collections.abc.Sequence[Path], bottom_mm: typing.SupportsFloat | typing.SupportsIndex, top_mm: typing.SupportsFloat | typing.SupportsIndex, ramp_step_mm: typing.SupportsFloat | typing.SupportsIndex) -> list[float]:
    """
    Heights between layers for these paths in a stock from bottom to top, mm: the heights of level moves, the lowest points of ramps and plunges, and steps of at most `ramp_step_mm` along ramps and helices (a tenth of the tool's diameter is a good choice). Raises ArgumentError unless bottom < top and the step is positive.
    """
def line_sections(path: Path, ranges: collections.abc.Sequence[tuple[typing.SupportsInt | typing.SupportsIndex, typing.SupportsInt | typing.SupportsIndex]]) -> list[PathSection]:
    """
    The parts of a path that come from `ranges` of source lines, pairs of first and last line. Raises ArgumentError if a range runs backwards or two overlap.
    """
def linear_blocks(path: Path, period_s: typing.SupportsFloat | typing.SupportsIndex, tolerance_mm: typing.SupportsFloat | typing.SupportsIndex, joints: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], modes: typing.Annotated[collections.abc.Sequence[collections.abc.Sequence[Mode]], "FixedSize(3)"]) -> list[LinearBlock]:
    """
    Joins blocks of constant feed, each of whole periods, into blocks of linear feed. At the ends of the periods the motion stays within a tolerance of the original motion. `joints`: ascending indices of blocks that must begin a joined one; speeds at the end of the path are chosen so that `modes` of X, Y and Z are at rest there.
    """
def linear_distance_mm(length_mm: typing.SupportsFloat | typing.SupportsIndex, start_mm_per_s: typing.SupportsFloat | typing.SupportsIndex, end_mm_per_s: typing.SupportsFloat | typing.SupportsIndex, time_s: typing.SupportsFloat | typing.SupportsIndex) -> float:
    """
    Distance along a block whose speed is linear along its path, at a time since its start, mm.
    """
def linear_duration_s(length_mm: typing.SupportsFloat | typing.SupportsIndex, start_mm_per_s: typing.SupportsFloat | typing.SupportsIndex, end_mm_per_s: typing.SupportsFloat | typing.SupportsIndex) -> float:
    """
    Time of a block whose speed is linear along its path, s.
    """
def linear_end_speed(length_mm: typing.SupportsFloat | typing.SupportsIndex, start_mm_per_s: typing.SupportsFloat | typing.SupportsIndex, time_s: typing.SupportsFloat | typing.SupportsIndex) -> float | None:
    """
    Speed at one end of a block of a given duration from the speed at its other end, mm/s; None: there is no such speed.
    """
def linear_model(parameters: FeedDriveParameters) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]]:
    """
    The drive as x' = A x + B w, y = C x + D w with inputs linear between the set-points.
    
    Args:
        parameters: The drive, with viscous friction only and without backlash and force limit.
    
    Returns:
        A, B, C, D. Input 0 is the set-point; input 1, only with acceleration feed-forward, the speed of the set-points,
        sampled as the difference from the previous set-point divided by the period. The output is the response. Lengths in
        any one unit, time in s.
    
    Raises:
        ArgumentError: The drive is not linear.
    """
def linear_positions_mm(start_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], blocks: collections.abc.Sequence[LinearBlock], times_s: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    Positions of the motion of blocks at ascending times, (n, 3), mm; after the last block its end.
    """
def linuxcnc_slowing(path: Path, limits: MotionLimits, rules: PlannerRules, corner_rad: typing.SupportsFloat | typing.SupportsIndex) -> LinuxcncSlowing:
    """
    Effect of LinuxCNC's rules for short segments (kinks and ramps) on a path at its feeds. Turns above `corner_rad` do not count.
    """
def list_programs(text: bytes) -> list[ProgramEntry]:
    """
    The programs of a text (bytes) in order. Raises ProgramError if its '%' lines or its O numbers cannot be read.
    """
def look_ahead_on_load(stations_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], feeds_mm_per_min: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], load_mm_per_min: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], before_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], behind_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64]) -> numpy.ndarray:
    """
    Returns the feeds (n,), mm/min, lowered around each station that is limited by its load (`load_mm_per_min`, (n,)), because the motion lags behind a change of feed. A lower feed is commanded earlier by `before_s` (n,) times the feed that the load allows, a higher one later by `behind_s` (n,) times it.
    """
def machine_frame(tool_frame: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[2, 1]"], direction_rad: typing.SupportsFloat | typing.SupportsIndex) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[2, 1]"]:
    """
    Converts a force (2,) from the frame of the tool to the frame of the machine (paper 001 eq. 4, 5); `direction_rad`: direction of feed from +X towards +Y.
    """
def matrix_exponential(matrix: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    Matrix exponential, balanced, by scaling and squaring.
    
    Raises:
        ArgumentError: Not square or not finite.
        NumericError: The result overflows.
    """
def measure_roughness(profile_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], spacing_mm: typing.SupportsFloat | typing.SupportsIndex, cutoff_mm: typing.SupportsFloat | typing.SupportsIndex, lambda_s_mm: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> Roughness:
    """
    Ra, Rz and Wa of an evenly spaced profile (n,), mm, without one cut-off at each end. Raises ArgumentError if less than one sampling length remains.
    """
def minimal_branches(first: Mode, second_damping: typing.SupportsFloat | typing.SupportsIndex, ratios: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], max_duration_s: typing.SupportsFloat | typing.SupportsIndex, *, max_abs_sum: typing.SupportsFloat | typing.SupportsIndex = 10.0) -> MinimalBranches:
    """
    All minimal two-mode shapers over the ratio of the frequencies, joined into curves (paper 002, figures 2, 3).
    
    At each ratio the list is that of `minimal_two_mode`; curves are followed by continuation, also through gaps, where the
    sum of magnitudes or the duration exceeds its limit. Where two curves touch, their ends may be exchanged.
    
    Args:
        first: The mode whose frequency is constant.
        second_damping: Damping ratio of the other mode (no unit).
        ratios: Frequencies of the other mode over that of the first, ascending, above 0, shape (n_ratios,).
        max_duration_s: Largest duration in s, at most 100 periods of the faster mode at any ratio.
        max_abs_sum: Largest sum of the amplitudes' magnitudes (no unit), at least 1.
    
    Returns:
        The curves, ordered by the ratio at which they begin, then by duration.
    
    Raises:
        ArgumentError: No ratio, ratios that do not ascend, or a value outside its range.
    
    Source: paper 002; the continuation is this project's.
    """
def minimal_shapers(modes: collections.abc.Sequence[Mode], max_duration_s: typing.SupportsFloat | typing.SupportsIndex, *, max_abs_sum: typing.SupportsFloat | typing.SupportsIndex = 10.0, max_starts: typing.SupportsInt | typing.SupportsIndex = 100000, max_boxes: typing.SupportsInt | typing.SupportsIndex = 400000) -> MinimalShapers:
    """
    Minimal multi-mode shapers: n+1 impulses that cancel n modes (one to six), damped or not.
    
    One mode is closed form and two are searched completely. Three and more are searched from many low-discrepancy starts
    and by boxes of times in ascending duration, each proven empty, shrunk to one solution, or unresolved; `complete` and
    `complete_up_to_s` state what is proven. Shapers with fewer impulses that cancel all modes are listed too; families of
    solutions that are not isolated (with undamped modes at odd ratios, which one ZV cancels) are not.
    
    Args:
        modes: One to six modes, no two poles within 1e-6 of one another (relative).
        max_duration_s: Largest duration in s, above 0, at most 100 periods of the fastest mode.
        max_abs_sum: Largest sum of the amplitudes' magnitudes (no unit), at least 1.
        max_starts: Maximum number of Newton starts; fewer are used once every solution was found three times.
        max_boxes: Maximum number of boxes of times examined (some 2 microseconds each for four modes); 0: no proof.
    
    Returns:
        The shapers, residual_ratio of every mode at most 1e-12, and what was searched.
    
    Raises:
        ArgumentError: No mode, more than six, two with equal poles, or a value outside its range.
    
    Source: paper 002, eq. 4-11; the searches are this project's.
    """
def minimal_two_mode(first: Mode, second: Mode, max_duration_s: typing.SupportsFloat | typing.SupportsIndex, max_abs_sum: typing.SupportsFloat | typing.SupportsIndex = 10.0) -> list[Shaper]:
    """
    All minimal (three-impulse) shapers of two modes, ascending in duration, then in the second time.
    
    Complete: boxes of the plane of the two free times are discarded only if a bound on derivatives proves that they contain
    no solution, and Newton starts from all others. If one ZV cancels both modes (undamped, odd ratio), it is listed with
    its two impulses. If amplitudes at given times are not unique, those with the smallest sum of squares are listed.
    
    Args:
        first: One mode, damped or not.
        second: The other one; either may be the faster.
        max_duration_s: Largest duration in s, above 0, at most 100 periods of the faster mode.
        max_abs_sum: Largest sum of the amplitudes' magnitudes (no unit), at least 1. With 1, rounding
            may exclude non-negative shapers: select those by has_negative instead.
    
    Returns:
        The shapers, residual_ratio of both modes below 1e-13; empty if there is none in the range.
    
    Raises:
        ArgumentError: The modes' poles agree within 1e-6 (relative), or a value is outside its range.
    
    Source: paper 002, eq. 12-17; the search is this project's.
    """
def modal_response(force_n: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], period_s: typing.SupportsFloat | typing.SupportsIndex, omega_rad_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], damping_ratio: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], inverse_mass: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], quantity: str = 'acceleration', hold: str = 'linear') -> numpy.typing.NDArray[numpy.float64]:
    """
    Response of modes to a force, exact, from rest: the model of fit_modes.
    
    Args:
        force_n: Force in N, shape (n,).
        period_s: Time between samples in s, above 0.
        omega_rad_s: Undamped natural frequencies in rad/s, shape (n_modes,), below Nyquist.
        damping_ratio: Damping ratios, 0 < zeta < 1, shape (n_modes,).
        inverse_mass: Residues 1/m in 1/kg, shape (n_modes,).
        quantity: "acceleration", "velocity" or "displacement".
        hold: Course of the force between samples, as in fit_modes.
    
    Returns:
        Response in SI units, shape (n,).
    
    Raises:
        ArgumentError: Unequal lengths or a value outside its range.
    
    Source: this project.
    """
def mzv(mode: Mode) -> Shaper:
    """
    Modified ZV: three non-negative impulses, 3/8 of the damped period apart.
    
    Cancels the mode and the pole of the same decay at 5/3 of its damped frequency; 1.5 times as long as ZV; without
    damping its residual has 0.62 of ZV's slope at the mode.
    
    Args:
        mode: The mode to cancel.
    
    Returns:
        The shaper.
    
    Source: the open printer firmware Klipper, "mzv".
    """
def mzv_second_zero(mode: Mode) -> Mode:
    """
    The second pole that `mzv` cancels, as a mode: the same decay rate, 5/3 of the damped frequency.
    
    Args:
        mode: The mode of the MZV shaper.
    
    Returns:
        The other mode.
    
    Source: this project.
    """
def negative_zv(mode: Mode) -> Shaper:
    """
    Negative ZV of unity magnitude: amplitudes exactly 1, -1, 1; undamped at 0, 1/6 and 1/3 of the period.
    
    Args:
        mode: The mode to cancel; its damping is met exactly, not by a fitted formula.
    
    Returns:
        The shaper; its sum of magnitudes is 3.
    
    Raises:
        DesignError: The damping is too high for such a shaper.
    
    Source: Singhose, Singer and Seering 1994; the damped solution: this project.
    """
def path_sections(path: Path, short_mm: typing.SupportsFloat | typing.SupportsIndex = 0.5) -> list[PathSection]:
    """
    The whole path as sections: sequences of lines of one direction and of arcs about one centre, which end at an exact stop at the latest. Successive sequences shorter than `short_mm` are one section of the kind `curve`.
    """
def plan_speed(path: Path, limits: MotionLimits, tolerance: FilterTolerance = ...) -> SpeedProfile:
    """
    Tangential speed profile over a whole path from rest to rest; `tolerance`: the filter after the interpolation, and the deviation permitted to it. Raises ArgumentError on a limit that is not > 0.
    """
def plan_tolerances(path: Path, shaper: Fir, options: ShapingOptions, tolerances_mm: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> list[tuple[float, float]]:
    """
    Durations of a region at several contour tolerances, without its command.
    
    Args:
        path: The programmed path.
        shaper: Taps in whole block periods, common to all axes.
        options: How the region is shaped; its own contour tolerance has no effect.
        tolerances_mm: Descending is fastest, as each search starts from the speeds of the last one; infinity: no slowing.
    
    Returns:
        For each tolerance the duration of the shaped command, s, and the largest deviation of the target, mm.
    
    Raises:
        ArgumentError: As RegionShaper.
    """
def plant_response(command_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], modes: collections.abc.Sequence[collections.abc.Sequence[Mode]], period_s: typing.SupportsFloat | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
    """
    Response of base-excited modes to a whole record of set-points, exact for set-points linear in between.
    
    Identical to the real-time plant of the core, to the last bit, but computed as a batch. The plant is at rest at the
    first row.
    
    Args:
        command_mm: Set-points in mm, shape (n_samples, n_axes), one per period.
        modes: The modes of each axis; none: the axis follows its command.
        period_s: Time between samples in s, above 0.
    
    Returns:
        Positions of the table in mm at the same instants, (n_samples, n_axes), in the memory order of the command.
    
    Raises:
        ArgumentError: Not as many lists of modes as axes, a command that is not finite, an invalid mode or period.
    """
def poles_to_modes(poles: collections.abc.Sequence[complex | typing.SupportsComplex | typing.SupportsFloat | typing.SupportsIndex], period_s: typing.SupportsFloat | typing.SupportsIndex) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Natural frequencies and damping ratios of discrete poles: stable complex pairs, ascending in frequency.
    
    omega = |ln lambda|/period, zeta = -Re(ln lambda)/|ln lambda|.
    
    Args:
        poles: Poles lambda, complex.
        period_s: Time between samples in s, above 0.
    
    Returns:
        (omega_rad_s, damping_ratio), two arrays of equal length, empty if no pole is a mode.
    
    Raises:
        ArgumentError: The period is not positive.
    
    Source: paper 003, eq. 5-6.
    """
def rank_modes(responses: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]], period_s: typing.SupportsFloat | typing.SupportsIndex, omega_rad_s: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], damping_ratio: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], most: typing.SupportsInt | typing.SupportsIndex, forces: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]] | None = None, quantity: str = 'acceleration', kept: typing.SupportsInt | typing.SupportsIndex = 0) -> ModeRanking:
    """
    Ranks candidate modes by forward selection: starts for fit_modes and fit_decay from the poles of a chart.
    
    Each step chooses the candidate that, together with those already chosen, gives the smallest sum of squares. Residues
    (for decays: amplitudes and phases per record) are fitted; frequencies and damping ratios are not.
    
    Args:
        responses: Response per record, each of shape (n,).
        period_s: Time between samples in s, above 0.
        omega_rad_s: Candidates, undamped natural frequencies in rad/s, shape (n_candidates,), below Nyquist.
        damping_ratio: Candidates, 0 < zeta < 1, shape (n_candidates,).
        most: Number of candidates to choose, at least 1.
        forces: Force per record in N at the same instants; None: the records are free decays.
        quantity: "acceleration", "velocity" or "displacement"; only with forces.
        kept: Number of candidates at the start of the list that are chosen before all others, in their order: modes
            already fitted.
    
    Returns:
        The ranking; shorter than `most` if no candidate explains anything more.
    
    Raises:
        ArgumentError: As fit_modes.
    
    Source: this project (orthogonal least squares; S. Chen, S. Billings, W. Luo 1989).
    """
def rapid_samples(start_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], end_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], model: FanucModel) -> numpy.ndarray:
    """
    Set-points of a rapid, one per period, (n, 3), mm, read-only. Raises ArgumentError on an invalid model.
    """
def rapid_time_s(travel_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], model: FanucModel) -> float:
    """
    Time of a rapid from rest to rest without the wait for in-position, s (paper 004, eq. 6 to 16). `travel_mm`: signed travel of each axis, shape (3,). Raises ArgumentError on an invalid model.
    """
def read_linuxcnc(text: bytes, options: LinuxcncOptions) -> LinuxcncProgram:
    """
    Executes a LinuxCNC program as its interpreter does, and returns what it executes in FANUC's words. Raises ProgramError with the file (empty: the program itself), line and column of a word that is not supported.
    """
def read_parts(parts: list, options: ReaderOptions) -> ProgramText:
    """
    Reads a program text in parts (a list of bytes). The list is emptied meanwhile, so that the text is in memory only once.
    """
def read_program(text: bytes, options: ReaderOptions = ...) -> ProgramText:
    """
    Read a program text (bytes). Raises ProgramError with line and column.
    """
def read_siemens(text: str, options: SiemensOptions) -> SiemensProgram:
    """
    Executes a SINUMERIK program in DIN words as the control does, and returns what it executes in FANUC's words. Raises ProgramError with file, line and column of a word that is not supported.
    """
def repeated_zv(mode: Mode, zeros: typing.SupportsInt | typing.SupportsIndex) -> Shaper:
    """
    The ZV shaper in series with itself: 1 is ZV, 2 ZVD, 3 ZVDD.
    
    Args:
        mode: The mode to cancel.
        zeros: Zeros at the mode, 1 to 20: the residual and its first zeros-1 derivatives vanish there.
    
    Returns:
        A shaper of zeros+1 non-negative impulses, half a damped period apart.
    
    Raises:
        ArgumentError: `zeros` is outside its range.
    
    Source: Singer and Seering 1990.
    """
def schedule_feed(block_ends_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], kept_mm_per_min: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], divisible: collections.abc.Sequence[bool], stations_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], feeds_mm_per_min: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], least_length_mm: typing.SupportsFloat | typing.SupportsIndex = 0.6, most_change_mm_per_min: typing.SupportsFloat | typing.SupportsIndex = ..., resolution_mm_per_min: typing.SupportsFloat | typing.SupportsIndex = 0.1) -> list[FeedStretch]:
    """
    Feeds of a path for the shortest time within the feeds of the stations: sections not shorter than the minimum length, each at the lowest feed of its stations. Per block: its end (n,), its fixed feed (0: it may change) and whether it may be divided. Feeds (m,) are valid up to their station. Raises ArgumentError on values that do not ascend or are not above 0.
    """
def sensitivity_curve(shaper: Shaper, damping_ratio: typing.SupportsFloat | typing.SupportsIndex, frequencies_hz: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex]) -> list[float]:
    """
    Residual ratio over the natural frequency.
    
    Args:
        shaper: The shaper.
        damping_ratio: Damping ratio of the modes (no unit), at least 0 and below 1.
        frequencies_hz: Natural frequencies in Hz, above 0.
    
    Returns:
        The residual ratio (no unit) at each frequency, in their order.
    
    Raises:
        ArgumentError: A value is outside its range.
    
    Source: paper 002, eq. 8.
    """
def shape_path(path: Path, shaper: Fir, marked_segments: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], options: ShapingOptions) -> ShapedCommand:
    """
    The shaped command of a whole region: the path is split at forced stops, planned, sampled at half the block period and shaped. `shaper` has its taps in whole block periods. Raises ArgumentError if the block period is no multiple of the interpolation period.
    """
def simulate_blocks(blocks: Path, path: Path, block_end: BlockEnd, override_ratio: typing.SupportsFloat | typing.SupportsIndex, options: SimulationOptions) -> SimulationFigures:
    """
    Simulate blocks at their feed (a controller without look-ahead), measured against the programmed path.
    """
def simulate_circle(radius_mm: typing.SupportsFloat | typing.SupportsIndex, feed_mm_per_s: typing.SupportsFloat | typing.SupportsIndex, model: FanucModel) -> CircleFigures:
    """
    Run circles in XY at a constant feed and measure the mean radius over one turn. Raises ArgumentError on a radius or feed <= 0.
    """
def simulate_path(path: Path, profile: SpeedProfile, options: SimulationOptions, programmed: Path = None) -> SimulationFigures:
    """
    Simulate a path under a speed profile (a controller with look-ahead) through filters and plant, measured against the programmed path (None: the path itself).
    """
def simulate_planned(path: Path, limits: MotionLimits, options: SimulationOptions, programmed: Path) -> SimulationFigures:
    """
    simulate_path with the profile of plan_speed under the limits, without storing the profile if possible.
    """
def simulate_samples(positions_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], path: Path, options: SimulationOptions) -> SimulationFigures:
    """
    Simulate set-points (n, 3), measured against the programmed path. Raises ArgumentError on another shape.
    """
def simulated_duration_s(blocks: Path, period_s: typing.SupportsFloat | typing.SupportsIndex, block_end: BlockEnd, override_ratio: typing.SupportsFloat | typing.SupportsIndex = 1.0) -> float:
    """
    Sum of block durations, s.
    """
def stabilisation_poles(responses: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]], n_max: typing.SupportsInt | typing.SupportsIndex, forces: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64]] | None = None) -> list[numpy.typing.NDArray[numpy.complex128]]:
    """
    Poles of models with 1 ... n_max modes, for a stabilisation chart and as starts of a fit.
    
    All orders follow from one covariance matrix of the free decay (ESPRIT). For impacts the decay is the correlation of
    response with force, in which each impact is weighted by its force.
    
    Args:
        responses: Response per record, each of shape (n,).
        n_max: Largest number of modes, 1 to 50.
        forces: Force per record in N at the same instants; None: the records are free decays.
    
    Returns:
        n_max complex arrays; entry n-1 holds the 2n discrete poles of the model with n modes.
    
    Raises:
        ArgumentError: As arma_driven; fewer samples than 8*n_max+8.
    
    Source: R. Roy, T. Kailath 1989.
    """
def sweep(material: Material, path: Path, tool_diameter_mm: typing.SupportsFloat | typing.SupportsIndex, *, step_mm: typing.SupportsFloat | typing.SupportsIndex = 0.0, touch_mm: typing.SupportsFloat | typing.SupportsIndex = 0.002, progress: collections.abc.Callable | None = None) -> EngagementTrack:
    """
    Moves a tool along a path through the material, removes the swept volume and returns the engagement. Samples are at most `step_mm` apart (0: a fortieth of the diameter) and at the end of every segment; contacts less deep or less wide than `touch_mm` are ignored. `progress` is called from time to time with the distance travelled, mm. Material inside the tool at the start counts as removed; a rapid is swept like any other move. Raises ArgumentError on values out of range, an arc outside of the XY plane, or if the memory limit is exceeded.
    """
def thin_curves(times: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"], values: typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]", "flags.f_contiguous"], tolerances: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"]) -> numpy.typing.NDArray[numpy.int64]:
    """
    Selects the samples needed for curves to look the same (Douglas and Peucker 1973, distance along the value).
    
    Args:
        times: Times of the rows, (n,), rising.
        values: Samples of the curves, (n, curves).
        tolerances: Permitted distance of each curve from straight lines between selected samples, (curves,), above 0.
    
    Returns:
        Indices of the selected rows, ascending, including the first and the last, (k,).
    
    Raises:
        ArgumentError: Another shape, times that do not rise, a tolerance not above 0, or a value that is not finite.
    """
def time_optimal_trajectory(path: Path | typing.Annotated[numpy.typing.ArrayLike, numpy.float64], *, max_feed_mm_per_s: typing.SupportsFloat | typing.SupportsIndex | typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], max_acceleration_mm_per_s2: typing.SupportsFloat | typing.SupportsIndex | typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], max_jerk_mm_per_s3: typing.SupportsFloat | typing.SupportsIndex | typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], contour_tolerance_mm: typing.SupportsFloat | typing.SupportsIndex = 0.05, feed_mm_per_s: typing.SupportsFloat | typing.SupportsIndex | None = None, period_s: typing.SupportsFloat | typing.SupportsIndex = 0.001) -> numpy.ndarray:
    """
    Set-points of a whole path from rest to rest, nearly as fast as the limits of every axis allow.
    
    Junctions are rounded within the tolerance, jerk is limited, and the motion rests at exact stops. The differences of the
    set-points keep the limits to a factor of 1.001, and the programmed feeds. The set-points are bit for bit those of a
    `MotionController` without filters that is given all segments at once. See docs/concepts/time_optimal.md.
    
    Args:
        path: A path whose segments have a feed, or the points of a polyline, (n, 3), mm.
        max_feed_mm_per_s: Limit of every axis, mm/s: a number for all, or one for each, shape (3,).
        max_acceleration_mm_per_s2: Likewise, mm/s^2.
        max_jerk_mm_per_s3: Likewise, mm/s^3.
        contour_tolerance_mm: Permitted deviation where direction or curvature of the path jumps, mm; 0: stop there.
        feed_mm_per_s: Feed along the polyline through points, mm/s; None: as fast as the limits allow.
        period_s: Time between two set-points, s.
    
    Returns:
        Set-points, (n_samples, 3), mm, read-only; the first is the start, the last exactly the end; none without length.
    
    Raises:
        ArgumentError: A limit or period that is not above zero and finite, a tolerance below zero, a segment without feed.
        NumericError: The limits cannot be kept.
    """
def time_program(program: ProgramText, model: FanucModel, per_block: bool = False) -> CycleTime:
    """
    Cycle time in closed form: O(1) per block for acceleration after interpolation (paper 004), by the planner in look-ahead. Raises ArgumentError on an invalid model, or a block without a feed.
    """
def travel_blocks(blocks: Path, along: Path, block_end: BlockEnd, stations_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], period_s: typing.SupportsFloat | typing.SupportsIndex, filters: collections.abc.Sequence[Fir] = [], window_s: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> Travel:
    """
    Actual speeds of blocks at their feed, followed along `along`, from which they were made; else as travel_path.
    """
def travel_path(path: Path, profile: SpeedProfile, along: Path, stations_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], period_s: typing.SupportsFloat | typing.SupportsIndex, filters: collections.abc.Sequence[Fir] = [], window_s: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> Travel:
    """
    Actual speeds of a path under a speed profile, followed along `along`, the same path or the one from which it was made. `stations_mm` (n,) ascend to the length of `along`; `filters` act after the set-points; speeds are averaged over `window_s`. Raises ArgumentError on stations that do not ascend to that length.
    """
def wall_error_um(force: MillingForce, beam: ToolBeam, arcs: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], feed_mm_per_min: typing.SupportsFloat | typing.SupportsIndex, side: WallSide, height_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], tolerance_rad: typing.SupportsFloat | typing.SupportsIndex = 0.02) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
    """
    Form error perpendicular to the wall at heights above the tip (paper 001, section 2.3).
    
    Args:
        force: The force model.
        beam: The tool as a beam.
        arcs: (n_arcs, 4): from and to in rad, bottom and top in mm.
        feed_mm_per_min: Along the path.
        side: Which wall.
        height_mm: (n,), mm above the tip.
        tolerance_rad: An arc that ends this close to +-pi/2 reaches the wall.
    
    Returns:
        (n,), um: + material is left, - the wall is cut too deep; NaN where the engagement does not reach it.
    
    Raises:
        ArgumentError: A height below the tip, or an engagement above the overhang.
    """
def wall_errors_um(force: MillingForce, beam: ToolBeam, track: EngagementTrack, feed_mm_per_min: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], side: WallSide, height_mm: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], tolerance_rad: typing.SupportsFloat | typing.SupportsIndex = 0.02) -> numpy.ndarray:
    """
    wall_error_um along a track, with a feed for each sample: (n_samples, n_heights), um, read-only. Raises ArgumentError as wall_error_um, and on another number of feeds.
    """
def wilson_theta(mass_kg: typing.SupportsFloat | typing.SupportsIndex, damping_n_s_per_m: typing.SupportsFloat | typing.SupportsIndex, stiffness_n_per_m: typing.SupportsFloat | typing.SupportsIndex, force_n: typing.Annotated[numpy.typing.ArrayLike, numpy.float64], period_s: typing.SupportsFloat | typing.SupportsIndex, theta: typing.SupportsFloat | typing.SupportsIndex = 1.4, displacement_m: typing.SupportsFloat | typing.SupportsIndex = 0.0, velocity_m_per_s: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
    """
    Step-by-step integration of m x'' + c x' + k x = force by the Wilson theta method.
    
    Args:
        mass_kg: Mass, above 0.
        damping_n_s_per_m: Viscous damping, at least 0.
        stiffness_n_per_m: Stiffness, above 0.
        force_n: Force in N, shape (n,).
        period_s: Time between samples in s, above 0.
        theta: Number of periods over which the acceleration is linear, at least 1; from 1.37 on stable for any period.
        displacement_m: At the first sample.
        velocity_m_per_s: At the first sample.
    
    Returns:
        (displacement in m, velocity in m/s, acceleration in m/s^2), each of shape (n,).
    
    Raises:
        ArgumentError: A value outside its range.
    
    Source: paper 003, section 2.2; K.-J. Bathe, Finite Element Procedures, 9.2.
    """
def with_feeds(path: Path, stretches: collections.abc.Sequence[FeedStretch]) -> Path:
    """
    The path with the feeds of the sections `stretches`: segments are divided where a section ends within one. Raises ArgumentError if they do not cover the path.
    """
def worst_residual(shaper: Shaper, mode: Mode, lowest_hz: typing.SupportsFloat | typing.SupportsIndex, highest_hz: typing.SupportsFloat | typing.SupportsIndex) -> WorstResidual:
    """
    Largest residual ratio over a band of natural frequencies, found and proven.
    
    Args:
        shaper: The shaper.
        mode: Gives the damping ratio.
        lowest_hz: Lower end of the band in Hz, above 0.
        highest_hz: Upper end of the band in Hz, at least the lower one.
    
    Returns:
        The largest residual, where it is, and the proven bound.
    
    Raises:
        ArgumentError: A value is outside its range.
        DesignError: More than a million parts of the band are needed for the proof.
    
    Source: this project.
    """
def write_blocks(blocks: FittedBlocks, start: typing.Annotated[collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex], "FixedSize(3)"], marks: collections.abc.Sequence[BlockMark], options: WriterOptions) -> tuple[bytes, int, int]:
    """
    Text of fitted blocks: (bytes, modal motion code after it, modal plane after it); `start` in increments.
    """
def write_feeds(program: ProgramText, region: Region, stretches: collections.abc.Sequence[FeedStretch], options: FeedWriterOptions) -> RefedRegion:
    """
    The region's lines with the feeds of the sections `stretches`, which cover its path; everything else in them does not change. Raises ArgumentError if they do not, or if one ends within a block that cannot be divided.
    """
def zv(mode: Mode | typing.SupportsFloat | typing.SupportsIndex, damping_ratio: typing.SupportsFloat | typing.SupportsIndex | None = None) -> Shaper:
    """
    Zero-vibration shaper of one mode: impulses at 0 and half the damped period.
    
    Args:
        mode: The mode to cancel, or its undamped natural frequency in Hz: ``zv(46, 0.02)``.
        damping_ratio: With a frequency, the damping ratio (no unit), 0 <= zeta < 1; None: 0.
    
    Returns:
        A shaper with 2 non-negative impulses.
    
    Raises:
        ArgumentError: A value is outside its range, or a damping ratio is given although `mode` is a Mode.
    
    Source: paper 002, eq. 1-2 (Smith 1958).
    """
def zv_on_grid(mode: Mode, period_s: typing.SupportsFloat | typing.SupportsIndex) -> Shaper:
    """
    ZV with impulses at multiples of a period only: the second impulse is divided between two of them.
    
    Args:
        mode: The mode to cancel.
        period_s: Period of the grid in s, above 0, at most a quarter of the damped period.
    
    Returns:
        A shaper with 3 non-negative impulses, 2 where half the damped period is a multiple; residual exactly zero at the
        mode.
    
    Raises:
        ArgumentError: The period is not above 0.
        DesignError: The period is too long.
    
    Source: this project.
    """
__version__: str = '0.1.0'
linuxcnc_peck_clearance_mm: float = 0.254
