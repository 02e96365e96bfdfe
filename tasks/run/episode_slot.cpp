// SPDX-License-Identifier: Apache-2.0
// Row j holds the observations before action j and the action, which is held or followed for K
// steps. The row after the last action has observations only.
#include "tasks/run/episode_slot.hpp"

#include <algorithm>

#include "engine/base/as_size.hpp"
#include "tasks/run/block_reader.hpp"

namespace tangere {
namespace {

using Kind = EpisodeChannel::Kind;

constexpr std::size_t kQ = 0, kV = 1, kThird = 2;  // channels
constexpr std::size_t kPose = 7;                   // numbers of a body

}  // namespace

template <class T>
EpisodeSlot<T>::EpisodeSlot(const EpisodeSource& source, const EpisodeOptions& options)
    : source_(source),
      options_(options),
      piece_rows_(piece_rows(source, options)),
      windowed_(std::any_of(source.channels.begin(), source.channels.end(),
                            [](const EpisodeChannel& channel) { return channel.window > 1; })),
      stepper_(*source.model, source.solver),
      readout_(*source.model, options.precision),
      u_(kBlockEpisodes * as_size(source.model->nu())),
      values_(source.channels.size()),
      bytes_(source.channels.size()),
      ids_(source.channels.size()),
      windows_(source.channels.size()),
      actions_(kBlockEpisodes * as_size(piece_rows_) * source.action),
      rewards_(source.whole ? kBlockEpisodes * as_size(piece_rows_) : 0),
      observations_(source.channels.size()) {
  for (std::size_t name = 0; name < values_.size(); ++name) {
    const std::size_t count = kBlockEpisodes * taken_rows(name, piece_rows_) * width(name);
    const std::size_t own = source.channels[name].own_bytes();
    if (own == 0) values_[name].resize(count);
    if (own == 1) bytes_[name].resize(count);
    if (own == 2) ids_[name].resize(count);
    if (source.channels[name].window > 1) windows_[name].resize(kBlockEpisodes * width(name));
    if (source.channels[name].kind != Kind::reading)
      small_.resize(std::max(small_.size(), width(name)));
  }
}

template <class T>
void EpisodeSlot<T>::begin(EpisodeRange range) {
  const auto episodes = static_cast<int>(range.end - range.first);
  batch_.emplace(*source_.model, episodes, options_.seed, range.first);
  program_ = source_.program(*batch_);
  program_->start(*batch_, 0);
  tally_.emplace(*batch_, 0, episodes);
  loads_before_ = readout_.loads_not_carried();
  next_row_ = 0;
  if (program_->opening_steps() == 0)
    for (std::size_t name = 0; name < windows_.size(); ++name)
      for (int k = 0; k < source_.channels[name].window; ++k) read_window(name, as_size(k));
  if (program_->opening_steps() > 0) {
    static_cast<void>(take_steps(0, program_->opening_steps(), {}));
    program_->after_row(*batch_, 0);
  }
  randomized_.clear();
  for (int e = 0; e < episodes; ++e)
    for (int k = 0; k < std::ssize(source_.model->scene().randomizations); ++k)
      randomized_.push_back(batch_->randomized_value(e, k));
  playing_.assign(as_size(episodes), true);
  ends_.clear();
  failures_.clear();
}

template <class T>
bool EpisodeSlot<T>::simulate(const std::function<bool()>& stopped,
                              const std::function<void(std::int64_t)>& on_steps) {
  first_row_ = next_row_;
  rows_ = static_cast<int>(std::min<std::int64_t>(piece_rows_, source_.rows + 1 - first_row_));
  action_rows_ = static_cast<int>(std::min<std::int64_t>(rows_, source_.rows - first_row_));
  for (int row = 0; row < rows_; ++row) {
    observe(row);
    if (row == action_rows_ || std::count(playing_.begin(), playing_.end(), true) == 0) break;
    const std::int64_t before = program_->counts(*tally_).environment_steps;
    if (!act(row, stopped)) return false;
    on_steps(program_->counts(*tally_).environment_steps - before);
  }
  next_row_ += rows_;
  if (last()) collect();
  for (std::size_t name = 0; name < values_.size(); ++name) {
    const std::size_t count =
        as_size(batch_->environments()) * width(name) *
        (taken_before(source_, name, next_row_) - taken_before(source_, name, first_row_));
    if (const std::size_t own = source_.channels[name].own_bytes(); own == 1)
      observations_[name] = std::span<const std::uint8_t>(bytes_[name]).first(count);
    else if (own == 2)
      observations_[name] = std::span<const std::int16_t>(ids_[name]).first(count);
    else
      observations_[name] = std::span<const T>(values_[name]).first(count);
  }
  return true;
}

template <class T>
template <class Number>
std::span<Number> EpisodeSlot<T>::numbers(std::vector<std::vector<Number>>& values,
                                          std::size_t name, int episode, int row) {
  const std::size_t numbers = width(name), before = taken_before(source_, name, first_row_),
                    at = taken_before(source_, name, first_row_ + row) - before,
                    rows = taken_before(source_, name, first_row_ + rows_) - before;
  return std::span(values[name]).subspan((as_size(episode) * rows + at) * numbers, numbers);
}

/// Returns the most rows at which a name is taken among as many in a row.
template <class T>
std::size_t EpisodeSlot<T>::taken_rows(std::size_t name, int rows) const {
  const EpisodeChannel& taken = source_.channels[name];
  if (!taken.requested) return 0;
  if (taken.times.final) return 1;
  const std::int64_t every = std::max<std::int64_t>(1, taken.times.every);
  return static_cast<std::size_t>((rows + every - 1) / every);
}

template <class T>
bool EpisodeSlot<T>::takes(std::size_t name, int row) const {
  return is_taken(source_, name, first_row_ + row);
}

template <class T>
void EpisodeSlot<T>::put(std::size_t name, int episode, int row, std::span<const double> from) {
  std::transform(from.begin(), from.end(), numbers(values_, name, episode, row).begin(),
                 [](double x) { return static_cast<T>(x); });
}

/// Skips episodes that are over.
template <class T>
void EpisodeSlot<T>::observe(int row) {
  const bool takes_q = takes(kQ, row), takes_v = takes(kV, row);
  for (int e = 0; e < batch_->environments(); ++e) {
    if (!playing_[as_size(e)]) continue;
    const std::span<double> q = std::span(small_).first(width(kQ)),
                            v = std::span(small_).first(width(kV));
    if (takes_q) batch_->get_q(e, q), put(kQ, e, row, q);
    if (takes_v) batch_->get_v(e, v), put(kV, e, row, v);
  }
  if (const TaskProgram* const task = program_->task_program()) {
    observe_task(*task, row);
  } else {
    observe_scene(row);
  }
}

template <class T>
void EpisodeSlot<T>::observe_task(const TaskProgram& task, int row) {
  const EnvironmentData& data = task.data();
  const std::size_t all = task.task().spec().observation_size();
  for (int e = 0; e < batch_->environments(); ++e) {
    if (!playing_[as_size(e)]) continue;
    std::span<const double> rest = std::span(data.observation).subspan(as_size(e) * all, all);
    for (std::size_t name = kThird; name < source_.channels.size(); ++name) {
      if (source_.channels[name].kind != Kind::task) continue;
      if (takes(name, row)) put(name, e, row, rest.first(width(name)));
      rest = rest.subspan(width(name));
    }
    playing_[as_size(e)] = data.state[as_size(e)] == EnvironmentState::running;
  }
  for (std::size_t name = kThird; name < source_.channels.size(); ++name)
    if (source_.channels[name].kind == Kind::reading) observe_reading(name, row);
}

template <class T>
void EpisodeSlot<T>::observe_reading(std::size_t name, int row) {
  const EpisodeChannel& channel = source_.channels[name];
  if (channel.window > 1) {
    for (int e = 0; e < batch_->environments(); ++e) {
      const auto from = windows_[name].begin() + std::ptrdiff_t(as_size(e) * width(name));
      std::copy_n(from, width(name), numbers(values_, name, e, row).begin());
    }
  } else if (channel.own_bytes() == 1) {
    read_field<std::uint8_t>(readout_, *batch_, 0, channel.reading,
                             [&](int e) { return numbers(bytes_, name, e, row); });
  } else if (channel.own_bytes() == 2) {
    read_field<std::int16_t>(readout_, *batch_, 0, channel.reading,
                             [&](int e) { return numbers(ids_, name, e, row); });
  } else {
    read_field<T>(readout_, *batch_, 0, channel.reading,
                  [&](int e) { return numbers(values_, name, e, row); });
  }
}

/// Reads what is due after a step, which counts from the start of the episodes.
template <class T>
void EpisodeSlot<T>::read_windows(std::int64_t step) {
  const auto in_row = static_cast<int>(step % source_.steps_per_row);
  for (std::size_t name = 0; name < windows_.size(); ++name)
    if (const auto place = source_.channels[name].window_place(in_row, source_.steps_per_row))
      read_window(name, *place);
}

/// Reads a channel with a window into a place of it; of another channel nothing.
template <class T>
void EpisodeSlot<T>::read_window(std::size_t name, std::size_t place) {
  if (windows_[name].empty()) return;
  const EpisodeChannel& channel = source_.channels[name];
  const std::size_t each = channel.reading_width();
  read_field<T>(readout_, *batch_, 0, channel.reading, [&](int e) {
    return std::span(windows_[name]).subspan(as_size(e) * width(name) + place * each, each);
  });
}

template <class T>
void EpisodeSlot<T>::observe_scene(int row) {
  for (std::size_t name = kThird; name < source_.channels.size(); ++name) {
    const EpisodeChannel& channel = source_.channels[name];
    if (!takes(name, row)) continue;
    if (channel.kind == Kind::reading) {
      observe_reading(name, row);
    } else if (channel.kind == Kind::bodies) {
      observe_bodies(name, row);
    } else {
      std::vector<double> positions(as_size(batch_->environments()) * width(name));
      const auto place = [&](int e) {
        return std::span(positions).subspan(as_size(e) * width(name), width(name));
      };
      read_end_effectors(readout_, *batch_, 0, place);
      for (int e = 0; e < batch_->environments(); ++e) put(name, e, row, place(e));
    }
  }
}

template <class T>
void EpisodeSlot<T>::observe_bodies(std::size_t name, int row) {
  const std::vector<int>& bodies = source_.channels[name].bodies;
  std::vector<double> pose(kPose * bodies.size()), twist((kMotion - kPose) * bodies.size());
  for (int e = 0; e < batch_->environments(); ++e) {
    readout_.bodies(*batch_, e, pose, twist, bodies);
    const std::span<double> both = std::span(small_).first(width(name));
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      const auto to = both.begin() + static_cast<std::ptrdiff_t>(kMotion * b);
      std::copy_n(pose.begin() + static_cast<std::ptrdiff_t>(kPose * b), kPose, to);
      std::copy_n(twist.begin() + static_cast<std::ptrdiff_t>((kMotion - kPose) * b),
                  kMotion - kPose, to + kPose);
    }
    put(name, e, row, both);
  }
}

template <class T>
bool EpisodeSlot<T>::act(int row, const std::function<bool()>& stopped) {
  const int steps = program_->steps_per_row();
  const std::int64_t first = program_->opening_steps() + (first_row_ + row) * steps;
  program_->controls(first, *batch_, 0, u_);
  keep_action(row);
  if (!take_steps(first, steps, stopped)) return false;
  program_->after_row(*batch_, 0);
  if (const TaskProgram* const task = program_->task_program())
    for (int e = 0; e < batch_->environments(); ++e)
      if (playing_[as_size(e)])
        rewards_[as_size(e) * as_size(action_rows_) + as_size(row)] =
            static_cast<float>(task->data().reward[as_size(e)]);
  return true;
}

/// If step `from` begins a row, its controls are already in place.
template <class T>
bool EpisodeSlot<T>::take_steps(std::int64_t from, std::int64_t count,
                                const std::function<bool()>& stopped) {
  const bool requested = from >= program_->opening_steps();
  const std::size_t numbers = as_size(batch_->environments()) * as_size(batch_->model().nu());
  for (std::int64_t t = from; t < from + count; ++t) {
    if (stopped && stopped()) return false;
    if (t > from || !requested) program_->controls(t, *batch_, 0, u_);
    stepper_.step(*batch_, std::span(u_).first(numbers));
    tally_->count(*batch_, t);
    if (windowed_) read_windows(t);
    program_->after_step(t, *batch_, 0);
  }
  return true;
}

/// Keeps the action as taken, within its bounds.
template <class T>
void EpisodeSlot<T>::keep_action(int row) {
  const TaskProgram* const task = program_->task_program();
  const std::size_t width = source_.action;
  for (int e = 0; e < batch_->environments(); ++e) {
    if (!playing_[as_size(e)]) continue;
    const std::vector<double>& from = task != nullptr ? task->data().action : u_;
    float* const to = actions_.data() + (as_size(e) * as_size(action_rows_) + as_size(row)) * width;
    for (std::size_t k = 0; k < width; ++k) {
      const double x = from[as_size(e) * width + k];
      to[k] = static_cast<float>(
          task != nullptr ? x : std::clamp(x, source_.bounds[k][0], source_.bounds[k][1]));
    }
  }
}

/// Collects how the block's episodes ended.
template <class T>
void EpisodeSlot<T>::collect() {
  if (const TaskProgram* const task = program_->task_program()) {
    const EnvironmentData& d = task->data();
    for (std::size_t e = 0; e < d.length.size(); ++e)
      ends_.push_back(
          {d.length[e], d.returns[e], d.terminated[e] != 0, d.success[e] != 0,
           task->policy().player(batch_->seed(), batch_->episode(static_cast<int>(e)))});
  }
  for (int e = 0; e < batch_->environments(); ++e) {
    if (!failed(batch_->status(e))) continue;
    FailedEpisode& failure = failures_.emplace_back();
    failure = {batch_->episode(e), step_of_failure(e), batch_->status(e),
               std::vector<double>(width(kQ)), std::vector<double>(width(kV))};
    batch_->get_q(e, failure.q);
    batch_->get_v(e, failure.v);
  }
}

/// For a task: the first step of the action that failed.
template <class T>
std::int64_t EpisodeSlot<T>::step_of_failure(int episode) const {
  if (!ends_.empty())
    return std::max<std::int64_t>(0, ends_[as_size(episode)].length - 1) *
           program_->steps_per_row();
  return std::find_if(tally_->failures.begin(), tally_->failures.end(),
                      [episode](const auto& f) { return f.environment == episode; })
      ->step;
}

template <class T>
void EpisodeSlot<T>::add_to(EpisodeSummary& run) const {
  const TaskProgram* const task = program_->task_program();
  run.episodes += batch_->environments();
  const VectorCounts counts = program_->counts(*tally_);
  run.environment_steps += counts.environment_steps;
  run.counts += counts.steps;
  run.counts.loads_not_carried += readout_.loads_not_carried() - loads_before_;
  run.failures.insert(run.failures.end(), failures_.begin(), failures_.end());
  auto failure = failures_.begin();
  for (int e = 0; e < batch_->environments(); ++e) {
    if (failure != failures_.end() && failure->episode == batch_->episode(e)) {
      ++failure;
      continue;
    }
    run.rows += task != nullptr ? ends_[as_size(e)].length : source_.rows;
    if (task == nullptr) continue;
    run.successes += ends_[as_size(e)].success ? 1 : 0;
    run.mean_return += ends_[as_size(e)].total;
  }
}

template <class T>
EpisodeSteps EpisodeSlot<T>::steps() const {
  const StepCounts counts = program_->counts(*tally_).steps;
  return {counts.simulation_steps, counts.tunnelled_steps, counts.overlapping_steps};
}

template <class T>
EpisodeRows EpisodeSlot<T>::piece() const {
  const std::size_t actions = as_size(batch_->environments()) * as_size(action_rows_);
  EpisodeRows piece{batch_->episode(0), batch_->environments(),
                    first_row_,         rows_,
                    action_rows_,       std::span(actions_).first(actions * source_.action),
                    observations_};
  piece.randomized = randomized_;
  if (source_.whole) piece.rewards = std::span(rewards_).first(actions);
  piece.ends = ends_;
  return piece;
}

template class EpisodeSlot<double>;
template class EpisodeSlot<float>;

}  // namespace tangere
