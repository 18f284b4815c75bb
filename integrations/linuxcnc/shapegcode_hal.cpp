#include "shapegcode_hal.h"

#include <pthread.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <span>
#include <stop_token>
#include <thread>
#include <utility>

#include "grid_shaper.hpp"
#include "switching_filter.hpp"

namespace {

using namespace shapegcode;
using namespace shapegcode::linuxcnc;

static_assert(Wish::max_modes == SHAPEGCODE_HAL_MODES);

constexpr std::chrono::milliseconds between_looks(10);
constexpr std::chrono::microseconds between_polls(50);
constexpr double periods_waited = 20.0;  // for a run of the real-time thread
constexpr std::chrono::duration<double> min_wait(0.01);
constexpr std::chrono::duration<double> max_wait(1.0);

/// A wish as plain words that can be compared and handed over one by one.
using Words = std::array<std::uint64_t, 3 + 2 * Wish::max_modes>;

Words words_of(const shapegcode_hal_settings& settings) noexcept {
  Words words{settings.enabled != 0 ? 1U : 0U, static_cast<std::uint64_t>(settings.family_number),
              std::bit_cast<std::uint64_t>(settings.period_s)};
  for (std::size_t k = 0; k < Wish::max_modes; ++k) {
    words[3 + 2 * k] = std::bit_cast<std::uint64_t>(settings.frequency_hz[k]);
    words[4 + 2 * k] = std::bit_cast<std::uint64_t>(settings.damping_ratio[k]);
  }
  return words;
}

Wish wish_of(const Words& words) noexcept {
  Wish wish{words[0] != 0, static_cast<int>(words[1]), {}, {}};
  for (std::size_t k = 0; k < Wish::max_modes; ++k) {
    wish.frequency_hz[k] = std::bit_cast<double>(words[3 + 2 * k]);
    wish.damping_ratio[k] = std::bit_cast<double>(words[4 + 2 * k]);
  }
  return wish;
}

/// Hands a wish from the real-time thread to the other one; who writes never waits (a sequence lock). The number of a
/// wish is 0 for none and grows by one with each.
class Mailbox {
 public:
  void put(const Words& words) noexcept {
    const std::uint64_t begun = sequence_.load(std::memory_order_relaxed) + 1;
    sequence_.store(begun, std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_release);
    for (std::size_t k = 0; k < words.size(); ++k) words_[k].store(words[k], std::memory_order_relaxed);
    sequence_.store(begun + 1, std::memory_order_release);
  }
  [[nodiscard]] std::uint64_t number() const noexcept { return sequence_.load(std::memory_order_acquire) / 2; }
  /// False while a wish is being written.
  bool get(Words& words, std::uint64_t& number) const noexcept {
    const std::uint64_t begun = sequence_.load(std::memory_order_acquire);
    for (std::size_t k = 0; k < words.size(); ++k) words[k] = words_[k].load(std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_acquire);
    number = begun / 2;
    return begun % 2 == 0 && sequence_.load(std::memory_order_relaxed) == begun;
  }

 private:
  std::atomic<std::uint64_t> sequence_ = 0;
  std::array<std::atomic<std::uint64_t>, std::tuple_size_v<Words>> words_{};
};

static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

}  // namespace

struct shapegcode_hal {
  shapegcode_hal(int n_joints, void (*to_user)(const char*))
      : joints(n_joints),
        report(to_user),
        filter(n_joints),
        designer([this](const std::stop_token& stop) { run(stop); }) {}

  void step(const shapegcode_hal_settings& settings, const double* in, double* out,
            shapegcode_hal_status& status) noexcept {
    const Words wanted = words_of(settings);
    if (wanted != last || wishes.number() == 0) {
      last = wanted;
      wishes.put(wanted);
    }
    const auto count = static_cast<std::size_t>(joints);
    filter.step({in, count}, {out, count}, settings.fade_s > 0.0 ? settings.fade_s / settings.period_s : 0.0);
    const OfferedFilter& active = filter.active();
    const Fir& fir = active.stream.fir();
    const bool impossible = refused.load(std::memory_order_acquire) == wishes.number();
    status.possible = impossible ? 0 : 1;
    const bool designed = settled.load(std::memory_order_acquire) == wishes.number();
    const bool at_work = designed && active.wish == newest_offer.load(std::memory_order_relaxed);
    status.waiting = at_work || impossible ? 0 : 1;
    if (active.wish != described) {
      described = active.wish;
      delay_samples = fir.mean_samples();
    }
    status.delay_s = delay_samples * settings.period_s;
    status.duration_s = fir.duration_samples() * settings.period_s;
  }

  /// The other thread: designs for a wish once it has stood for one look, as pins are set one by one.
  void run(const std::stop_token& stop) {
    // Whatever the thread was that loaded the component.
    const sched_param ordinary{};
    pthread_setschedparam(pthread_self(), SCHED_OTHER, &ordinary);
    std::mutex mutex;
    std::condition_variable_any alarm;
    std::unique_lock lock(mutex);
    std::uint64_t seen = 0;
    std::uint64_t done = 0;
    while (!stop.stop_requested()) {
      alarm.wait_for(lock, stop, between_looks, [] { return false; });
      filter.clean_up();
      Words words{};
      std::uint64_t number = 0;
      if (!wishes.get(words, number)) continue;
      if (number == seen && number != done) {
        fulfil(words, number);
        done = number;
      }
      seen = number;
    }
  }

  void end_designer() {
    designer.request_stop();
    if (designer.joinable()) designer.join();
  }

  void fulfil(const Words& words, std::uint64_t number) {
    try {
      Fir fir = design(wish_of(words), std::bit_cast<double>(words[2]));
      if (fir.taps() != newest.taps() || fir.delays() != newest.delays()) {
        newest = fir;
        newest_offer.store(number, std::memory_order_relaxed);
        filter.offer(std::make_unique<OfferedFilter>(std::move(fir), joints, number));
      }
      settled.store(number, std::memory_order_release);
    } catch (const std::exception& error) {
      report(error.what());
      refused.store(number, std::memory_order_release);
    }
  }

  int joints;
  void (*report)(const char*);
  SwitchingFilter filter;
  Mailbox wishes;
  Words last{};
  std::uint64_t described = 0;
  double delay_samples = 0.0;
  Fir newest{{0}, {1.0}};                       // of the filter offered last; the other thread's own
  std::atomic<std::uint64_t> newest_offer = 0;  // its wish
  std::atomic<std::uint64_t> settled = 0;       // wish that it fulfils: a later one may ask for the same
  std::atomic<std::uint64_t> refused = 0;
  std::jthread designer;  // the last: it uses all of the above
};

namespace {

// The slot is plain C memory, shared by two threads. A run first says that it has begun and then looks for the filter;
// who closes first takes the filter out and then looks which runs have begun: in the one order of these four, a run
// that is not seen does not see the filter.
template <class Value>
std::atomic_ref<Value> shared(Value& value) noexcept {
  static_assert(std::atomic_ref<Value>::is_always_lock_free);
  return std::atomic_ref<Value>(value);
}

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

unsigned long long runs_ended(shapegcode_hal_slot& slot) noexcept {
  return shared(slot.ended).load(std::memory_order_acquire);
}

/// Whether so many runs have ended, looked at for at most so long.
bool wait_for_runs(shapegcode_hal_slot& slot, unsigned long long count, Seconds at_most) {
  const auto end = Clock::now() + at_most;
  while (runs_ended(slot) < count) {
    if (Clock::now() > end) return false;
    std::this_thread::sleep_for(between_polls);
  }
  return true;
}

/// Lets a part of a period pass; a short one without giving the processor away, for it might not come back in time.
void let_pass(Seconds time) {
  if (time > between_polls) return std::this_thread::sleep_for(time);
  for (const auto end = Clock::now() + time; Clock::now() < end;) {
  }
}

/// Waits for the middle of the pause between two runs of a thread that is on time: LinuxCNC takes the function out of
/// the thread's list next, and does not look whether the thread is there.
void wait_for_pause(shapegcode_hal_slot& slot, Seconds period, Seconds at_most) {
  const auto begin = Clock::now();
  auto last = begin - at_most;  // when the run before was seen to have ended
  unsigned long long seen = runs_ended(slot);
  while (Clock::now() < begin + at_most) {
    const auto before = Clock::now();
    let_pass(period / 20);
    const unsigned long long number = runs_ended(slot);
    if (number == seen) continue;
    const bool is_next = number == std::exchange(seen, number) + 1;
    const Seconds since_last = before - std::exchange(last, before);
    const bool is_on_time = is_next && since_last > 0.75 * period && since_last < 1.25 * period;
    let_pass(period / 5);
    if (is_on_time && Clock::now() < before + period / 2 && shared(slot.begun).load() == number) return;
  }
}

}  // namespace

extern "C" {

int shapegcode_hal_open(shapegcode_hal_slot* slot, int joints, void (*report)(const char* line)) {
  try {
    auto hal = std::make_unique<shapegcode_hal>(joints, report);
    shared(slot->hal).store(hal.release());
    return 0;
  } catch (const std::exception& error) {
    report(error.what());
    return -1;
  }
}

void shapegcode_hal_run(shapegcode_hal_slot* slot, int joints, const shapegcode_hal_settings* settings,
                        const double* in, double* out, shapegcode_hal_status* status) {
  const unsigned long long number = shared(slot->ended).load(std::memory_order_relaxed) + 1;
  shared(slot->period_s).store(settings->period_s, std::memory_order_relaxed);
  shared(slot->begun).store(number);
  if (shapegcode_hal* hal = shared(slot->hal).load(); hal != nullptr) {
    hal->step(*settings, in, out, *status);
  } else {
    std::copy_n(in, joints, out);
    *status = {1, 0, 0.0, 0.0};
  }
  shared(slot->ended).store(number, std::memory_order_release);
}

shapegcode_hal_closed shapegcode_hal_close(shapegcode_hal_slot* slot) {
  if (shapegcode_hal* hal = shared(slot->hal).exchange(nullptr); hal != nullptr) slot->leaving = hal;
  const unsigned long long begun = shared(slot->begun).load();
  const bool is_free = wait_for_runs(*slot, begun, max_wait);
  if (slot->leaving != nullptr) slot->leaving->end_designer();
  if (!is_free) return SHAPEGCODE_HAL_IN_USE;
  delete std::exchange(slot->leaving, nullptr);
  if (begun == 0) return SHAPEGCODE_HAL_NOT_RUNNING;
  const Seconds period(shared(slot->period_s).load(std::memory_order_relaxed));
  const Seconds patience = std::clamp(periods_waited * period, min_wait, max_wait);
  if (!wait_for_runs(*slot, begun + 1, patience)) return SHAPEGCODE_HAL_NOT_RUNNING;
  wait_for_pause(*slot, period, patience);
  return SHAPEGCODE_HAL_ACKNOWLEDGED;
}

}  // extern "C"
