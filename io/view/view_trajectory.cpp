// SPDX-License-Identifier: Apache-2.0
// An environment of a trajectory file is an episode of the page.
#include <fmt/format.h>

#include <algorithm>

#include "engine/base/error.hpp"
#include "io/hdf5/h5_channels.hpp"
#include "io/trajectory/row_steps.hpp"
#include "io/trajectory/trajectory_reader.hpp"
#include "io/view/view_pictures.hpp"
#include "io/view/view_source.hpp"

namespace tangere {
namespace {

constexpr std::int64_t kMostSteps = std::int64_t{1} << 28,  // more is damage
    kMostBefore = std::int64_t{1} << 53;                    // of the runs that came before

class TrajectoryView {
 public:
  TrajectoryView(const std::string& path, const ViewOptions& options)
      : options_(options),
        path_(path),
        file_(open_trajectory(path)),
        fields_(path),
        scene_(text("scene_text"),
               H5Aexists(file_.get(), "scene_path") > 0 ? text("scene_path") : text("scene_name"),
               path, options) {
    steps_ = h5::read_number<std::int64_t>(file_, "steps");
    first_step_ = h5::read_number<std::int64_t>(file_, "first_step");
    const h5::Id q = h5::open_dataset(file_, "q");
    q_names_ = h5::read_texts(q, "names");
    scene_.check_names(q_names_);
    if (steps_ < 0 || steps_ > kMostSteps || fields_.environments() < 1 || first_step_ < 0 ||
        first_step_ > kMostBefore)
      throw IoError(
          fmt::format("{}: {} steps of {} environments after {} steps: the file is damaged", path,
                      steps_, fields_.environments(), first_step_));
    state_steps_ = row_steps(file_, "q");
    if (state_steps_.empty())
      throw IoError(path + ": the run recorded no state, so nothing says where bodies are");
    check_shape(q, {rows(), environments(), q_names_.size()}, "q");
    for (const Channel& channel : h5::list_channels(file_))
      if (is_curve(channel))
        curves_.push_back({channel, row_steps(file_, channel.name)});
      else if (is_picture(channel))
        pictures_.push_back({channel, row_steps(file_, channel.name)});
  }

  ViewData read() {
    data_.title = text("scene_name"), data_.source = path_, data_.kind = "trajectory";
    data_.scene = scene_.scene();
    take_sensors();
    std::int64_t first = 0,
                 count = std::min<std::int64_t>(options_.episodes, fields_.environments());
    if (options_.episode) first = *options_.episode, count = 1;
    if (first >= fields_.environments())
      throw InputError(
          fmt::format("environment {}: {} has 0 to {}", first, path_, fields_.environments() - 1));
    if (!options_.episode && count < fields_.environments())
      data_.notes.push_back(
          fmt::format("The first {} of {} environments.", count, fields_.environments()));
    std::size_t traces = q_names_.size() + 2 * data_.sensors.size();
    for (const Curve& curve : curves_) traces += curve.channel.width() / environments();
    data_.stride = stride_for(
        std::vector<std::int64_t>(static_cast<std::size_t>(count), std::ssize(state_steps_)),
        numbers_per_frame(data_.scene, data_.sensors, traces),
        pictures_.empty() ? options_ : beside_pictures(options_));
    take_pictures(first, count);
    for (std::int64_t e = first; e < first + count; ++e) add_environment(e);
    if (!pictures_.empty()) thin_pictures(data_, every_picture_, options_);
    return std::move(data_);
  }

 private:
  /// A channel that is drawn, and the steps of its rows.
  struct Curve {
    Channel channel;
    std::vector<std::int64_t> steps;
  };

  /// Numbers of each environment in time, with names where there are several. Coordinates and
  /// fields are drawn in their own way; what else is left out is a table whose rows are no times.
  [[nodiscard]] bool is_curve(const Channel& channel) const {
    const std::vector<std::uint64_t>& shape = channel.shape;
    const std::string group = channel.name.substr(0, channel.name.find('/'));
    for (const char* other : {"q", "tactile", "randomized", "gradients", "memory"})
      if (group == other) return false;
    if (shape.empty() || shape[0] != environments()) return false;
    return shape.size() == 1 || (shape.size() == 2 && shape[1] == channel.names.size());
  }

  /// Pictures in colours of each environment: tactile/pad/rgb, cameras/eye/rgb.
  [[nodiscard]] bool is_picture(const Channel& channel) const {
    const std::vector<std::uint64_t>& shape = channel.shape;
    return channel.type == NumberType::uint8 && shape.size() == 4 && shape[0] == environments() &&
           shape[3] == 3 && channel.name.find('/') < channel.name.rfind('/');
  }

  /// Lists the pictures, and finds how many of them the page has room for.
  void take_pictures(std::int64_t first, std::int64_t count) {
    std::vector<std::string> samples;
    for (const Curve& picture : pictures_) {
      const std::vector<std::uint64_t>& shape = picture.channel.shape;
      std::string name = picture.channel.name.substr(picture.channel.name.find('/') + 1);
      name[name.rfind('/')] = '.';
      data_.pictures.push_back({name, static_cast<int>(shape[1]), static_cast<int>(shape[2])});
      if (!picture.steps.empty())
        samples.push_back(page_picture(data_.pictures.back(), read_picture(picture, 0, first)));
    }
    const std::int64_t frames = std::ssize(frames_of(std::ssize(state_steps_), data_.stride));
    every_picture_ = picture_stride(samples, frames * count, options_);
  }

  [[nodiscard]] std::vector<std::uint8_t> read_picture(const Curve& picture, std::int64_t k,
                                                       std::int64_t environment) const {
    const std::vector<std::uint64_t>& shape = picture.channel.shape;
    std::vector<std::uint8_t> levels(shape[1] * shape[2] * shape[3]);
    h5::read_box<std::uint8_t>(
        h5::open_dataset(file_, picture.channel.name),
        {static_cast<hsize_t>(k), static_cast<hsize_t>(environment), 0, 0, 0},
        {1, 1, shape[1], shape[2], shape[3]}, levels.data());
    return levels;
  }

  [[nodiscard]] std::string text(const char* name) const {
    if (H5Aexists(file_.get(), name) <= 0)
      throw IoError(
          fmt::format("{}: no attribute '{}': the file does not hold its scene", path_, name));
    return h5::read_text(file_, name);
  }
  /// Of the states.
  [[nodiscard]] hsize_t rows() const { return state_steps_.size(); }
  [[nodiscard]] hsize_t environments() const {
    return static_cast<hsize_t>(fields_.environments());
  }

  /// Takes the sensors that the file has fields of.
  void take_sensors() {
    for (ViewSensor& sensor : scene_.sensors()) {
      const auto& recorded = fields_.sensors();
      const auto found = std::find_if(recorded.begin(), recorded.end(),
                                      [&](const SensorLayout& s) { return s.name == sensor.name; });
      if (found == recorded.end()) {
        data_.notes.push_back(
            fmt::format("The field of sensor '{}' was not recorded.", sensor.name));
        continue;
      }
      const auto index = static_cast<std::size_t>(found - recorded.begin());
      if (found->points != sensor.points)
        throw IoError(fmt::format("{}: sensor '{}' has {} points; its scene says {}", path_,
                                  sensor.name, found->points, sensor.points));
      if (!fields_.has_pressure(index) || !fields_.has_shear(index))
        data_.notes.push_back(fmt::format("Of sensor '{}' only {} was recorded.", sensor.name,
                                          fields_.has_shear(index) ? "shear" : "pressure"));
      recorded_.push_back(index);
      data_.sensors.push_back(std::move(sensor));
    }
  }

  /// What `<randomize>` drew for an environment.
  [[nodiscard]] ViewNumbers numbers(std::int64_t environment) const {
    ViewNumbers numbers;
    if (!h5::has_link(file_, "randomized")) return numbers;
    const h5::Id dataset = h5::open_dataset(file_, "randomized");
    numbers.names = h5::read_texts(dataset, "names");
    check_shape(dataset, {environments(), numbers.names.size()}, "randomized");
    numbers.values = row_numbers(dataset, environment, numbers.names.size());
    return numbers;
  }

  void add_environment(std::int64_t environment) {
    ViewEpisode episode;
    episode.label = fmt::format("environment {}", environment);
    episode.shapes = scene_.begin_episode(numbers(environment), data_);
    const std::vector<std::int64_t> shown = frames_of(std::ssize(state_steps_), data_.stride);
    for (const std::int64_t row : shown)
      episode.rows.push_back(state_steps_[static_cast<std::size_t>(row)]);
    episode.traces = coordinate_traces(q_names_, scene_.q_units());
    const h5::Id q = h5::open_dataset(file_, "q");
    std::vector<double> state(q_names_.size());
    for (const std::int64_t row : shown) {
      const std::int64_t step = state_steps_[static_cast<std::size_t>(row)];
      episode.time.push_back(
          static_cast<float>(static_cast<double>(first_step_ + step) * fields_.timestep()));
      h5::read_box<double>(q, {static_cast<hsize_t>(row), static_cast<hsize_t>(environment), 0},
                           {1, 1, state.size()}, state.data());
      scene_.add_state(state, episode);
      for (std::size_t k = 0; k < state.size(); ++k)
        episode.traces[k].values.push_back(static_cast<float>(state[k]));
    }
    for (std::size_t s = 0; s < data_.sensors.size(); ++s) add_fields(s, environment, episode);
    for (const Curve& curve : curves_) add_curve(curve, environment, episode);
    for (std::size_t p = 0; p < pictures_.size(); ++p)
      add_pictures(
          data_.pictures[p], pictures_[p].steps,
          [&](std::int64_t k) { return read_picture(pictures_[p], k, environment); },
          every_picture_, episode);
    data_.episodes.push_back(std::move(episode));
  }

  /// Takes the newest field at each frame, once.
  void add_fields(std::size_t sensor, std::int64_t environment, ViewEpisode& episode) {
    const std::size_t index = recorded_[sensor];
    const ViewSensor& view = data_.sensors[sensor];
    const SensorLayout& layout = fields_.sensors()[index];
    ViewField field;
    ViewTrace normal{"force [N]", view.name + " normal", "N", {}},
        shear{"force [N]", view.name + " shear", "N", {}};
    std::int64_t newest = -1, taken = -1;
    std::int32_t at = -1;
    std::array<double, 2> sums{};
    for (const std::int64_t row : episode.rows) {
      while (newest + 1 < fields_.frames(index) && fields_.step(index, newest + 1) <= row) ++newest;
      if (newest > taken) {
        sums =
            add_field(view, layout.pressure_sign, fields_.force(index, newest, environment), field);
        taken = newest, ++at;
      }
      field.at.push_back(at);
      normal.values.push_back(at < 0 ? kNoValue : static_cast<float>(sums[0]));
      shear.values.push_back(at < 0 ? kNoValue : static_cast<float>(sums[1]));
    }
    episode.fields.push_back(std::move(field));
    if (fields_.has_pressure(index)) episode.traces.push_back(std::move(normal));
    if (fields_.has_shear(index)) episode.traces.push_back(std::move(shear));
  }

  /// The newest row at each frame; of the status the worst since the frame before: a failure, else
  /// the largest value.
  void add_curve(const Curve& curve, std::int64_t environment, ViewEpisode& episode) {
    const Channel& channel = curve.channel;
    const std::size_t width = channel.width() / environments(), rows = curve.steps.size();
    h5::Id dataset = h5::open_dataset(file_, channel.name);
    h5::Dims offset(channel.shape.size() + 1, 0), count{rows};
    count.insert(count.end(), channel.shape.begin(), channel.shape.end());
    check_shape(dataset, count, channel.name);
    offset[1] = static_cast<hsize_t>(environment), count[1] = 1;
    std::vector<double> values(rows * width);
    if (!values.empty()) h5::read_box<double>(dataset, offset, count, values.data());
    const bool status = channel.name == "solver/status";
    std::string group = channel.name;
    std::replace(group.begin(), group.end(), '/', ' ');
    for (std::size_t k = 0; k < width; ++k) {
      const std::string unit = k < channel.units.size() ? channel.units[k] : "1";
      ViewTrace trace{channel.units.empty() ? group : fmt::format("{} [{}]", group, unit),
                      channel.names.empty() ? group.substr(group.rfind(' ') + 1) : channel.names[k],
                      unit,
                      {}};
      std::size_t next = 0;
      for (const std::int64_t step : episode.rows) {
        double value = kNoValue, worst = 0;
        const std::size_t first = next;
        for (; next < rows && curve.steps[next] <= step; ++next) {
          const double x = values[next * width + k];
          if (x < 0 ? worst >= 0 || x < worst : worst >= 0 && x > worst) worst = x;
        }
        if (next > 0) value = values[(next - 1) * width + k];
        trace.values.push_back(static_cast<float>(!status ? value : first < next ? worst : 0));
      }
      episode.traces.push_back(std::move(trace));
    }
  }

  const ViewOptions& options_;
  std::string path_;
  h5::Id file_;
  TrajectoryReader fields_;
  ViewScene scene_;
  ViewData data_;
  std::int64_t steps_ = 0;
  std::int64_t first_step_ = 0;  // of a run that went on from another's state
  std::vector<std::int64_t> state_steps_;
  std::vector<Curve> curves_, pictures_;
  int every_picture_ = 1;
  std::vector<std::string> q_names_;
  std::vector<std::size_t> recorded_;  // (sensors) indices in the reader
};

}  // namespace

ViewData read_trajectory_view(const std::string& path, const ViewOptions& options) {
  return TrajectoryView(path, options).read();
}

}  // namespace tangere
