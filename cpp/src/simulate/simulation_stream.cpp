#include "shapegcode/simulation_stream.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include <fmt/format.h>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/motion.hpp"
#include "simulate/axis_plant.hpp"
#include "simulate/filter_chain.hpp"
#include "simulate/program_set_points.hpp"

namespace shapegcode {
namespace {

using detail::SetPoint;

// Set-points after the filters, one per call; false after the last.
using Source = std::function<bool(SetPoint&)>;

// Set-points of one run from rest to rest, then so many at rest as its filters need.
template <class Motion>
class FilteredRun {
 public:
  FilteredRun(Motion interpolator, const SimulationOptions& options)
      : motion_(std::move(interpolator)), filters_(options.axis_filters) {}

  template <class LineOf>
  bool step(SetPoint& next, LineOf&& line_of) {
    Vector3 position = end_;
    if (motion_.step(position)) {
      if (!started_) {
        started_ = true;
        filters_.reset(position);
      }
      next.line = line_of(motion_);
      end_ = position;
    } else if (started_ && drained_ < filters_.tail()) {
      ++drained_;
      position = end_;
    } else {
      return false;
    }
    filters_.step(position);
    next.position_mm = position;
    return true;
  }

 private:
  Motion motion_;
  detail::FilterChain filters_;
  Vector3 end_ = Vector3::Zero();
  int drained_ = 0;
  bool started_ = false;
};

}  // namespace

struct SimulationStream::Impl {
  Impl(Source set_points, const SimulationOptions& options, double rest_s, std::vector<Vector3> offsets = {})
      : source(std::move(set_points)),
        rate_hz(1.0 / options.period_s),
        plant(options),
        region_offsets_mm(std::move(offsets)) {
    require_not_below_zero(rest_s, "rest", "s");
    const double rest = whole_periods(rest_s / options.period_s);
    rest_samples = static_cast<std::uint64_t>(require_count(rest, max_set_points, "rest", "set-points"));
  }

  [[nodiscard]] Vector3 offset(std::size_t of) const {
    return of < region_offsets_mm.size() ? region_offsets_mm[of] : Vector3::Zero();
  }

  // The next sample goes into `now` and `response`; false behind the end.
  bool step() {
    if (moving && !source(now)) {
      moving = false;
      now.jump_mm.setZero();
    }
    if (!moving) {
      if (sample == 0 || rest_samples == 0) {
        return false;
      }
      --rest_samples;
    }
    if (sample == 0) {
      region = now.region;
      plant.reset(now.position_mm + offset(region));
    } else if (now.region != region || now.jump_mm != Vector3::Zero()) {
      plant.shift(now.jump_mm + offset(now.region) - offset(region));
      region = now.region;
    }
    velocity = sample == 0 ? Vector3(Vector3::Zero()) : Vector3((now.position_mm - last - now.jump_mm) * rate_hz);
    last = now.position_mm;
    const Vector3 there = offset(region);
    response = plant.step(now.position_mm + there) - there;
    ++sample;
    return true;
  }

  Source source;
  double rate_hz;
  detail::AxisPlant plant;
  std::vector<Vector3> region_offsets_mm;
  std::uint64_t rest_samples = 0;
  std::uint64_t sample = 0;
  std::size_t region = 0;
  bool moving = true;
  SetPoint now;
  Vector3 response = Vector3::Zero();
  Vector3 velocity = Vector3::Zero();  // mm/s
  Vector3 last = Vector3::Zero();
};

SimulationStream::SimulationStream(std::shared_ptr<const Path> path, std::shared_ptr<const SpeedProfile> profile,
                                   const SimulationOptions& options, double rest_s) {
  auto run =
      std::make_shared<FilteredRun<Interpolator>>(Interpolator(path, std::move(profile), options.period_s), options);
  impl_ = std::make_unique<Impl>(
      [run, path](SetPoint& next) {
        return run->step(next, [&path](const Interpolator& interpolator) {
          return path->size() > 0 ? path->line(interpolator.segment()) : 0U;
        });
      },
      options, rest_s);
}

SimulationStream::SimulationStream(std::shared_ptr<const Path> blocks, BlockEnd block_end, double override_ratio,
                                   const SimulationOptions& options, double rest_s) {
  auto run = std::make_shared<FilteredRun<BlockInterpolator>>(
      BlockInterpolator(blocks->segments(), options.period_s, block_end, override_ratio), options);
  impl_ = std::make_unique<Impl>(
      [run, blocks](SetPoint& next) {
        return run->step(
            next, [&blocks](const BlockInterpolator& interpolator) { return (*blocks)[interpolator.block()].line; });
      },
      options, rest_s);
}

SimulationStream::SimulationStream(std::shared_ptr<const Program> program, const FanucModel& model,
                                   const SimulationOptions& options, std::vector<Vector3> region_offsets_mm,
                                   double rest_s) {
  if (!region_offsets_mm.empty() && region_offsets_mm.size() != program->regions.size()) {
    throw Error(ErrorKind::argument, fmt::format("{} offsets for {} regions: must be one for each",
                                                 region_offsets_mm.size(), program->regions.size()));
  }
  if (options.period_s != model.period_s) {
    throw Error(ErrorKind::argument, fmt::format("plant with a period of {} s on a controller of {} s: must be equal",
                                                 options.period_s, model.period_s));
  }
  // What the set-points refer to lives with them.
  struct ProgramMotion {
    ProgramMotion(std::shared_ptr<const Program> text, const FanucModel& controller)
        : program(std::move(text)),
          model(controller),
          set_points(*program, model, detail::ProgramSetPoints::Waits::full) {}
    std::shared_ptr<const Program> program;
    FanucModel model;
    detail::ProgramSetPoints set_points;
  };
  auto motion = std::make_shared<ProgramMotion>(std::move(program), model);
  impl_ = std::make_unique<Impl>([motion](SetPoint& next) { return motion->set_points.step(next); }, options, rest_s,
                                 std::move(region_offsets_mm));
}

SimulationStream::~SimulationStream() = default;
SimulationStream::SimulationStream(SimulationStream&&) noexcept = default;
SimulationStream& SimulationStream::operator=(SimulationStream&&) noexcept = default;

SimulationChunk SimulationStream::read(std::size_t most) {
  SimulationChunk chunk;
  chunk.first_sample = impl_->sample;
  const std::vector<FeedDrive>& drives = impl_->plant.drives();
  std::vector<Eigen::MatrixXd*> columns = {&chunk.command_mm, &chunk.response_mm, &chunk.velocity_mm_per_s};
  if (!drives.empty()) {
    columns.insert(columns.end(), {&chunk.motor_mm, &chunk.motor_force_n, &chunk.friction_force_n});
  }
  for (Eigen::MatrixXd* column : columns) {
    column->resize(static_cast<Eigen::Index>(most), axis_count);
  }
  chunk.line.reserve(most);
  chunk.kind.reserve(most);
  while (chunk.line.size() < most && impl_->step()) {
    const auto row = static_cast<Eigen::Index>(chunk.line.size());
    chunk.command_mm.row(row) = impl_->now.position_mm;
    chunk.response_mm.row(row) = impl_->response;
    chunk.velocity_mm_per_s.row(row) = impl_->velocity;
    for (std::size_t i = 0; i < drives.size(); ++i) {
      const auto axis = static_cast<Eigen::Index>(i);
      chunk.motor_mm(row, axis) = drives[i].motor_mm() - impl_->offset(impl_->region)[axis];
      chunk.motor_force_n(row, axis) = drives[i].motor_force_n();
      chunk.friction_force_n(row, axis) = drives[i].friction_force_n();
    }
    chunk.line.push_back(impl_->now.line);
    chunk.kind.push_back(impl_->now.kind);
  }
  if (chunk.size() < most) {
    for (Eigen::MatrixXd* column : columns) {
      column->conservativeResize(static_cast<Eigen::Index>(chunk.size()), axis_count);
    }
  }
  return chunk;
}

}  // namespace shapegcode
