#pragma once

#include <pybind11/pybind11.h>

namespace shapegcode::bindings {

/// For what takes long and touches no Python object.
using release_gil = pybind11::call_guard<pybind11::gil_scoped_release>;

void register_errors(pybind11::module_& module);
void register_shaping(pybind11::module_& module);
void register_shaping_families(pybind11::module_& module);
void register_minimal(pybind11::module_& module);
void register_filter(pybind11::module_& module);
void register_path(pybind11::module_& module);
void register_gcode(pybind11::module_& module);
void register_motion(pybind11::module_& module);
void register_planner_models(pybind11::module_& module);
void register_controller(pybind11::module_& module);
void register_shaped_command(pybind11::module_& module);
void register_emission(pybind11::module_& module);
void register_linear_feed(pybind11::module_& module);
void register_plant(pybind11::module_& module);
void register_feed_drive(pybind11::module_& module);
void register_metrology(pybind11::module_& module);
void register_follow(pybind11::module_& module);
void register_identification(pybind11::module_& module);
void register_simulation(pybind11::module_& module);
void register_timing(pybind11::module_& module);
void register_simulation_stream(pybind11::module_& module);
void register_engagement(pybind11::module_& module);
void register_milling(pybind11::module_& module);
void register_feed_schedule(pybind11::module_& module);
void register_compare(pybind11::module_& module);
void register_expanded_program(pybind11::module_& module);
void register_linuxcnc(pybind11::module_& module);
void register_siemens(pybind11::module_& module);

}  // namespace shapegcode::bindings
