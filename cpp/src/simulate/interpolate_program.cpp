#include "shapegcode/timing.hpp"
#include "simulate/program_set_points.hpp"

namespace shapegcode {

InterpolatedTime interpolate_program(const Program& program, const FanucModel& model) {
  detail::ProgramSetPoints set_points(program, model, detail::ProgramSetPoints::Waits::cut);
  for (detail::SetPoint next; set_points.step(next);) {
  }
  return set_points.time();
}

}  // namespace shapegcode
