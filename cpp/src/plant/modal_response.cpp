#include "shapegcode/plant/modal.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "base/checks.hpp"
#include "base/rest.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

using Eigen::Index;

constexpr std::size_t lane_count = 2;     // doubles that every 64-bit processor takes at once
constexpr std::size_t modes_at_once = 4;  // more would not stay in registers
constexpr Index piece_rows = 512;         // what is at work stays in the first cache

/// The axes of a group side by side.
using Lanes = Eigen::Array<double, static_cast<int>(lane_count), 1>;

/// A mode of each axis of a group. Where an axis has none, nothing is added.
struct GroupMode {
  Lanes dd = Lanes::Zero(), dv = Lanes::Zero(), vd = Lanes::Zero(), vv = Lanes::Zero();
  Lanes participation = Lanes::Zero();
  Lanes deflection = Lanes::Zero(), velocity = Lanes::Zero();

  void set(Index lane, const Mode& mode, double period_s) {
    const ModeTransition over_period = mode_transition(mode, period_s);
    dd[lane] = over_period.dd;
    dv[lane] = over_period.dv;
    vd[lane] = over_period.vd;
    vv[lane] = over_period.vv;
    participation[lane] = mode.participation;
  }
};

/// As many axes as lanes, and the piece of their record that is at work. An axis left over fills both lanes.
struct Group {
  std::vector<GroupMode> modes;
  std::array<Index, lane_count> axis{};
  std::array<Lanes, piece_rows + 1> position;  // mm; first the end of the last piece
  std::array<Lanes, piece_rows + 1> velocity;  // mm/s, of the command, likewise
  std::array<Lanes, piece_rows> deflection;    // mm, of all modes so far

  void begin(const ModalResponse::Record& command) noexcept {
    position[0] = {command(0, axis[0]), command(0, axis[1])};
    velocity[0].setZero();
  }
  /// False if a value of the piece is not finite.
  bool take(const ModalResponse::Record& command, Index first, Index rows, double rate_hz) noexcept {
    const double* one = &command.coeffRef(first, axis[0]);
    const double* other = &command.coeffRef(first, axis[1]);
    Lanes before = position[0];
    Lanes zero = Lanes::Zero();
    for (std::size_t k = 0; k < static_cast<std::size_t>(rows); ++k) {
      const Lanes now(*one, *other);
      position[k + 1] = now;
      velocity[k + 1] = (now - before) * rate_hz;
      zero += now - now;
      before = now;
      one += command.innerStride();
      other += command.innerStride();
    }
    std::fill_n(deflection.begin(), rows, Lanes::Zero());
    return (zero == 0.0).all();
  }
  void give(ModalResponse::Result& response, Index first, Index rows) noexcept {
    double* one = &response(first, axis[0]);
    double* other = &response(first, axis[1]);
    for (std::size_t k = 0; k < static_cast<std::size_t>(rows); ++k) {
      const Lanes now = position[k + 1] + deflection[k];
      *one = now[0];
      *other = now[1];
      one += response.innerStride();
      other += response.innerStride();
    }
    position[0] = position[static_cast<std::size_t>(rows)];
    velocity[0] = velocity[static_cast<std::size_t>(rows)];
  }

  /// `row`: of the whole record, at which the piece begins.
  void propagate(Index row, Index rows) noexcept {
    std::size_t first = 0;
    for (; first + modes_at_once <= modes.size(); first += modes_at_once) propagate<modes_at_once>(first, row, rows);
    switch (modes.size() - first) {
      case 3:
        return propagate<3>(first, row, rows);
      case 2:
        return propagate<2>(first, row, rows);
      case 1:
        return propagate<1>(first, row, rows);
      default:
        return;
    }
  }
  /// Some modes over a piece; the operations and their order are those of ModalPlant::step().
  template <std::size_t count>
  void propagate(std::size_t first, Index row, Index rows) noexcept {
    GroupMode* const mode = &modes[first];
    std::array<Lanes, count> d;
    std::array<Lanes, count> v;
    for (std::size_t m = 0; m < count; ++m) {
      d[m] = mode[m].deflection;
      v[m] = mode[m].velocity;
    }
    for (Index done = 0; done < rows;) {
      const Index until_look = rows_between_looks - (row + done) % rows_between_looks;
      const Index until = std::min(rows, done + until_look);
      for (auto k = static_cast<std::size_t>(done); k < static_cast<std::size_t>(until); ++k) {
        const Lanes jump = velocity[k + 1] - velocity[k];
        Lanes sum = deflection[k];
        for (std::size_t m = 0; m < count; ++m) {
          v[m] -= jump;
          const Lanes next = mode[m].dd * d[m] + mode[m].dv * v[m];
          v[m] = mode[m].vd * d[m] + mode[m].vv * v[m];
          d[m] = next;
          sum += mode[m].participation * next;
        }
        deflection[k] = sum;
      }
      if (until == done + until_look) {
        for (std::size_t m = 0; m < count; ++m) {
          d[m] = (d[m].abs() < min_state).select(0.0, d[m]);
          v[m] = (v[m].abs() < min_state).select(0.0, v[m]);
        }
      }
      done = until;
    }
    for (std::size_t m = 0; m < count; ++m) {
      mode[m].deflection = d[m];
      mode[m].velocity = v[m];
    }
  }
};

}  // namespace

struct ModalResponse::Impl {
  double rate_hz = 0.0;
  Index axes = 0;
  Index row = 0;  // of the whole record that comes next
  bool started = false;
  std::vector<Group> groups;
  std::unique_ptr<ModalPlant> crossed;  // where axes excite modes that move others, instead of the groups

  void start(const ModalResponse::Record& command) {
    for (Group& group : groups) group.begin(command);
    if (crossed) crossed->reset(position(command, 0));
    started = true;
  }
  [[nodiscard]] Vector3 position(const ModalResponse::Record& command, Index at) const noexcept {
    Vector3 result = Vector3::Zero();
    for (Index axis = 0; axis < axes; ++axis) result[axis] = command(at, axis);
    return result;
  }
  void step(const ModalResponse::Record& command, ModalResponse::Result& response, Index first, Index rows) noexcept {
    for (Index at = first; at < first + rows; ++at) {
      const Vector3 there = crossed->step(position(command, at));
      for (Index axis = 0; axis < axes; ++axis) response(at, axis) = there[axis];
    }
  }
};

ModalResponse::ModalResponse(const std::vector<std::vector<Mode>>& modes, double period_s)
    : impl_(std::make_unique<Impl>()) {
  require_period(period_s, "period of a response");
  if (modes.empty()) throw Error(ErrorKind::argument, "response of 0 axes, at least one needed");
  impl_->rate_hz = 1.0 / period_s;
  impl_->axes = static_cast<Index>(modes.size());
  impl_->groups.resize((modes.size() + lane_count - 1) / lane_count);
  bool crosses = false;
  for (std::size_t g = 0; g < impl_->groups.size(); ++g) {
    Group& group = impl_->groups[g];
    for (std::size_t lane = 0; lane < lane_count; ++lane) {
      const std::size_t axis = std::min(g * lane_count + lane, modes.size() - 1);
      group.axis[lane] = static_cast<Index>(axis);
      if (group.modes.size() < modes[axis].size()) group.modes.resize(modes[axis].size());
      for (std::size_t m = 0; m < modes[axis].size(); ++m) {
        check_shares(modes[axis][m], axis);
        crosses = crosses || modes[axis][m].crosses();
        group.modes[m].set(static_cast<Index>(lane), modes[axis][m], period_s);
      }
    }
  }
  if (!crosses) return;
  if (modes.size() > axis_count) {
    throw Error(ErrorKind::argument, fmt::format("modes that other axes excite, among {} axes: at most {} are possible",
                                                 modes.size(), axis_count));
  }
  AxisModes of_axes;
  std::ranges::copy(modes, of_axes.begin());
  impl_->crossed = std::make_unique<ModalPlant>(std::move(of_axes), period_s);
}

ModalResponse::~ModalResponse() = default;
ModalResponse::ModalResponse(ModalResponse&&) noexcept = default;
ModalResponse& ModalResponse::operator=(ModalResponse&&) noexcept = default;

void ModalResponse::apply(const Record& command, Result response) {
  Impl& self = *impl_;
  if (command.cols() != self.axes || response.rows() != command.rows() || response.cols() != command.cols()) {
    throw Error(ErrorKind::argument,
                fmt::format("command of {} x {} values and response of {} x {} for {} axes", command.rows(),
                            command.cols(), response.rows(), response.cols(), self.axes));
  }
  if (command.rows() == 0) return;
  if (!self.started) self.start(command);
  for (Index first = 0; first < command.rows(); first += piece_rows) {
    const Index rows = std::min(piece_rows, command.rows() - first);
    for (Group& group : self.groups) {
      if (!group.take(command, first, rows, self.rate_hz)) {
        throw Error(ErrorKind::argument,
                    fmt::format("command of a response has a value that is not finite, in rows {} to {}", first,
                                first + rows - 1));
      }
      if (!self.crossed) {
        group.propagate(self.row, rows);
        group.give(response, first, rows);
      }
    }
    if (self.crossed) self.step(command, response, first, rows);
    self.row += rows;
  }
}

Eigen::MatrixXd plant_response(const ModalResponse::Record& command, const std::vector<std::vector<Mode>>& modes,
                               double period_s) {
  Eigen::MatrixXd response(command.rows(), command.cols());
  ModalResponse(modes, period_s).apply(command, response);
  return response;
}

}  // namespace shapegcode
