// Counts what a real-time thread must not do: allocate, give memory back, take or wake what blocks. The linker leads
// these calls of everything that is linked statically to interposer.cpp (see interposer.cmake).
#pragma once

#include <cstddef>

namespace interposer {

struct Calls {
  std::size_t allocations = 0;  ///< operator new, malloc and its kin
  std::size_t releases = 0;     ///< operator delete, free
  std::size_t locks = 0;        ///< mutexes, conditions, semaphores, futexes (any syscall()), guards of static objects
};

/// Of the calling thread, since it began.
[[nodiscard]] Calls calls() noexcept;

[[nodiscard]] inline Calls operator-(const Calls& after, const Calls& before) noexcept {
  return {after.allocations - before.allocations, after.releases - before.releases, after.locks - before.locks};
}
[[nodiscard]] inline Calls operator+(const Calls& one, const Calls& other) noexcept {
  return {one.allocations + other.allocations, one.releases + other.releases, one.locks + other.locks};
}
[[nodiscard]] inline std::size_t all(const Calls& calls) noexcept {
  return calls.allocations + calls.releases + calls.locks;
}

/// Makes one of each kind itself and says which of them it did not see; nullptr if it saw all.
[[nodiscard]] const char* blind_spot();

}  // namespace interposer
