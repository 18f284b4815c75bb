#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "machine.hpp"
#include "shapegcode/controller.hpp"
#include "shapegcode/path.hpp"

// A program as a control runs it: one item after the other.

struct Dwell {
  double time_s = 0.0;
};
struct ProgramStop {};
using Item = std::variant<shapegcode::Segment, shapegcode::ControllerEvent, Dwell, ProgramStop>;

/// What an event stands for: the number of its M code, the spindle speed in its word.
inline constexpr std::uint32_t tool_change = 6;

struct Job {
  std::vector<Item> items;
  std::vector<std::string> warnings;  // of the reader
  shapegcode::Vector3 end_mm = shapegcode::Vector3::Zero();
};

/// Reads a program that begins at `start_mm`. G28 leaves the machine where it is: where the reference point lies is not
/// known here. Throws shapegcode::Error with line and message on what cannot be read or run.
Job read_job(const std::string& text, const shapegcode::Vector3& start_mm, const Machine& machine);

/// All segments of a job as one path, against which the deviation is measured.
shapegcode::Path path_of(const Job& job);
