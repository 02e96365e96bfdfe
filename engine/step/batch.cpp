// SPDX-License-Identifier: Apache-2.0
// States in lanes: allocates them, begins episodes, copies one environment in and out.
#include "engine/step/batch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>

#include "engine/model/compile_followers.hpp"
#include "engine/model/compile_variations.hpp"
#include "engine/model/model_part.hpp"
#include "engine/model/random.hpp"
#include "engine/model/transmission_state.hpp"
#include "engine/scene/scene_faults.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/shapes.hpp"

namespace tangere {

using kernels::kBlock;

namespace {

Purpose purpose_of(const SceneNumber& number) {
  if (is_of_start(number)) return Purpose::initial_state;
  switch (number.owner) {
    case NumberOwner::contact:
    case NumberOwner::loop:
    case NumberOwner::ground: return Purpose::contact;
    case NumberOwner::joint:
      return number.field == NumberField::pos ? Purpose::body : Purpose::joint;
    case NumberOwner::motor: return Purpose::joint;
    case NumberOwner::body: return Purpose::body;
    case NumberOwner::camera: return Purpose::camera;
    case NumberOwner::tactile: break;
  }
  return Purpose::tactile;
}

/// Draws randomised number k of an episode.
double drawn_number(const CompiledModel& m, std::uint64_t seed, std::int64_t episode,
                    std::size_t k) {
  const std::size_t with = m.drawn_with[k];
  const Purpose purpose = purpose_of(m.scene.randomizations[with].number);
  return draw(m.scene.randomizations[k].distribution,
              RandomKey{seed, episode, 0, purpose, static_cast<std::uint32_t>(with)});
}

[[noreturn]] void refuse_start(const RandomizationDescription& d) {
  throw InputError("'" + name_of(d.number) + "' is of the starting state; expected a parameter");
}

/// What is wrong with the sizes of the bodies, where number(row) is the number in a row.
template <class Number>
std::string sizes_fault(const CompiledModel& m, const Number& number) {
  for (const VaryingSize& size : m.varying_sizes) {
    const BodyDescription& body = m.scene.links[std::size_t(size.body)].body;
    if (row_of(body.shape).slenderness == 0) continue;  // meshes are not copied
    Shape shape = body.shape;
    for (const VaryingNumber& n : size.numbers) *size_number(shape, n.which) = number(n.row);
    if (const std::string fault = slenderness_fault(shape); !fault.empty())
      return "body '" + body.name + "' would be " + fault;
  }
  return "";
}

}  // namespace

std::span<const StepStatus> step_statuses() {
  using enum StepStatus;
  static constexpr StepStatus kAll[] = {converged, split,       accuracy_not_met, tunnelled,
                                        damped,    overlapping, not_converged,    non_finite,
                                        rotation,  singular,    unsolved_layer};
  return kAll;
}

const char* to_string(StepStatus value) {
  switch (value) {
    case StepStatus::converged: return "converged";
    case StepStatus::split: return "converged after the step was split";
    case StepStatus::accuracy_not_met:
      return "converged, but its shortest parts missed the accuracy or created energy";
    case StepStatus::tunnelled: return "converged, but a body came through one that it touches";
    case StepStatus::damped: return "converged, but damped, because the scheme created energy";
    case StepStatus::overlapping:
      return "converged, but bodies overlap where no contact point is as deep";
    case StepStatus::not_converged: return "no solution found, step split down to h/256";
    case StepStatus::non_finite: return "a control or state was not finite";
    case StepStatus::rotation: return "a joint turned by pi or more in one step";
    case StepStatus::singular: return "the Jacobian is singular";
    case StepStatus::unsolved_layer: return "the pressures of a layer were not found";
  }
  return "unknown";
}

Batch::Batch(const Model& model, int environments, std::uint64_t seed, std::int64_t first_episode)
    : model_(model), environments_(environments), blocks_(0), seed_(seed), candidates_(0) {
  if (environments < 1)
    throw InputError("a batch of " + std::to_string(environments) +
                     " environments; expected at least 1");
  const CompiledModel& m = compiled(model);
  blocks_ = environments / kBlock + (environments % kBlock != 0);
  block_stride_ = std::size_t(m.layout.rows) * kBlock;
  const std::size_t lanes = std::size_t(blocks_) * kBlock;
  try {
    data_.assign(block_stride_ * std::size_t(blocks_), 0.0);
    status_.assign(lanes, StepStatus::converged);
    iterations_.assign(lanes, 0);
    residual_.assign(lanes, 0.0);
    has_history_.assign(lanes, 0);
    held_.assign(lanes, 0);
    episode_.resize(lanes);
    steps_.assign(lanes, 0);
    shear_.resize(lanes);
    sleep_.resize(lanes);
    clearance_.assign(lanes, 0.0);
    candidates_ = CandidateStore(lanes / kernels::kGroup);
  } catch (const std::exception&) {
    throw InputError(
        "no memory for " + std::to_string(environments) + " environments (" +
        std::to_string(double(block_stride_) * double(blocks_) * sizeof(double) / 1e9) + " GB)");
  }
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    episode_[lane] = first_episode + static_cast<std::int64_t>(lane);
    draw_episode(lane);
  }
}

double* Batch::column(std::size_t lane) {
  return data_.data() + (lane / kBlock) * block_stride_ + lane % kBlock;
}
const double* Batch::column(std::size_t lane) const {
  return data_.data() + (lane / kBlock) * block_stride_ + lane % kBlock;
}

const RandomizationDescription& Batch::randomization(int k) const {
  const std::vector<RandomizationDescription>& all = compiled(model_).scene.randomizations;
  return all[checked_index("randomized number", k, std::ssize(all))];
}

/// Draws an episode's numbers. Padding lanes keep the scene's own numbers.
void Batch::draw_episode(std::size_t lane) {
  const CompiledModel& m = compiled(model_);
  const bool padding = lane >= std::size_t(environments_);
  double* const own = column(lane);
  for (int i = 0; i < m.nq; ++i) own[(m.layout.q + i) * kBlock] = m.initial_q[std::size_t(i)];
  for (int i = 0; i < m.nv; ++i) own[(m.layout.v + i) * kBlock] = m.initial_v[std::size_t(i)];
  for (std::size_t k = 0; k < m.scene.randomizations.size(); ++k) {
    const int row = m.randomized_row[k];
    if (!padding) {
      own[row * kBlock] = drawn_number(m, seed_, episode_[lane], k);
    } else if (row >= m.layout.parameters) {
      own[row * kBlock] = number_in(m.scene, m.scene.randomizations[k].number);
    }
  }
  place_followers(
      m, [&](int i) -> double& { return own[(m.layout.q + i) * kBlock]; },
      [&](int i) -> double& { return own[(m.layout.v + i) * kBlock]; });
  update_derived_rows(m, own);
  complete_state(lane);
}

void Batch::reset(int environment, std::int64_t episode) {
  const std::size_t lane = this->lane(environment);
  episode_[lane] = episode;
  draw_episode(lane);
  status_[lane] = StepStatus::converged;
  iterations_[lane] = 0;
  residual_[lane] = 0;
  has_history_[lane] = 0;
  held_[lane] = 0;
  steps_[lane] = 0;
  shear_[lane].clear();
  sleep_[lane] = {};
  clearance_[lane] = 0;
}

/// Sets the coordinates and rates of transmissions in a lane's state.
void Batch::place_transmissions(std::size_t lane) {
  const CompiledModel& m = compiled(model_);
  if (m.transmissions.empty()) return;
  double* const own = column(lane);
  TransmissionState(m).place(own + m.layout.q * kBlock, own + m.layout.v * kBlock, kBlock, own);
}

namespace {

/// Throws InputError where a state has followers elsewhere than their leaders put them, by more
/// than rounding to float.
void check_followers(const CompiledModel& m, std::span<const double> q, std::span<const double> v) {
  if (!m.has_followers()) return;
  constexpr double kRounding = 1e-5;
  const auto check = [](const std::string& name, double found, double expected) {
    if (std::abs(found - expected) > kRounding * (1 + std::abs(expected)))
      throw InputError("state: '" + name + "' is " + std::to_string(found) + "; expected " +
                       std::to_string(expected) + " by the joint that it follows");
  };
  std::vector<double> placed_q(q.begin(), q.end()), placed_v(v.begin(), v.end());
  place_followers(
      m, [&](int i) -> double& { return placed_q[std::size_t(i)]; },
      [&](int i) -> double& { return placed_v[std::size_t(i)]; });
  for (const DofPlace& f : following_dofs(m)) {
    const auto iq = std::size_t(f.q), iv = std::size_t(f.v);
    check(m.q_names[iq], q[iq], placed_q[iq]);
    check(m.v_names[iv], v[iv], placed_v[iv]);
  }
}

}  // namespace

void Batch::displace_state(int environment, std::span<const double> q, std::span<const double> v) {
  displace(lane(environment), q, v);
  if (steps(environment) == 0) fill_past_states(lane(environment));
}

void Batch::displace(std::size_t lane, std::span<const double> q, std::span<const double> v) {
  const CompiledModel& m = compiled(model_);
  check_size("q", q.size(), as_size(m.nq));
  check_size("v", v.size(), as_size(m.nv));
  check_followers(m, q, v);
  double* const own = column(lane);
  for (int i = 0; i < m.nq; ++i) own[(m.layout.q + i) * kBlock] = q[std::size_t(i)];
  for (int i = 0; i < m.nv; ++i) own[(m.layout.v + i) * kBlock] = v[std::size_t(i)];
  place_followers(
      m, [&](int i) -> double& { return own[(m.layout.q + i) * kBlock]; },
      [&](int i) -> double& { return own[(m.layout.v + i) * kBlock]; });
  place_transmissions(lane);
  sleep_[lane].wake();
  clearance_[lane] = 0;
}

void Batch::write_state(std::size_t lane, std::span<const double> q, std::span<const double> v) {
  displace(lane, q, v);
  complete_state(lane);
}

/// Fills the earlier states with the state of now.
void Batch::fill_past_states(std::size_t lane) {
  const BlockLayout& layout = compiled(model_).layout;
  double* const own = column(lane);
  const int numbers = layout.previous_q - layout.q;  // q, then v
  for (int k = 0; k < layout.past_states * numbers; ++k)
    own[(layout.past + k) * kBlock] = own[(layout.q + k % numbers) * kBlock];
}

/// Scales quaternions to length one. Copies the state to the state one step before and to the past
/// states of sensors with lag.
void Batch::complete_state(std::size_t lane) {
  const CompiledModel& m = compiled(model_);
  double* const own = column(lane);
  const auto at = [&](int row) -> double& { return own[row * kBlock]; };
  for (const kernels::Link& link : m.links) {
    if (link.kind != kernels::JointKind::spherical) continue;
    const int first = m.layout.q + link.q;
    double square = 0;
    for (int k = 0; k < 4; ++k) square += at(first + k) * at(first + k);
    // Already unit to rounding: kept as is, so that a stored state continues bit for bit.
    if (std::abs(square - 1) < 1e-14) continue;
    const double scale = 1 / std::sqrt(square);
    for (int k = 0; k < 4; ++k) at(first + k) *= scale;
  }
  place_transmissions(lane);
  for (int i = 0; i < m.nq; ++i) at(m.layout.previous_q + i) = at(m.layout.q + i);
  for (int i = 0; i < m.nv; ++i) at(m.layout.previous_v + i) = at(m.layout.v + i);
  fill_past_states(lane);
}

void Batch::get_q(int environment, std::span<double> q) const {
  const double* const column = this->column(lane(environment));
  const CompiledModel& m = compiled(model_);
  check_size("q", q.size(), as_size(m.nq));
  for (int i = 0; i < m.nq; ++i) q[i] = column[std::size_t(m.layout.q + i) * kBlock];
}

void Batch::get_v(int environment, std::span<double> v) const {
  const double* const column = this->column(lane(environment));
  const CompiledModel& m = compiled(model_);
  check_size("v", v.size(), as_size(m.nv));
  for (int i = 0; i < m.nv; ++i) v[i] = column[std::size_t(m.layout.v + i) * kBlock];
}

std::span<const double> Batch::q_lanes(int block) const {
  const CompiledModel& m = compiled(model_);
  return {this->block(block) + as_size(m.layout.q) * kBlock, as_size(m.nq) * kBlock};
}

std::span<const double> Batch::v_lanes(int block) const {
  const CompiledModel& m = compiled(model_);
  return {this->block(block) + as_size(m.layout.v) * kBlock, as_size(m.nv) * kBlock};
}

void Batch::set_state(int environment, std::span<const double> q, std::span<const double> v) {
  const std::size_t lane = this->lane(environment);
  write_state(lane, q, v);
  shear_[lane].clear();
  status_[lane] = StepStatus::converged;
  has_history_[lane] = 0;
}

void Batch::set_state(int environment, std::span<const double> q, std::span<const double> v,
                      std::span<const double> previous_q, std::span<const double> previous_v) {
  const std::size_t lane = this->lane(environment);
  const CompiledModel& m = compiled(model_);
  check_size("q", q.size(), as_size(m.nq));
  check_size("v", v.size(), as_size(m.nv));
  write_state(lane, previous_q, previous_v);
  double* const column = this->column(lane);
  std::vector<double> before_q(m.nq), before_v(m.nv);
  get_q(environment, before_q);
  get_v(environment, before_v);
  write_state(lane, q, v);
  for (int i = 0; i < m.nq; ++i)
    column[std::size_t(m.layout.previous_q + i) * kBlock] = before_q[i];
  for (int i = 0; i < m.nv; ++i)
    column[std::size_t(m.layout.previous_v + i) * kBlock] = before_v[i];
  shear_[lane].clear();
  status_[lane] = StepStatus::converged;
  has_history_[lane] = 1;
}

void Batch::set_shear_state(int environment, std::span<const ShearEntry> state) {
  const std::size_t lane = this->lane(environment);
  const int points = compiled(model_).shear_state_points();
  int last = -1;
  for (const ShearEntry& e : state) {
    if (e.point <= last || e.point >= points)
      throw InputError("shear state: point " + std::to_string(e.point) + " after point " +
                       std::to_string(last) + "; expected rising numbers below " +
                       std::to_string(points));
    for (const double s : e.s)
      if (!std::isfinite(s))
        throw InputError("shear state: point " + std::to_string(e.point) + " is not finite");
    last = e.point;
  }
  shear_[lane].assign(state.begin(), state.end());
}

void Batch::set_sleep(int environment, const SleepState& state) {
  const std::size_t lane = this->lane(environment);
  const CompiledModel& m = compiled(model_);
  const std::vector<int> tree = trees_of(m);
  const int trees = tree.empty() ? 0 : std::ranges::max(tree) + 1;
  const auto is_island = [&](int t) { return t >= -1 && t < trees; };
  if (!state.asleep.empty() &&
      (std::ssize(state.asleep) != trees || std::ssize(state.island) != trees ||
       std::ssize(state.rested) != trees || std::ssize(state.u) != m.nu ||
       !std::ranges::all_of(state.island, is_island) || std::ranges::min(state.rested) < 0 ||
       std::ranges::max(state.rested) == std::numeric_limits<int>::max() ||
       std::isnan(state.clearance) ||
       !std::ranges::all_of(state.u, [](double x) { return std::isfinite(x); })))
    throw InputError("sleep state of environment " + std::to_string(environment) +
                     "; expected islands and steps of rest of " + std::to_string(trees) +
                     " trees and " + std::to_string(m.nu) + " finite controls");
  SleepState& own = sleep_[lane];
  own = state;
  own.bodies = 0;
  if (state.asleep.empty()) return;
  const auto sleeps = [&](int link) {
    return link >= 0 && own.asleep[std::size_t(tree[std::size_t(link)])] != 0;
  };
  for (std::size_t t = 0; t < own.asleep.size(); ++t) own.asleep[t] = own.island[t] >= 0 ? 1 : 0;
  for (const CompiledBody& body : m.bodies) own.bodies += sleeps(body.link) ? 1 : 0;
  double* const column = this->column(lane);
  const auto row = [&](int r) -> double& { return column[r * kBlock]; };
  for (std::size_t i = 0; i < m.links.size(); ++i) {
    if (!sleeps(static_cast<int>(i))) continue;
    const kernels::Link& link = m.links[i];
    for (int k = link.q; k < link.q + kernels::coordinates(link.kind); ++k)
      row(m.layout.previous_q + k) = row(m.layout.q + k);
    for (int k = link.v; k < link.v + kernels::dofs(link.kind); ++k)
      row(m.layout.previous_v + k) = row(m.layout.v + k) = 0;
  }
}

void Batch::set_failed(int environment, StepStatus status) {
  if (!failed(status))
    throw InputError(std::string("status '") + to_string(status) +
                     "' is none of a failed environment");
  status_[lane(environment)] = status;
}

int Batch::failed_count() const {
  const auto all = statuses();
  return static_cast<int>(
      std::count_if(all.begin(), all.end(), [](StepStatus s) { return failed(s); }));
}

BlockState Batch::save_block(int block) const {
  const double* const rows = this->block(block);
  const auto lane = std::ptrdiff_t(block) * kBlock;
  return {{rows, rows + block_stride_},
          {status_.begin() + lane, status_.begin() + lane + kBlock},
          {has_history_.begin() + lane, has_history_.begin() + lane + kBlock},
          {steps_.begin() + lane, steps_.begin() + lane + kBlock},
          {shear_.begin() + lane, shear_.begin() + lane + kBlock},
          {sleep_.begin() + lane, sleep_.begin() + lane + kBlock}};
}

void Batch::restore_block(int block, const BlockState& state) {
  double* const rows = this->block(block);
  check_size("state of a block", state.rows.size(), block_stride_);
  const auto lane = std::ptrdiff_t(block) * kBlock;
  std::copy(state.rows.begin(), state.rows.end(), rows);
  std::copy(state.status.begin(), state.status.end(), status_.begin() + lane);
  std::copy(state.has_history.begin(), state.has_history.end(), has_history_.begin() + lane);
  std::copy(state.steps.begin(), state.steps.end(), steps_.begin() + lane);
  std::copy(state.shear.begin(), state.shear.end(), shear_.begin() + lane);
  std::copy(state.sleep.begin(), state.sleep.end(), sleep_.begin() + lane);
  std::fill_n(clearance_.begin() + lane, kBlock, 0.0);
}

bool Batch::is_parameter(int k) const {
  const CompiledModel& m = compiled(model_);
  const auto count = std::ssize(m.randomized_row);
  return m.randomized_row[checked_index("randomized number", k, count)] >= m.layout.parameters;
}

double Batch::randomized_value(int environment, int k) const {
  const CompiledModel& m = compiled(model_);
  if (is_parameter(k)) {
    const int row = m.randomized_row[std::size_t(k)];
    return column(lane(environment))[std::size_t(row) * kBlock];
  }
  return drawn_number(m, seed_, episode(environment), std::size_t(k));
}

void Batch::set_randomized_value(int environment, int k, double value) {
  const std::size_t lane = this->lane(environment);
  const CompiledModel& m = compiled(model_);
  if (!is_parameter(k)) refuse_start(randomization(k));
  column(lane)[std::size_t(m.randomized_row[std::size_t(k)]) * kBlock] = value;
  complete_numbers(lane);
}

void Batch::set_all_randomized(int environment, std::span<const double> values) {
  check_size("values", values.size(), compiled(model_).randomized_row.size());
  std::vector<int> changed;
  std::vector<double> to;
  for (int k = 0; k < static_cast<int>(values.size()); ++k) {
    const double value = values[std::size_t(k)];
    if (!is_parameter(k) || randomized_value(environment, k) == value) continue;
    changed.push_back(k);
    to.push_back(value);
  }
  if (!changed.empty()) set_randomized_values({&environment, 1}, changed, to);
}

void Batch::set_randomized_values(std::span<const int> environments, std::span<const int> numbers,
                                  std::span<const double> values) {
  const CompiledModel& m = compiled(model_);
  const std::size_t count = numbers.size();
  check_size("values", values.size(), environments.size() * count);
  std::vector<int> rows;
  for (const int k : numbers) {
    if (!is_parameter(k)) refuse_start(randomization(k));
    rows.push_back(m.randomized_row[std::size_t(k)]);
  }
  for (std::size_t i = 0; i < environments.size(); ++i) {  // all are checked before one is set
    const double* const now = column(lane(environments[i]));
    const std::span<const double> own = values.subspan(i * count, count);
    std::string fault;
    for (std::size_t j = 0; j < count && fault.empty(); ++j) {
      const SceneNumber& number = randomization(numbers[j]).number;
      fault = varying_value_fault(number, own[j]);
      if (!fault.empty()) fault = "'" + name_of(number) + "' cannot be " + fault;
    }
    if (fault.empty())
      fault = sizes_fault(m, [&](int row) {
        const auto at = std::ranges::find(rows, row);
        return at == rows.end() ? now[row * kBlock] : own[std::size_t(at - rows.begin())];
      });
    if (!fault.empty())
      throw InputError("environment " + std::to_string(environments[i]) + ": " + fault);
  }
  for (std::size_t i = 0; i < environments.size(); ++i) {
    const std::size_t lane = this->lane(environments[i]);
    for (std::size_t j = 0; j < count; ++j) column(lane)[rows[j] * kBlock] = values[i * count + j];
    complete_numbers(lane);
  }
}

/// Computes what depends on the numbers of an environment that were set.
void Batch::complete_numbers(std::size_t lane) {
  update_derived_rows(compiled(model_), column(lane));
  sleep_[lane].wake();
  clearance_[lane] = 0;
}

}  // namespace tangere
