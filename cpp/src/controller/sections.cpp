#include "controller/sections.hpp"

#include <algorithm>

namespace shapegcode {

void Sections::restart(const PlannedPoint& point) noexcept {
  Section& rest = slots_[0];
  rest.after = 0;
  rest.start = rest.count = rest.whole_count = 0;
  rest.first_period = rest.serial = 0;
  rest.done = point.point.segment;
  rest.runs_out = rest.is_bound = false;
  rest.before.fill(point);
  std::ranges::fill(rest.past, Vector3(point.position[0], point.position[1], point.position[2]));
  slot_of_.fill(0);
  current_ = 0;
  next_ = 1;
  slot_ = index_ = 0;
  was_late_ = was_refused_ = false;
  published_.store(1, std::memory_order_relaxed);
  say();
}

Sections::Reader Sections::reader() const noexcept {
  const std::uint64_t word = reader_.load(std::memory_order_acquire);
  Reader reader;
  reader.section = static_cast<std::uint32_t>(word % numbers);
  reader.next = static_cast<std::uint32_t>((word >> number_bits) % numbers);
  reader.slot = static_cast<std::size_t>((word >> (2 * number_bits)) % (1U << slot_bits));
  reader.index = static_cast<std::size_t>(word >> (2 * number_bits + slot_bits));
  return reader;
}

std::uint32_t Sections::last_behind(const Reader& reader) const noexcept {
  std::uint32_t last = reader.section;
  std::size_t index = reader.index;
  for (std::uint32_t number = reader.next; number != next_number(); number = (number + 1) % numbers) {
    const Section& next = section(number);
    if (next.after != last || next.start < index) continue;
    last = number;
    index = 0;
  }
  return last;
}

void Sections::say() noexcept {
  const std::uint64_t word = (static_cast<std::uint64_t>(index_) << (2 * number_bits + slot_bits)) |
                             (static_cast<std::uint64_t>(slot_) << (2 * number_bits)) |
                             (static_cast<std::uint64_t>(next_) << number_bits) | current_;
  reader_.store(word, std::memory_order_release);
}

Section* Sections::free_section() noexcept {
  const Reader reader = this->reader();
  std::uint32_t used = 1U << reader.slot;
  const std::uint32_t end = published_.load(std::memory_order_relaxed);
  for (std::uint32_t number = reader.next; number != end; number = (number + 1) % numbers)
    used |= 1U << slot_of(number);
  for (std::size_t slot = 0; slot < slots_.size(); ++slot) {
    if ((used >> slot) % 2 != 0) continue;
    free_ = static_cast<std::uint8_t>(slot);
    return &slots_[slot];
  }
  return nullptr;
}

void Sections::publish() noexcept {
  const std::uint32_t number = published_.load(std::memory_order_relaxed);
  slot_of_[number % slot_of_.size()] = free_;
  published_.store((number + 1) % numbers, std::memory_order_release);
}

const PlannedPoint& Sections::step(bool stopping, const SoftLimits& travel) noexcept {
  was_refused_ = false;
  const std::uint32_t end = published_.load(std::memory_order_acquire);
  for (; next_ != end; next_ = (next_ + 1) % numbers) {
    const Section& next = section(next_);
    if (next.after != current_ || next.start < index_) continue;
    if (next.start > index_ || stopping) break;
    was_refused_ = !travel.hold(next.low, next.high, point().position);
    if (was_refused_) break;
    current_ = next_;
    slot_ = slot_of(next_);
    index_ = 0;
    next_ = (next_ + 1) % numbers;
    break;
  }
  const Section& now = current();
  was_late_ = !stopping && !was_refused_ && index_ == now.count && now.whole_count > now.count;
  if (index_ < now.whole_count && !now.is_bound) ++index_;
  say();
  return point();
}

}  // namespace shapegcode
