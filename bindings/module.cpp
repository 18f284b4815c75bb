#include <pybind11/pybind11.h>

#include "register.hpp"

PYBIND11_MODULE(_core, module) {
  using namespace shapegcode::bindings;
  module.doc() = "Compiled core of shapegcode: program text, motion, filters, shapers, plant and metrology.";
  module.attr("__version__") = SHAPEGCODE_VERSION;
  register_errors(module);
  register_filter(module);  // of which a shaper makes one
  register_shaping(module);
  register_shaping_families(module);
  register_minimal(module);
  register_path(module);
  register_motion(module);
  register_planner_models(module);
  register_controller(module);
  register_gcode(module);
  register_plant(module);
  register_feed_drive(module);
  register_identification(module);
  register_shaped_command(module);
  register_emission(module);
  register_linear_feed(module);
  register_simulation(module);
  register_metrology(module);
  register_follow(module);
  register_timing(module);
  register_simulation_stream(module);
  register_engagement(module);
  register_milling(module);
  register_feed_schedule(module);
  register_compare(module);
  register_expanded_program(module);
  register_linuxcnc(module);
  register_siemens(module);
}
