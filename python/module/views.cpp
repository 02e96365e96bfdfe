// SPDX-License-Identifier: Apache-2.0
// Pages on which a run moves, which tangere/_view.py shows in a notebook, and pictures of files.
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "io/files/jpeg_file.hpp"
#include "io/view/view_page.hpp"
#include "io/view/view_reader.hpp"
#include "io/view/view_run.hpp"
#include "python/module/arrays.hpp"
#include "python/module/module.hpp"
#include "python/module/whole_number.hpp"

namespace tangere::python {

using nb::literals::operator""_a;

namespace {

std::string page_of_file(const std::filesystem::path& path,
                         const std::optional<Whole<std::int64_t>>& episode,
                         const Whole<int>& episodes, const Whole<int>& frames) {
  ViewOptions options;
  if (episode) options.episode = episode->value("episode");
  options.episodes = episodes.value("episodes");
  options.frames = frames.value("frames");
  const nb::gil_scoped_release free;
  return render_view_page(read_view(path.string(), options));
}

std::string page_of_run(const Model& model, const Argument<double>& time,
                        const std::vector<std::int64_t>& environments,
                        const std::vector<std::string>& names, const Argument<double>& values,
                        const Argument<double>& q,
                        const std::map<std::string, Argument<double>>& fields,
                        const Whole<int>& frames) {
  const std::size_t count = environments.size();
  ViewRun run{.time = numbers_of(time, {time.size()}, "time"),
              .environments = environments,
              .names = names,
              .values = numbers_of(values, {count, names.size()}, "values"),
              .q = numbers_of(q, {count, time.size(), as_size(model.nq())}, "q")};
  for (const auto& [name, field] : fields) run.fields[name] = {field.data(), field.size()};
  ViewOptions options;
  options.frames = frames.value("frames");
  const nb::gil_scoped_release free;
  return render_view_page(view_run(model, run, options));
}

/// (n, rows, cols, 3) of n JPEG files of one size.
Array<std::uint8_t> decode_jpeg(const std::vector<nb::bytes>& files, const std::string& name) {
  const auto bytes_of = [](const nb::bytes& file) { return std::span(file.c_str(), file.size()); };
  const auto title = [&](std::size_t k) { return fmt::format("{}: picture {}", name, k); };
  const JpegSize size = files.empty() ? JpegSize{} : jpeg_size(bytes_of(files[0]), title(0));
  const std::size_t each = std::size_t{3} * as_size(size.rows) * as_size(size.cols);
  std::span<std::uint8_t> levels;
  Array<std::uint8_t> pictures =
      new_array<std::uint8_t>({files.size(), as_size(size.rows), as_size(size.cols), 3}, levels);
  std::vector<std::span<const char>> all;
  for (const nb::bytes& file : files) all.push_back(bytes_of(file));
  const nb::gil_scoped_release free;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Photograph one = parse_jpeg(all[k], title(k));
    if (JpegSize{one.rows, one.cols} != size)
      throw InputError(fmt::format("{} of {} x {} pixels; expected {} x {}", title(k), one.rows,
                                   one.cols, size.rows, size.cols));
    std::copy(one.levels.begin(), one.levels.end(), levels.begin() + std::ptrdiff_t(k * each));
  }
  return pictures;
}

}  // namespace

void add_views(nb::module_& m) {
  m.def("decode_jpeg", decode_jpeg, "files"_a, "name"_a = "",
        "Pictures (n, rows, cols, 3) uint8 of n JPEG files, bytes each, of one size. `name`: of "
        "their\n"
        "place, for messages. InputError: bytes are no JPEG, or sizes differ.");
  m.def("view_file", page_of_file, "path"_a, "episode"_a = nb::none(), "episodes"_a = 16,
        "frames"_a = 1000, "The page of `tangere view` for a file or folder, as HTML.");
  m.def("view_run", page_of_run, "model"_a, "time"_a, "environments"_a, "names"_a, "values"_a,
        "q"_a, "fields"_a, "frames"_a = 1000,
        "The same for a run in memory: time (F), values (k, names), q (k, F, nq), fields\n"
        "sensor → (k, F, points, 3).");
}

}  // namespace tangere::python
