#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "shapegcode/filter.hpp"

namespace shapegcode::linuxcnc {

/// A filter and the number of the wish that it fulfils.
struct OfferedFilter {
  OfferedFilter(Fir fir, int n_joints, std::uint64_t wish_number)
      : stream(std::move(fir), n_joints), wish(wish_number) {}

  FirStream stream;
  std::uint64_t wish;
};

/// A filter that is exchanged for another one while it runs. One thread steps it (real-time: no allocation, no
/// exception, no lock), another one offers filters and takes back those that are done with; both by an atomic exchange.
///
/// A new filter first runs along until it has seen as many samples as it lasts, so that it gives what it would have
/// given had it always run. Then one of two things: without a fade it waits until the input has not moved for as long
/// as either filter lasts: both outputs are the input then, and nothing moves. With a fade of F seconds the output goes
/// over from one to the other with a weight w(t/F) whose first two derivatives are continuous: at a steady speed v
/// and mean delays that differ by d, the speed changes by at most 1.875*v*d/F and the acceleration by 5.78*v*d/F^2.
class SwitchingFilter {
 public:
  /// Passes the input on. Throws Error(argument) on n_joints < 1.
  explicit SwitchingFilter(int n_joints);
  ~SwitchingFilter();
  SwitchingFilter(const SwitchingFilter&) = delete;
  SwitchingFilter& operator=(const SwitchingFilter&) = delete;

  /// Real-time thread: n_joints values in, as many out. `fade_samples` 0: wait for rest.
  void step(std::span<const double> in, std::span<double> out, double fade_samples) noexcept;
  /// The filter whose output is given; while one fades into another, the old one. Real-time thread.
  [[nodiscard]] const OfferedFilter& active() const noexcept { return *active_; }

  /// Other thread: the next filter. One that was offered before and not taken yet is forgotten.
  void offer(std::unique_ptr<OfferedFilter> filter) noexcept;
  /// Other thread: destroys what is done with.
  void clean_up() noexcept;

 private:
  void take_offer(std::span<const double> in) noexcept;
  void blend_in(std::span<const double> in, std::span<double> out, double fade_samples) noexcept;

  std::unique_ptr<OfferedFilter> active_;
  std::unique_ptr<OfferedFilter> next_;
  std::atomic<OfferedFilter*> offered_ = nullptr;
  std::atomic<OfferedFilter*> retired_ = nullptr;
  std::vector<double> last_, blended_;
  bool started_ = false;
  std::int64_t still_ = 0;  // samples since the input last moved
  std::int64_t warm_ = 0;   // samples that `next_` has seen
  double faded_ = 0.0;      // share of the fade that is over
};

}  // namespace shapegcode::linuxcnc
