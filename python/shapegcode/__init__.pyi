"""The public names of shapegcode and their modules: the only list, read by type checkers and `__init__.py`."""

from shapegcode._core import (
    AccelerationLaw as AccelerationLaw,
    Activity as Activity,
    ChipThickness as ChipThickness,
    CornerCut as CornerCut,
    CuttingCoefficients as CuttingCoefficients,
    EndMill as EndMill,
    FeedDrive as FeedDrive,
    FeedDriveRealTime as FeedDriveRealTime,
    FeedLimit as FeedLimit,
    FeedLimits as FeedLimits,
    FeedOf as FeedOf,
    FeedRate as FeedRate,
    Fir as Fir,
    FirStream as FirStream,
    FollowingFir as FollowingFir,
    FollowingLimits as FollowingLimits,
    JogResult as JogResult,
    LinearPlant as LinearPlant,
    Material as Material,
    MillingForce as MillingForce,
    Mode as Mode,
    MotionController as MotionController,
    MotionLimits as MotionLimits,
    OffsetLimits as OffsetLimits,
    Path as Path,
    PushResult as PushResult,
    Segment as Segment,
    SegmentRules as SegmentRules,
    Shaper as Shaper,
    SpindleSense as SpindleSense,
    ToolBeam as ToolBeam,
    VaryingFir as VaryingFir,
    WallSide as WallSide,
    __version__ as __version__,
    convolved_zv as convolved_zv,
    grid_polynomial as grid_polynomial,
    insensitivity as insensitivity,
    largest_feed as largest_feed,
    largest_feeds as largest_feeds,
    layer_borders as layer_borders,
    linear_model as linear_model,
    machine_frame as machine_frame,
    minimal_branches as minimal_branches,
    minimal_shapers as minimal_shapers,
    minimal_two_mode as minimal_two_mode,
    repeated_zv as repeated_zv,
    sweep as sweep,
    time_optimal_trajectory as time_optimal_trajectory,
    wall_error_um as wall_error_um,
    wall_errors_um as wall_errors_um,
    worst_residual as worst_residual,
    zv as zv,
    zv_on_grid as zv_on_grid,
)
from shapegcode.batching.batch import batch as batch
from shapegcode.batching.process import Cluster as Cluster
from shapegcode.batching.result import (
    Batch as Batch,
    BatchRow as BatchRow,
)
from shapegcode.characterization.characterize import characterize as characterize
from shapegcode.characterization.programs import write_characterization_tests as write_characterization_tests
from shapegcode.characterization.result import (
    Characterisation as Characterisation,
    CharacterisationTests as CharacterisationTests,
)
from shapegcode.checking.check import (
    check as check,
    check_text as check_text,
)
from shapegcode.checking.result import (
    Check as Check,
    Finding as Finding,
)
from shapegcode.conversion.budget import Budget as Budget
from shapegcode.conversion.convert import convert as convert
from shapegcode.conversion.plots import plot_tolerance as plot_tolerance
from shapegcode.conversion.result import Conversion as Conversion
from shapegcode.conversion.scheduled import (
    ScheduledConversion as ScheduledConversion,
    convert_scheduled as convert_scheduled,
)
from shapegcode.cutting.stock import Stock as Stock
from shapegcode.cutting.tool import Tool as Tool
from shapegcode.demos.path import PathDemo as PathDemo, path_demo as path_demo
from shapegcode.errors import (
    ArgumentError as ArgumentError,
    DesignError as DesignError,
    FileError as FileError,
    MachineError as MachineError,
    NumericError as NumericError,
    Problem as Problem,
    ProgramError as ProgramError,
    RecordError as RecordError,
    RoundTripError as RoundTripError,
    RunsFileError as RunsFileError,
    ShapegcodeError as ShapegcodeError,
    StockError as StockError,
    ToolError as ToolError,
)
from shapegcode.feed.plots import (
    plot_feed_along_path as plot_feed_along_path,
    plot_force_path as plot_force_path,
    plot_wall_error as plot_wall_error,
)
from shapegcode.feed.result import FeedSchedule as FeedSchedule
from shapegcode.feed.schedule import schedule_feed as schedule_feed
from shapegcode.feed.survey import (
    Survey as Survey,
    survey as survey,
)
from shapegcode.identification.identify import identify as identify
from shapegcode.identification.plan import TapPlan as TapPlan, tap_plan as tap_plan
from shapegcode.identification.plots import (
    plot_decay as plot_decay,
    plot_response as plot_response,
    plot_spectrum as plot_spectrum,
    plot_stabilisation as plot_stabilisation,
    plot_sweep as plot_sweep,
    plot_traces as plot_traces,
)
from shapegcode.identification.result import (
    Estimate as Estimate,
    Identification as Identification,
    IdentifiedMode as IdentifiedMode,
)
from shapegcode.identification.servo.fit import fit_servo as fit_servo
from shapegcode.identification.servo.plots import plot_servo as plot_servo
from shapegcode.identification.servo.record import (
    ServoRecord as ServoRecord,
    ServoTrace as ServoTrace,
    read_servo_record as read_servo_record,
)
from shapegcode.identification.servo.result import ServoAxis as ServoAxis, ServoFit as ServoFit
from shapegcode.identification.sweep_program import (
    SweepProgram as SweepProgram,
    SweptBand as SweptBand,
    write_sweep as write_sweep,
)
from shapegcode.identification.update import MachineUpdate as MachineUpdate, update_machine as update_machine
from shapegcode.io.edge_capture import (
    EdgeAxis as EdgeAxis,
    EdgeBlock as EdgeBlock,
    EdgeCall as EdgeCall,
    EdgeCapture as EdgeCapture,
    EdgeGap as EdgeGap,
    EdgeValue as EdgeValue,
)
from shapegcode.io.edge_json import read_edge_json as read_edge_json
from shapegcode.io.record import FrequencyResponse as FrequencyResponse, ReadOptions as ReadOptions, Record as Record
from shapegcode.io.run_log import (
    iter_run_logs as iter_run_logs,
    read_run_logs as read_run_logs,
)
from shapegcode.io.runs import (
    RunLog as RunLog,
    Signal as Signal,
)
from shapegcode.machine import Machine as Machine
from shapegcode.machine.control_import import import_parameters as import_parameters
from shapegcode.machine.result import (
    MachineDescription as MachineDescription,
    MachineDifference as MachineDifference,
    ParameterImport as ParameterImport,
    describe_machine as describe_machine,
    machine_difference as machine_difference,
)
from shapegcode.metrology.measure import (
    measure as measure,
    measure_samples as measure_samples,
)
from shapegcode.metrology.plots import plot_part as plot_part, plot_walls as plot_walls
from shapegcode.metrology.result import Measurement as Measurement
from shapegcode.model.modes import drive_parameters as drive_parameters, plant_response as plant_response
from shapegcode.model.stream import stream as stream
from shapegcode.program import Program as Program
from shapegcode.program.comparison import (
    Allowed as Allowed,
    Comparison as Comparison,
    KindCount as KindCount,
    ProgramDifference as ProgramDifference,
    compare as compare,
)
from shapegcode.program.expand import Expansion as Expansion, expand as expand
from shapegcode.results.json import schema as schema
from shapegcode.results.motion_plots import (
    Trace as Trace,
    View as View,
    plot_feed as plot_feed,
    plot_vibration as plot_vibration,
)
from shapegcode.results.outcome import Pair as Pair, Xyz as Xyz
from shapegcode.results.path_plots import plot_path as plot_path
from shapegcode.results.result import Result as Result
from shapegcode.results.revive import Reports as Reports, load_result as load_result
from shapegcode.results.table import Column as Column, Table as Table
from shapegcode.setup.answers import Answers as Answers, AnswersError as AnswersError, read_answers as read_answers
from shapegcode.setup.build import set_up as set_up
from shapegcode.setup.result import MachineSetup as MachineSetup
from shapegcode.shaping.bands import ModeBand as ModeBand
from shapegcode.shaping.comparison import choose_shaper as choose_shaper
from shapegcode.shaping.grid import choose_block_period as choose_block_period, choose_grid as choose_grid
from shapegcode.shaping.grid_designs import shortest_non_negative as shortest_non_negative
from shapegcode.shaping.plots import (
    plot_branches as plot_branches,
    plot_impulses as plot_impulses,
    plot_pareto as plot_pareto,
    plot_sensitivity as plot_sensitivity,
    plot_steps as plot_steps,
)
from shapegcode.shaping.result import Recommendation as Recommendation
from shapegcode.simulation.plots import plot_motion as plot_motion
from shapegcode.simulation.result import (
    Motion as Motion,
    Simulation as Simulation,
)
from shapegcode.simulation.simulate import (
    simulate as simulate,
    simulate_motion as simulate_motion,
)
from shapegcode.studies.optimize import optimize as optimize
from shapegcode.studies.plots import (
    plot_bands as plot_bands,
    plot_choices as plot_choices,
    plot_tornado as plot_tornado,
)
from shapegcode.studies.result import (
    Candidate as Candidate,
    MachineStudy as MachineStudy,
    Optimum as Optimum,
)
from shapegcode.studies.study import study as study
from shapegcode.studies.study_file import load_study as load_study
from shapegcode.studies.varied import (
    listed as listed,
    lognormal as lognormal,
    normal as normal,
    uniform as uniform,
)
from shapegcode.testcut.cut import (
    TestCut as TestCut,
    read_test_cut as read_test_cut,
)
from shapegcode.testcut.design import (
    CornerShape as CornerShape,
    CutConditions as CutConditions,
    corner_cut as corner_cut,
    interval_cut as interval_cut,
    taper_cut as taper_cut,
    write_test_cut as write_test_cut,
)
from shapegcode.testcut.fit import fit_test_cut as fit_test_cut
from shapegcode.testcut.plots import (
    plot_coefficients as plot_coefficients,
    plot_corner as plot_corner,
    plot_interval as plot_interval,
    plot_taper as plot_taper,
)
from shapegcode.testcut.result import (
    CornerResult as CornerResult,
    CutDesign as CutDesign,
    IntervalResult as IntervalResult,
    TaperResult as TaperResult,
)
from shapegcode.timing.calibration.calibrate import calibrate_cycle_time as calibrate_cycle_time
from shapegcode.timing.calibration.plots import plot_cycle_time_calibration as plot_cycle_time_calibration
from shapegcode.timing.calibration.result import (
    CalibratedParameter as CalibratedParameter,
    CalibrationRun as CalibrationRun,
    CycleTimeCalibration as CycleTimeCalibration,
    CycleTimePart as CycleTimePart,
    FamilyScore as FamilyScore,
)
from shapegcode.timing.calibration.runs_file import (
    RunEntry as RunEntry,
    RunsFile as RunsFile,
    load_runs as load_runs,
)
from shapegcode.timing.cycle_time import cycle_time as cycle_time
from shapegcode.timing.plots import plot_time as plot_time
from shapegcode.timing.result import CycleTime as CycleTime
