// SPDX-License-Identifier: Apache-2.0
// Row j: observe the state after j K steps, then hold the action of step j K for K steps. The row
// after the last action is observed only.
#include "tasks/run/episode_slot.hpp"

#include <algorithm>
#include <array>
#include <type_traits>

namespace tangere {
namespace {

constexpr int kForceWidth = 3, kPositionWidth = 3;

std::size_t size(int n) { return static_cast<std::size_t>(n); }

constexpr std::size_t kQ = 0, kV = 1,
                      kEndEffectors =
                          2;  // names of observations; without end effectors a sensor is the third

/// Bytes of one row of one episode in a slot's buffers: what is no field is kept in double first.
double row_bytes(const EpisodeShape& shape, const EpisodeOptions& options) {
  const bool single = options.precision == Precision::mixed;
  double bytes = static_cast<double>(shape.nu) * sizeof(float);
  for (std::size_t name = 0; name < shape.widths.size(); ++name) {
    const std::size_t number = !single                     ? sizeof(double)
                               : name < shape.first_sensor ? sizeof(double) + sizeof(float)
                                                           : sizeof(float);
    bytes += static_cast<double>(shape.widths[name] * number);
  }
  return bytes;
}

/// Multiples of 64, below that powers of two: whoever stores rows in chunks of such sizes gets
/// whole ones.
int whole_rows(int most) {
  constexpr int kRows = 64;
  if (most >= kRows) return most / kRows * kRows;
  int rows = 1;
  while (2 * rows <= most) rows *= 2;
  return rows;
}

}  // namespace

EpisodeShape::EpisodeShape(const Model& model, const EpisodeOptions& options)
    : rows(::tangere::action_rows(options)), nu(size(model.nu())) {
  widths = {size(model.nq()), size(model.nv())};
  if (!model.end_effectors().empty())
    widths.push_back(kPositionWidth * model.end_effectors().size());
  first_sensor = widths.size();
  for (const SensorInfo& sensor : model.sensors())
    widths.push_back(kForceWidth * size(sensor.points));
  const double fitting =
      static_cast<double>(options.piece_bytes) / (kBlockEpisodes * row_bytes(*this, options));
  constexpr std::int64_t kMostRows = 1 << 20;  // rows without numbers still are counted by an int
  piece_rows = static_cast<int>(
      std::clamp(fitting, 1.0, static_cast<double>(std::min(rows + 1, kMostRows))));
  if (piece_rows <= rows) piece_rows = whole_rows(piece_rows);
}

double EpisodeShape::piece_bytes(const EpisodeOptions& options) const {
  return row_bytes(*this, options) * kBlockEpisodes * piece_rows;
}

EpisodeSlot::EpisodeSlot(const Model& model, const StepperOptions& solver,
                         const ControlProgram& controls, const EpisodeOptions& options,
                         const EpisodeShape& shape)
    : model_(model),
      controls_(controls),
      options_(options),
      shape_(shape),
      stepper_(model, solver),
      readout_(model, options.precision),
      u_(kBlockEpisodes * shape.nu),
      values_(shape.widths.size()),
      singles_(shape.widths.size()),
      actions_(kBlockEpisodes * size(shape.piece_rows) * shape.nu),
      observations_(shape.widths.size()),
      live_(kBlockEpisodes) {
  for (std::size_t name = 0; name < values_.size(); ++name) {
    const std::size_t numbers = kBlockEpisodes * size(shape.piece_rows) * shape.widths[name];
    const bool single = options.precision == Precision::mixed;
    if (!single || name < shape.first_sensor) values_[name].resize(numbers);
    if (single) singles_[name].resize(numbers);
  }
}

void EpisodeSlot::begin(std::int64_t block) {
  const std::int64_t first = block * kBlockEpisodes;
  const auto episodes =
      static_cast<int>(std::min<std::int64_t>(kBlockEpisodes, options_.episodes - first));
  batch_.emplace(model_, episodes, options_.seed, first);
  next_row_ = 0;
  randomized_.clear();
  for (int e = 0; e < episodes; ++e)
    for (int k = 0; k < static_cast<int>(model_.scene().randomizations.size()); ++k)
      randomized_.push_back(batch_->randomized_value(e, k));
  failures_.clear();
  live_.assign(size(episodes), true);
}

bool EpisodeSlot::simulate(const StopRequest& stop) {
  first_row_ = next_row_;
  rows_ = static_cast<int>(std::min<std::int64_t>(shape_.piece_rows, shape_.rows + 1 - first_row_));
  action_rows_ = static_cast<int>(std::min<std::int64_t>(rows_, shape_.rows - first_row_));
  counts_ = {};
  for (int row = 0; row < rows_; ++row) {
    observe(row);
    if (row < action_rows_ && !act(row, stop)) return false;
  }
  next_row_ += rows_;
  return true;
}

template <class T>
std::span<T> EpisodeSlot::numbers(std::size_t name, int episode, int row) {
  const std::size_t width = shape_.widths[name];
  const std::size_t first = (size(episode) * size(rows_) + size(row)) * width;
  if constexpr (std::is_same_v<T, float>) {
    return std::span(singles_[name]).subspan(first, width);
  } else {
    return std::span(values_[name]).subspan(first, width);
  }
}

void EpisodeSlot::observe(int row) {
  for (int e = 0; e < batch_->environments(); ++e) {
    batch_->get_q(e, numbers<double>(kQ, e, row));
    batch_->get_v(e, numbers<double>(kV, e, row));
  }
  if (shape_.first_sensor > kEndEffectors) {
    std::array<std::span<double>, kBlockEpisodes> positions;
    for (int e = 0; e < batch_->environments(); ++e)
      positions[size(e)] = numbers<double>(kEndEffectors, e, row);
    readout_.read_end_effectors(*batch_, 0, positions);
  }
  for (std::size_t name = shape_.first_sensor; name < shape_.widths.size(); ++name) {
    const auto sensor = static_cast<int>(name - shape_.first_sensor);
    if (options_.precision == Precision::mixed) {
      read_field<float>(sensor, row);
    } else {
      read_field<double>(sensor, row);
    }
  }
}

template <class T>
void EpisodeSlot::read_field(int sensor, int row) {
  std::array<std::span<T>, kBlockEpisodes> fields;
  for (int e = 0; e < batch_->environments(); ++e)
    fields[size(e)] = numbers<T>(shape_.first_sensor + size(sensor), e, row);
  readout_.read_block(*batch_, 0, sensor, fields);
}

bool EpisodeSlot::act(int row, const StopRequest& stop) {
  const std::int64_t begin = (first_row_ + row) * options_.every;
  const std::size_t nu = shape_.nu;
  for (int e = 0; e < batch_->environments(); ++e) {
    const std::span<double> u = std::span(u_).subspan(size(e) * nu, nu);
    controls_.evaluate(begin, batch_->episode(e), u);
    float* const action = actions_.data() + (size(e) * size(action_rows_) + size(row)) * nu;
    for (std::size_t k = 0; k < nu; ++k)
      action[k] = static_cast<float>(std::clamp(u[k], -1.0, 1.0));
  }
  for (int k = 0; k < options_.every; ++k) {
    if (stop && stop()) return false;
    stepper_.step(*batch_, u_);
    count(begin + k);
  }
  return true;
}

void EpisodeSlot::count(std::int64_t step) {
  for (int e = 0; e < batch_->environments(); ++e) {
    if (!live_[size(e)]) continue;
    const StepStatus status = batch_->status(e);
    ++counts_.environment_steps;
    counts_.newton_iterations += batch_->iterations(e);
    counts_.split_steps += status == StepStatus::split ? 1 : 0;
    if (!failed(status)) continue;
    live_[size(e)] = false;
    FailedEpisode& failure = failures_.emplace_back();
    failure = {batch_->episode(e), step, status, std::vector<double>(size(model_.nq())),
               std::vector<double>(size(model_.nv()))};
    batch_->get_q(e, failure.q);
    batch_->get_v(e, failure.v);
  }
}

void EpisodeSlot::encode() {
  for (std::size_t name = 0; name < values_.size(); ++name) {
    const std::size_t numbers = size(batch_->environments()) * size(rows_) * shape_.widths[name];
    if (options_.precision == Precision::f64) {
      observations_[name] = std::span<const double>(values_[name]).first(numbers);
      continue;
    }
    const std::span<float> singles = std::span(singles_[name]).first(numbers);
    if (name < shape_.first_sensor)
      std::transform(values_[name].begin(),
                     values_[name].begin() + static_cast<std::ptrdiff_t>(numbers), singles.begin(),
                     [](double x) { return static_cast<float>(x); });
    observations_[name] = std::span<const float>(singles);
  }
  std::sort(failures_.begin(), failures_.end(),
            [](const FailedEpisode& a, const FailedEpisode& b) { return a.episode < b.episode; });
}

EpisodeRows EpisodeSlot::piece() const {
  const std::size_t actions = size(batch_->environments()) * size(action_rows_) * shape_.nu;
  EpisodeRows piece{batch_->episode(0), batch_->environments(),
                    first_row_,         rows_,
                    action_rows_,       std::span(actions_).first(actions),
                    observations_};
  piece.randomized = randomized_;
  return piece;
}

}  // namespace tangere
