#include <pybind11/stl.h>

#include <memory>
#include <span>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/milling/feed.hpp"
#include "shapegcode/simulation.hpp"
#include "shapegcode/write.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

std::vector<double> numbers(const VectorArray& values) {
  if (values.ndim() != 1) {
    throw Error(ErrorKind::argument, "an array of shape (n,) is needed");
  }
  return {values.data(), values.data() + values.size()};
}

py::array column(const std::vector<double>& values) {
  return py::array_t<double>(static_cast<py::ssize_t>(values.size()), values.data());
}

void register_travel(py::module_& module) {
  py::class_<Travel>(module, "Travel", "Actual speeds along a path, per section from one station to the next.")
      .def_property_readonly(
          "highest_mm_per_s", [](const Travel& self) { return column(self.highest_mm_per_s); },
          "Largest distance within a window, divided by the window, (n,), mm/s. Except in plunges, only travel in XY "
          "in the present direction counts, converted to travel along the path.")
      .def_property_readonly(
          "time_s", [](const Travel& self) { return column(self.time_s); }, "Time on each section, (n,), s.")
      .def_readonly("duration_s", &Travel::duration_s, "Time until the set-points rest, s.");

  module.def(
      "travel_path",
      [](const std::shared_ptr<Path>& path, const std::shared_ptr<SpeedProfile>& profile,
         const std::shared_ptr<Path>& along, const VectorArray& stations, double period_s,
         const std::vector<Fir>& filters, double window_s) {
        const std::vector<double> s = numbers(stations);
        const py::gil_scoped_release release;
        return travel_path(path, profile, *along, s, {period_s, filters, window_s});
      },
      py::arg("path").none(false), py::arg("profile").none(false), py::arg("along").none(false), py::arg("stations_mm"),
      py::arg("period_s"), py::arg("filters") = std::vector<Fir>{}, py::arg("window_s") = 0.0,
      "Actual speeds of a path under a speed profile, followed along `along`, the same path or the one from which it "
      "was made. `stations_mm` (n,) ascend to the length of `along`; `filters` act after the set-points; speeds are "
      "averaged over `window_s`. Raises ArgumentError on stations that do not ascend to that length.");
  module.def(
      "travel_blocks",
      [](const std::shared_ptr<Path>& blocks, const std::shared_ptr<Path>& along, BlockEnd block_end,
         const VectorArray& stations, double period_s, const std::vector<Fir>& filters, double window_s) {
        const std::vector<double> s = numbers(stations);
        const py::gil_scoped_release release;
        return travel_blocks(blocks->segments(), *along, block_end, s, {period_s, filters, window_s});
      },
      py::arg("blocks").none(false), py::arg("along").none(false), py::arg("block_end"), py::arg("stations_mm"),
      py::arg("period_s"), py::arg("filters") = std::vector<Fir>{}, py::arg("window_s") = 0.0,
      "Actual speeds of blocks at their feed, followed along `along`, from which they were made; else as travel_path.");
}

void define_sections(py::module_& module) {
  py::class_<FeedStretch>(module, "FeedStretch", "A section of one feed.")
      .def(py::init<double, double, double>(), py::arg("begin_mm"), py::arg("end_mm"), py::arg("feed_mm_per_min"))
      .def_readonly("begin_mm", &FeedStretch::begin_mm, "Along the path, mm.")
      .def_readonly("end_mm", &FeedStretch::end_mm, "Along the path, mm.")
      .def_readonly("feed_mm_per_min", &FeedStretch::feed_mm_per_min, "mm/min.");
}

void define_schedule(py::module_& module) {
  module.def(
      "schedule_feed",
      [](const VectorArray& ends, const VectorArray& kept, const std::vector<bool>& divisible,
         const VectorArray& stations, const VectorArray& feeds, double least_length_mm, double most_change_mm_per_min,
         double resolution_mm_per_min) {
        const std::vector<double> end = numbers(ends);
        const std::vector<double> keep = numbers(kept);
        if (keep.size() != end.size() || divisible.size() != end.size()) {
          throw Error(ErrorKind::argument, "ends, kept feeds and divisibility must be of one length");
        }
        std::vector<FeedBlock> blocks(end.size());
        for (std::size_t i = 0; i < end.size(); ++i) {
          blocks[i] = {end[i], keep[i], divisible[i]};
        }
        const FeedStations at{numbers(stations), numbers(feeds)};
        const py::gil_scoped_release release;
        return schedule_feed(blocks, at, {least_length_mm, most_change_mm_per_min, resolution_mm_per_min});
      },
      py::arg("block_ends_mm"), py::arg("kept_mm_per_min"), py::arg("divisible"), py::arg("stations_mm"),
      py::arg("feeds_mm_per_min"), py::arg("least_length_mm") = FeedScheduleOptions{}.least_length_mm,
      py::arg("most_change_mm_per_min") = FeedScheduleOptions{}.most_change_mm_per_min,
      py::arg("resolution_mm_per_min") = FeedScheduleOptions{}.resolution_mm_per_min,
      "Feeds of a path for the shortest time within the feeds of the stations: sections not shorter than the minimum "
      "length, each at the lowest feed of its stations. Per block: its end (n,), its fixed feed (0: it may change) and "
      "whether it may be divided. Feeds (m,) are valid up to their station. Raises ArgumentError on values that do not "
      "ascend or are not above 0.");
  module.def(
      "with_feeds",
      [](const std::shared_ptr<Path>& path, const std::vector<FeedStretch>& sections) {
        return std::make_shared<Path>(with_feeds(*path, sections));
      },
      py::arg("path").none(false), py::arg("stretches"),
      "The path with the feeds of the sections `stretches`: segments are divided where a section ends within one. "
      "Raises ArgumentError if they do not cover the path.");
  module.def(
      "look_ahead_on_load",
      [](const VectorArray& stations, const VectorArray& feeds, const VectorArray& load, const VectorArray& before_s,
         const VectorArray& behind_s) {
        FeedStations at{numbers(stations), numbers(feeds)};
        look_ahead_on_load(at, numbers(load), numbers(before_s), numbers(behind_s));
        return column(at.feed_mm_per_min);
      },
      py::arg("stations_mm"), py::arg("feeds_mm_per_min"), py::arg("load_mm_per_min"), py::arg("before_s"),
      py::arg("behind_s"),
      "Returns the feeds (n,), mm/min, lowered around each station that is limited by its load (`load_mm_per_min`, "
      "(n,)), because the motion lags behind a change of feed. A lower feed is commanded earlier by `before_s` (n,) "
      "times the feed that the load allows, a higher one later by `behind_s` (n,) times it.");
}

void define_feed_writer(py::module_& module) {
  py::class_<FeedWriterOptions>(module, "FeedWriterOptions", "How new feeds are written into a region's blocks.")
      .def(py::init([](double increment_mm, double unit_mm, int position_decimals, bool absolute_centres,
                       double modal_feed, bool restore_feed) {
             return FeedWriterOptions{increment_mm,     unit_mm,    position_decimals,
                                      absolute_centres, modal_feed, restore_feed};
           }),
           py::arg("increment_mm"), py::arg("unit_mm"), py::arg("position_decimals"), py::arg("absolute_centres"),
           py::arg("modal_feed") = 0.0, py::arg("restore_feed") = true,
           "`increment_mm`: least increment; `unit_mm`: unit of position words and of the length in F; "
           "`position_decimals`: of a position word; `absolute_centres`: I J K are positions; `modal_feed`: F in "
           "effect before the region (0: as in the original); `restore_feed`: restore the modal feed of the original "
           "at the end.");
  py::class_<RefedRegion>(module, "RefedRegion", "A region's text with other feeds.")
      .def_property_readonly(
          "text", [](const RefedRegion& self) { return py::bytes(self.text); }, "Whole lines.")
      .def_readonly("blocks", &RefedRegion::blocks, "Blocks with a cutting move.")
      .def_readonly("modal_feed", &RefedRegion::modal_feed, "F in effect after it.")
      .def_readonly("lines", &RefedRegion::lines, "Per block its line, counted from 0 for the first of the text.");
  module.def(
      "divisible_segments",
      [](const Program& program, const Region& region, const FeedWriterOptions& options) {
        return divisible_segments(program, region, options);
      },
      py::arg("program").none(false), py::arg("region"), py::arg("options"),
      "Which segments of a region's path may be divided into several blocks.");
  module.def(
      "feeds_per_minute",
      [](const Program& program, const Region& region) { return feeds_per_minute(program, region); },
      py::arg("program").none(false), py::arg("region"),
      "Whether F is a feed per minute in every block of a region, in one unit of length.");
  module.def(
      "write_feeds",
      [](const Program& program, const Region& region, const std::vector<FeedStretch>& sections,
         const FeedWriterOptions& options) { return write_feeds(program, region, sections, options); },
      py::arg("program").none(false), py::arg("region"), py::arg("stretches"), py::arg("options"),
      "The region's lines with the feeds of the sections `stretches`, which cover its path; everything else in them "
      "does not change. Raises ArgumentError if they do not, or if one ends within a block that cannot be divided.");
}

}  // namespace

void register_feed_schedule(py::module_& module) {
  define_sections(module);
  define_schedule(module);
  define_feed_writer(module);
  register_travel(module);
}

}  // namespace shapegcode::bindings
