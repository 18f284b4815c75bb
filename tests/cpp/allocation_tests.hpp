// What the sources of allocation_tests share.
#pragma once

#include <cstdio>

#include "interposer.hpp"

inline int failures = 0;

/// Runs `steps`, which returns how many it made, and reports what it allocated, gave back or locked.
template <class Steps>
void expect_none(const char* name, Steps&& steps) {
  const interposer::Calls before = interposer::calls();
  const long done = steps();
  const interposer::Calls made = interposer::calls() - before;
  std::printf("%-44s %8ld steps, %zu allocations, %zu releases, %zu locks\n", name, done, made.allocations,
              made.releases, made.locks);
  if (interposer::all(made) != 0 || done < 100) ++failures;
}

/// A condition without which the rest proves nothing.
inline void expect(bool holds, const char* what) {
  if (holds) return;
  std::printf("not so: %s\n", what);
  ++failures;
}

void check_motion_controller();
void check_c_interface();
void check_program_items();
