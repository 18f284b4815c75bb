#include "play/program_set_points.hpp"
#include "shapegcode/timing.hpp"

namespace shapegcode {

InterpolatedTime interpolate_program(const Program& program, const FanucModel& model) {
  detail::ProgramSetPoints set_points(program, model, detail::ProgramSetPoints::Waits::cut);
  for (detail::SetPoint next; set_points.step(next);) {
  }
  return set_points.time();
}

}  // namespace shapegcode
