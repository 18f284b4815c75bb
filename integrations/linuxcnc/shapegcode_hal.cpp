#include "shapegcode_hal.h"

#include <pthread.h>

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

extern "C" {

shapegcode_hal* shapegcode_hal_create(int joints, void (*report)(const char* line)) {
  try {
    return new shapegcode_hal(joints, report);
  } catch (const std::exception& error) {
    report(error.what());
    return nullptr;
  }
}

void shapegcode_hal_destroy(shapegcode_hal* hal) {
  std::this_thread::sleep_for(2 * between_looks);  // a step takes some microseconds
  delete hal;
}

void shapegcode_hal_step(shapegcode_hal* hal, const shapegcode_hal_settings* settings, const double* in, double* out,
                         shapegcode_hal_status* status) {
  hal->step(*settings, in, out, *status);
}

}  // extern "C"
