// SPDX-License-Identifier: Apache-2.0
// A demo of a data set is an episode of the page: its rows, then the state after the last action.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>

#include "engine/base/error.hpp"
#include "io/dataset/dataset_description.hpp"
#include "io/dataset/dataset_files.hpp"
#include "io/dataset/learner_notes.hpp"
#include "io/files/jpeg_file.hpp"
#include "io/view/view_pictures.hpp"
#include "io/view/view_source.hpp"

namespace tangere {
namespace {

constexpr std::int64_t kMostRows = std::int64_t{1} << 31;  // of a demo; more is damage

/// A demo and the file that has it.
struct Demo {
  std::string file;
  std::int64_t number, rows;
};

/// Whether a file has this text.
bool has_text(const std::filesystem::path& path, const std::string& text) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(path, none) ||  // a device might never end
      std::filesystem::file_size(path, none) != text.size())
    return false;
  std::ifstream file(path, std::ios::binary);
  const std::string found{std::istreambuf_iterator<char>(file), {}};
  return file && found == text;
}

/// The scene that a command "tangere generate SCENE --episodes …" names, if it has this text. If it
/// has not, a file of the same name in the data set's folder, or beside that: folders are moved.
std::string scene_of_command(const std::string& command, const std::string& text,
                             const std::string& dataset) {
  constexpr std::string_view kBegin = "tangere generate ", kEnd = " --episodes ";
  const std::size_t end = command.find(kEnd);
  if (!command.starts_with(kBegin) || end == std::string::npos) return "";
  const std::filesystem::path path(command.substr(kBegin.size(), end - kBegin.size()));
  const std::filesystem::path set = std::filesystem::absolute(dataset).lexically_normal(),
                              folder = std::filesystem::is_directory(set) ? set : set.parent_path(),
                              inner = folder.has_filename() ? folder : folder.parent_path();
  for (const std::filesystem::path& place :
       {path, inner / path.filename(), inner.parent_path() / path.filename()})
    if (has_text(place, text)) return place.string();
  return "";
}

class DatasetView {
 public:
  DatasetView(const std::string& path, const ViewOptions& options)
      : options_(options), path_(path), dataset_(find_dataset(path)) {
    add_merged_inputs(dataset_);
  }

  ViewData read() {
    choose_demos();
    const h5::Id file = h5::open_file(demos_.front().file), scene = h5::open_group(file, "scene");
    if (H5Aexists(scene.get(), "text") <= 0)
      throw IoError(fmt::format("{}: /scene has no text: the file does not hold its scene",
                                demos_.front().file));
    data_.title = h5::read_text(scene, "name"), data_.source = path_, data_.kind = "data set";
    scene_ = stored_scene(file, scene);
    data_.scene = scene_->scene();
    q_names_ = h5::read_texts(scene, "q_names");
    scene_->check_names(q_names_);
    if (H5Aexists(scene.get(), "randomized_names") > 0)
      randomized_ = h5::read_texts(scene, "randomized_names");
    interval_ = h5::read_number<double>(scene, "timestep") *
                static_cast<double>(h5::read_number<std::int64_t>(scene, "every"));
    take_sensors(file);
    std::vector<std::int64_t> rows;
    for (const Demo& demo : demos_) rows.push_back(demo.rows + 1);
    const std::size_t traces = q_names_.size() + 2 * data_.sensors.size() + 1;
    find_pictures(file);
    data_.stride = stride_for(rows, numbers_per_frame(data_.scene, data_.sensors, traces),
                              pictures_.empty() ? options_ : beside_pictures(options_));
    if (!pictures_.empty()) sample_pictures(rows);
    for (const Demo& demo : demos_) add_demo(demo);
    if (!pictures_.empty()) thin_pictures(data_, every_picture_, options_);
    return std::move(data_);
  }

 private:
  /// With the texts of <include> that it stores. Meshes and tables are beside the scene's file, if
  /// that is still where the command of the data set names it.
  [[nodiscard]] std::unique_ptr<ViewScene> stored_scene(const h5::Id& file, const h5::Id& scene) {
    const std::string text = h5::read_text(scene, "text");
    IncludedTexts included;
    if (H5Aexists(scene.get(), "included") > 0)
      included = included_texts_in(h5::read_text(scene, "included"));
    const std::string command =
        H5Aexists(file.get(), "command") > 0 ? h5::read_text(file, "command") : "";
    const std::string path = scene_of_command(command, text, path_);
    return std::make_unique<ViewScene>(text, path.empty() ? data_.title : path, path_, options_,
                                       included);
  }

  void choose_demos() {
    std::size_t all = 0;
    for (const std::string& path : dataset_.files) {
      const h5::Id file = h5::open_file(path), data = h5::open_group(file, "data");
      for (const std::int64_t number : demo_numbers(data)) {
        ++all;
        if (options_.episode ? number != *options_.episode
                             : demos_.size() == static_cast<std::size_t>(options_.episodes))
          continue;
        const h5::Id demo = h5::open_group(data, fmt::format("demo_{}", number));
        const auto rows = h5::read_number<std::int64_t>(demo, "num_samples");
        if (rows < 1 || rows > kMostRows)
          throw IoError(
              fmt::format("{}: demo_{} has {} rows; expected 1 or more", path, number, rows));
        demos_.push_back({path, number, rows});
      }
    }
    if (demos_.empty() && options_.episode)
      throw InputError(fmt::format(
          "'{}' has no episode {}, or it failed; 'tangere info' says how many there are", path_,
          *options_.episode));
    if (demos_.empty()) throw IoError(path_ + ": no episode that did not fail, so nothing to show");
    if (!options_.episode && demos_.size() < all)
      data_.notes.push_back(fmt::format("The first {} of {} episodes.", demos_.size(), all));
    for (const std::string& missing : dataset_.missing)
      data_.notes.push_back(fmt::format("Shard '{}' is missing.", missing));
  }

  /// Takes the sensors that demos have fields of.
  void take_sensors(const h5::Id& file) {
    const h5::Id obs = h5::open_group(
        h5::open_group(h5::open_group(file, "data"), fmt::format("demo_{}", demos_.front().number)),
        "obs");
    if (!h5::has_link(obs, "q"))
      throw IoError(
          fmt::format("{}: demo_{} has no obs/q, so nothing says where bodies are; record "
                      "it: tangere generate --record q",
                      demos_.front().file, demos_.front().number));
    const h5::Id scene = h5::open_group(file, "scene");
    const auto steps = h5::read_number<std::int64_t>(scene, "steps"),
               every = h5::read_number<std::int64_t>(scene, "every");
    if (every < 1) throw IoError(fmt::format("{}: a row every {} steps", path_, every));
    const std::vector<StoredSample> samples = stored_samples(scene, every, steps / every);
    const std::vector<StoredWindow> windows = stored_windows(scene, every);
    for (ViewSensor& sensor : scene_->sensors()) {
      std::string name;
      for (const std::string& reading : {sensor.name, sensor.name + ".ideal"})
        if (name.empty() && h5::has_link(obs, reading) && is_reading(scene, sensor.name, reading))
          name = reading;
      std::optional<StoredSample> sampled;
      for (const StoredSample& sample : samples)
        if (name.empty() && (sample.name == sensor.name || sample.name == sensor.name + ".ideal"))
          sampled = sample, name = sample.name;
      if (name.empty() || !h5::has_link(scene, "sensors")) {
        data_.notes.push_back(
            fmt::format("The field of sensor '{}' was not recorded.", sensor.name));
        continue;
      }
      const h5::Id group = h5::open_group(h5::open_group(scene, "sensors"), sensor.name);
      signs_.push_back(static_cast<int>(h5::read_number<std::int64_t>(group, "pressure_sign")));
      readings_.push_back(name);
      sampled_.push_back(sampled);
      const auto window = std::find_if(windows.begin(), windows.end(),
                                       [&](const StoredWindow& each) { return each.name == name; });
      windows_.push_back(window == windows.end() ? 1 : window->readings);
      data_.sensors.push_back(std::move(sensor));
    }
  }

  /// Whether an observation is a reading of a sensor. Those of a task have names of their own,
  /// which may be those of sensors.
  [[nodiscard]] bool is_reading(const h5::Id& scene, const std::string& sensor,
                                const std::string& name) const {
    if (value_of(dataset_.settings, "policy").empty()) return true;
    if (!h5::has_link(scene, "sensors")) return false;
    const h5::Id group = h5::open_group(h5::open_group(scene, "sensors"), sensor);
    if (H5Aexists(group.get(), "readings") <= 0) return false;
    const std::vector<std::string> readings = h5::read_texts(group, "readings");
    return std::find(readings.begin(), readings.end(), name) != readings.end();
  }

  /// Lists the pictures in colours: observations of bytes, (rows, height, width, 3).
  void find_pictures(const h5::Id& file) {
    const h5::Id scene = h5::open_group(file, "scene"),
                 demo = h5::open_group(h5::open_group(file, "data"),
                                       fmt::format("demo_{}", demos_.front().number));
    const auto take = [&](const char* group, const std::string& name,
                          const std::optional<StoredSample>& sampled) {
      const h5::Id dataset = h5::open_dataset(h5::open_group(demo, group), name),
                   type(H5Dget_type(dataset.get()));
      const h5::Dims dims = h5::dimensions(dataset);
      if (h5::has_files(dataset) && dims.size() == 1 && dims[0] > 0) {
        const JpegSize size =
            jpeg_size(h5::read_files(dataset, 0, 1).front(), h5::place_of(dataset));
        data_.pictures.push_back({name, size.rows, size.cols});
        pictures_.push_back(sampled);
        return;
      }
      if (H5Tget_class(type.get()) != H5T_INTEGER || H5Tget_size(type.get()) != 1 ||
          dims.size() != 4 || dims[3] != 3)
        return;
      data_.pictures.push_back({name, static_cast<int>(dims[1]), static_cast<int>(dims[2])});
      pictures_.push_back(sampled);
    };
    for (const std::string& name : h5::read_texts(scene, "observations")) take("obs", name, {});
    const auto steps = h5::read_number<std::int64_t>(scene, "steps"),
               every = h5::read_number<std::int64_t>(scene, "every");
    for (const StoredSample& sample : stored_samples(scene, every, steps / every))
      take("samples", sample.name, sample);
  }

  /// Finds how many pictures the page has room for.
  void sample_pictures(const std::vector<std::int64_t>& rows) {
    std::vector<std::string> samples;
    const h5::Id file = h5::open_file(demos_.front().file),
                 demo = h5::open_group(h5::open_group(file, "data"),
                                       fmt::format("demo_{}", demos_.front().number));
    for (std::size_t p = 0; p < pictures_.size(); ++p)
      samples.push_back(page_picture(data_.pictures[p], read_picture(p, demos_.front(), demo, 0)));
    std::int64_t frames = 0;
    for (const std::int64_t count : rows) frames += std::ssize(frames_of(count, data_.stride));
    every_picture_ = picture_stride(samples, frames, options_);
  }

  /// Picture k of an episode: a row of obs, then that of final_obs; or a sample.
  [[nodiscard]] std::vector<std::uint8_t> read_picture(std::size_t p, const Demo& which,
                                                       const h5::Id& demo, std::int64_t k) const {
    const ViewPicture& picture = data_.pictures[p];
    const bool at_end = !pictures_[p] && k == which.rows;
    const std::int64_t rows = at_end ? 1 : pictures_[p] ? pictures_[p]->rows : which.rows;
    const h5::Id dataset = h5::open_dataset(h5::open_group(demo, pictures_[p] ? "samples"
                                                                 : at_end     ? "final_obs"
                                                                              : "obs"),
                                            picture.name);
    if (h5::has_files(dataset)) {
      check_shape(dataset, {static_cast<hsize_t>(rows)}, picture.name);
      const std::string file =
          h5::read_files(dataset, at_end ? 0 : static_cast<hsize_t>(k), 1).front();
      Photograph shown = parse_jpeg(file, h5::place_of(dataset));
      if (shown.rows != picture.rows || shown.cols != picture.cols)
        throw IoError(fmt::format("{}: a picture of {} x {} pixels; expected {} x {}",
                                  h5::place_of(dataset), shown.rows, shown.cols, picture.rows,
                                  picture.cols));
      return std::move(shown.levels);
    }
    const h5::Dims shape{static_cast<hsize_t>(rows), static_cast<hsize_t>(picture.rows),
                         static_cast<hsize_t>(picture.cols), 3};
    check_shape(dataset, shape, picture.name);
    std::vector<std::uint8_t> levels(shape[1] * shape[2] * shape[3]);
    h5::read_box<std::uint8_t>(dataset, {at_end ? 0 : static_cast<hsize_t>(k), 0, 0, 0},
                               {1, shape[1], shape[2], shape[3]}, levels.data());
    return levels;
  }

  void add_shown(std::size_t p, const Demo& which, const h5::Id& demo, ViewEpisode& episode) {
    std::vector<std::int64_t> taken;  // rows
    for (std::int64_t row = 0; row <= which.rows; ++row)
      if (!pictures_[p] || pictures_[p]->times.at(row, which.rows)) taken.push_back(row);
    add_pictures(
        data_.pictures[p], taken, [&](std::int64_t k) { return read_picture(p, which, demo, k); },
        every_picture_, episode);
  }

  void add_demo(const Demo& which) {
    const h5::Id file = h5::open_file(which.file);
    const h5::Id demo =
        h5::open_group(h5::open_group(file, "data"), fmt::format("demo_{}", which.number));
    const h5::Id obs = h5::open_group(demo, "obs"), end = h5::open_group(demo, "final_obs");
    ViewNumbers numbers;
    if (!randomized_.empty()) numbers = {randomized_, h5::read_numbers<double>(demo, "randomized")};
    ViewEpisode episode;
    episode.label = fmt::format("episode {}", which.number);
    episode.shapes = scene_->begin_episode(numbers, data_);
    episode.rows = frames_of(which.rows + 1, data_.stride);
    episode.traces = coordinate_traces(q_names_, scene_->q_units());
    const auto rows = static_cast<hsize_t>(which.rows);
    const h5::Id q = h5::open_dataset(obs, "q"), last = h5::open_dataset(end, "q");
    check_shape(q, {rows, q_names_.size()}, "obs/q");
    check_shape(last, {1, q_names_.size()}, "final_obs/q");
    for (const std::int64_t row : episode.rows) {
      episode.time.push_back(static_cast<float>(static_cast<double>(row) * interval_));
      const std::vector<double> state = row < which.rows ? row_numbers(q, row, q_names_.size())
                                                         : row_numbers(last, 0, q_names_.size());
      scene_->add_state(state, episode);
      for (std::size_t k = 0; k < state.size(); ++k)
        episode.traces[k].values.push_back(static_cast<float>(state[k]));
    }
    for (std::size_t s = 0; s < data_.sensors.size(); ++s) add_fields(s, which, demo, episode);
    add_reward(which, demo, episode);
    for (std::size_t p = 0; p < pictures_.size(); ++p) add_shown(p, which, demo, episode);
    data_.episodes.push_back(std::move(episode));
  }

  /// Takes the newest field at each frame, once: rows of obs, then final_obs; of a sensor that is
  /// not read at every row, its samples; of a window, the last reading.
  void add_fields(std::size_t sensor, const Demo& which, const h5::Id& demo, ViewEpisode& episode) {
    const ViewSensor& view = data_.sensors[sensor];
    const std::optional<StoredSample>& sampled = sampled_[sensor];
    const std::size_t width = 3 * static_cast<std::size_t>(view.points),
                      readings = static_cast<std::size_t>(windows_[sensor]);
    const auto open = [&](const char* group, std::int64_t rows) {
      h5::Id fields = h5::open_dataset(h5::open_group(demo, group), readings_[sensor]);
      const h5::Dims dims = h5::dimensions(fields);
      std::size_t numbers = 1;
      for (std::size_t i = 1; i < dims.size(); ++i) numbers *= dims[i];
      if (dims.size() < 2 || dims[0] != static_cast<hsize_t>(rows) || numbers != readings * width)
        throw IoError(fmt::format("{}: expected {} fields of {} points: the file is damaged",
                                  h5::place_of(fields), rows, view.points));
      return fields;
    };
    const h5::Id fields = sampled ? open("samples", sampled->rows) : open("obs", which.rows),
                 last = sampled ? h5::Id() : open("final_obs", 1);
    ViewField field;
    ViewTrace normal{"force [N]", view.name + " normal", "N", {}},
        shear{"force [N]", view.name + " shear", "N", {}};
    std::int64_t taken = -1;
    std::int32_t at = -1;
    std::array<double, 2> sums{};
    for (const std::int64_t row : episode.rows) {
      const std::int64_t newest = sampled ? sampled->times.before(row + 1, which.rows) - 1 : row;
      if (newest > taken) {
        const bool at_end = !sampled && row == which.rows;
        const std::vector<double> row_fields =
            row_numbers(at_end ? last : fields, at_end ? 0 : newest, readings * width);
        const std::vector<double> force(row_fields.end() - static_cast<std::ptrdiff_t>(width),
                                        row_fields.end());
        check_finite_field(force, fmt::format("{}: demo_{}: sensor '{}': row {}", which.file,
                                              which.number, view.name, newest));
        sums = add_field(view, signs_[sensor], force, field);
        taken = newest, ++at;
      }
      field.at.push_back(at);
      normal.values.push_back(at < 0 ? kNoValue : static_cast<float>(sums[0]));
      shear.values.push_back(at < 0 ? kNoValue : static_cast<float>(sums[1]));
    }
    episode.fields.push_back(std::move(field));
    episode.traces.push_back(std::move(normal));
    episode.traces.push_back(std::move(shear));
  }

  /// Of the action that a row begins; the last state begins none. A scene alone has no rewards.
  void add_reward(const Demo& which, const h5::Id& demo, ViewEpisode& episode) {
    if (value_of(dataset_.settings, "policy").empty()) return;
    const h5::Id dataset = h5::open_dataset(demo, "rewards");
    check_shape(dataset, {static_cast<hsize_t>(which.rows)}, "rewards");
    ViewTrace trace{"reward", "reward", "1", {}};
    for (const std::int64_t row : episode.rows)
      trace.values.push_back(row < which.rows ? static_cast<float>(row_numbers(dataset, row, 1)[0])
                                              : kNoValue);
    episode.traces.insert(episode.traces.begin(), std::move(trace));
  }

  const ViewOptions& options_;
  std::string path_;
  DatasetFiles dataset_;
  std::vector<Demo> demos_;
  std::unique_ptr<ViewScene> scene_;
  ViewData data_;
  std::vector<std::string> q_names_, randomized_, readings_;
  std::vector<std::optional<StoredSample>> sampled_;   // (sensors) those that are not in every row
  std::vector<std::int64_t> windows_;                  // (sensors) readings of a row
  std::vector<std::optional<StoredSample>> pictures_;  // those that are not in every row
  int every_picture_ = 1;
  std::vector<int> signs_;
  double interval_ = 0;  // of rows [s]
};

}  // namespace

ViewData read_dataset_view(const std::string& path, const ViewOptions& options) {
  return DatasetView(path, options).read();
}

}  // namespace tangere
