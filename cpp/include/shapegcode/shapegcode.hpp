#pragma once

// The library in one include, except linear_feed.hpp, linuxcnc_program.hpp and siemens_program.hpp. A program text
// becomes moves, and the moves a time:
//
//     #include "shapegcode/shapegcode.hpp"
//
//     const shapegcode::Program program = shapegcode::read_program("G21 G90 G00 X0 Y0\nG01 X40. F6000\nM30\n");
//     shapegcode::FanucModel control;  // a FANUC without look-ahead, in its usual setting
//     control.motion = shapegcode::MotionKind::after_interpolation;
//     const double total_s = shapegcode::time_program(program, control).parts.total_s();
//
// A control needs less: "shapegcode/controller.hpp", or "shapegcode/prototype.hpp" for a path that is known as a whole.

#include "shapegcode/columns.hpp"
#include "shapegcode/command.hpp"
#include "shapegcode/compare.hpp"
#include "shapegcode/controller.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/filter.hpp"
#include "shapegcode/identify/arma.hpp"
#include "shapegcode/identify/equivalent_mass.hpp"
#include "shapegcode/identify/modal_fit.hpp"
#include "shapegcode/measure/contour.hpp"
#include "shapegcode/measure/follow.hpp"
#include "shapegcode/measure/sections.hpp"
#include "shapegcode/milling/corner.hpp"
#include "shapegcode/milling/feed.hpp"
#include "shapegcode/milling/force.hpp"
#include "shapegcode/milling/material.hpp"
#include "shapegcode/minimal_shapers.hpp"
#include "shapegcode/mode.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/planner.hpp"
#include "shapegcode/planner_models.hpp"
#include "shapegcode/plant/feed_drive.hpp"
#include "shapegcode/plant/linear_plant.hpp"
#include "shapegcode/plant/modal.hpp"
#include "shapegcode/plant/servo_lag.hpp"
#include "shapegcode/program.hpp"
#include "shapegcode/prototype.hpp"
#include "shapegcode/samples.hpp"
#include "shapegcode/shaper.hpp"
#include "shapegcode/simulation.hpp"
#include "shapegcode/simulation_stream.hpp"
#include "shapegcode/timing.hpp"
#include "shapegcode/write.hpp"
