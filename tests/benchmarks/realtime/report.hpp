// What was measured, as text while it comes and as JSON at the end.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "runs.hpp"

namespace realtime {

class Report {
 public:
  void machine(const std::vector<std::string>& lines, const std::string& memory, const std::string& sleep);
  void free_run(const FreeRun& run, std::size_t window, double others_cores);
  /// Table of push() of the windows so far.
  void pushes();
  void repeated(const Repeated& found);
  void other_calls(const OtherCalls& found);
  void periodic(const Periodic& found, double minutes);
  void simulated(const Simulated& found);

  /// Nothing drifted, allocated, locked or starved. How fast it was is not asked here.
  [[nodiscard]] bool sound() const noexcept { return sound_; }
  void write_json(const std::string& file) const;

 private:
  void calls(const char* who, const interposer::Calls& calls);
  void expect(bool holds, const char* what);
  void add(const std::string& key, const std::string& value);

  std::string json_;
  std::string push_rows_;
  bool sound_ = true;
};

}  // namespace realtime
