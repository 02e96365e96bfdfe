// SPDX-License-Identifier: Apache-2.0
// Rest counters, pairs of trees that could touch, falling asleep and waking.
//
// Distances between awake and sleeping bodies are queried only when the awake ones have moved by
// the clearance that the last query found (SleepState::clearance).
#include "engine/step/sleep.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "engine/model/body_shape.hpp"
#include "engine/model/model_part.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/step/lane_energy.hpp"
#include "kernels/contact/pair_contact.hpp"
#include "kernels/step/faces.hpp"

namespace tangere {

using kernels::Frame;
using kernels::JointKind;
using kernels::kBlock;
using kernels::Link;
using kernels::Row;
using kernels::Vec3;

namespace {

constexpr int kFewestSteps = 20;
/// Of √(size/|gravity|), the time in which a body falls by half its size: what rests for so long is
/// not at the top of a flight.
constexpr double kFallTimes = 2;
/// At most a third of the dofs may be awake where others sleep. If eight lanes of a group have
/// eight different parts that are awake, they are stepped one after the other. With more than a
/// third each that takes longer than all of the model in all lanes at once.
constexpr int kFewestPerAwake = 3;
/// Distance queries search up to kFarSearch times the needed distance, in steps of kFiner.
constexpr double kFarSearch = 64, kFiner = 4;

/// From the sum of a quaternion's changes to an angle: θ = 4 asin(|Δq|/2) ≤ π/√2 |Δq| up to a half
/// turn, and more in a step is an error.
constexpr double kOfQuaternion = M_PI * M_SQRT1_2;

double length(const Vec3<double>& a) { return std::sqrt(dot(a, a)); }

}  // namespace

Sleep::Sleep(const CompiledModel& model, double share, double h)
    : model_(model), tree_(trees_of(model)) {
  const std::size_t trees = tree_.empty() ? 0 : std::size_t(std::ranges::max(tree_)) + 1;
  label_.resize(trees);
  dofs_.resize(trees);
  for (std::size_t i = 0; i < model.links.size(); ++i)
    dofs_[std::size_t(tree_[i])] += kernels::dofs(model.links[i].kind);
  bodies_.resize(trees);
  std::vector<double> size(trees, HUGE_VAL);
  for (const CompiledBody& body : model.bodies) {
    if (body.link < 0) continue;
    const std::size_t t = std::size_t(tree_[std::size_t(body.link)]);
    ++bodies_[t];
    if (body.extent > 0) size[t] = std::min(size[t], body.extent);
  }
  const double gravity = length(model.view.gravity);
  constexpr int kMost = std::numeric_limits<int>::max() / 2;
  for (const double s : size) {
    const bool known = std::isfinite(s);
    const double falls = known && gravity > 0 ? kFallTimes * std::sqrt(s / gravity) / h : 0;
    steps_.push_back(
        static_cast<int>(std::clamp(std::ceil(falls), double(kFewestSteps), double(kMost))));
    limit_.push_back(known ? share * s / steps_.back() : 0);
  }
  for (const CompiledMotor& motor : model.motors)
    motor_tree_.push_back(tree_[std::size_t(motor.link)]);
  measure();
  add_tree_pairs();
}

/// Finds how far coordinates move points.
void Sleep::measure() {
  std::vector<double> arm(model_.links.size());
  const auto reach = [&](int link, double distance) {
    for (int i = link; i >= 0; i = model_.links[std::size_t(i)].parent) {
      arm[std::size_t(i)] = std::max(arm[std::size_t(i)], distance);
      distance += length(model_.links[std::size_t(i)].frame.p);
    }
  };
  for (const CompiledBody& body : model_.bodies) {
    if (body.link < 0) continue;
    double radius = body.extent;
    if (body.touchable) radius = std::max(radius, hull_of(body).radius);
    if (body.touchable && !row_of(body.shape).bounded) bounded_ = false;
    reach(body.link, length(body.frame.p) + radius);
  }
  for (const kernels::PairContact& pair : model_.pairs) reach(pair.link1, pair.reach);
  for (const kernels::GroundContact& ground : model_.grounds)
    reach(ground.link, length(ground.middle) + ground.extent);
  if (!model_.varying_sizes.empty() || !model_.varying_places.empty()) bounded_ = false;
  weight_.resize(std::size_t(model_.nq));
  tree_of_q_.resize(std::size_t(model_.nq));
  for (std::size_t i = 0; i < model_.links.size(); ++i) {
    const Link& link = model_.links[i];
    // What slides out lengthens the arms of joints that turn before it.
    if (link.parent >= 0 && kernels::slides(link.kind) && !link.parent_never_rotates)
      bounded_ = false;
    const double weight = kernels::slides(link.kind)          ? 1
                          : link.kind == JointKind::spherical ? kOfQuaternion * arm[i]
                                                              : arm[i];
    for (int k = 0; k < kernels::coordinates(link.kind); ++k) {
      weight_[std::size_t(link.q + k)] = weight;
      tree_of_q_[std::size_t(link.q + k)] = tree_[i];
    }
  }
}

void Sleep::add_tree_pairs() {
  for (std::size_t g = 0; g < model_.link_pairs.size(); ++g) {
    const kernels::LinkPair& links = model_.link_pairs[g];
    if (links.link1 < 0 || links.link2 < 0) continue;
    const int tree1 = tree_[std::size_t(links.link1)], tree2 = tree_[std::size_t(links.link2)];
    if (tree1 != tree2) tree_pairs_.push_back({static_cast<int>(g), tree1, tree2});
  }
}

void Sleep::wake_on_control_change(SleepState& s, std::span<const double> u) const {
  if (s.asleep.empty()) {
    s.asleep.assign(steps_.size(), 0);
    s.island.assign(steps_.size(), -1);
    s.rested.assign(steps_.size(), 0);
    s.u.assign(u.begin(), u.end());
  }
  if (!s.resting && s.bodies == 0)
    return;  // the next rest begins with one step that does not count
  if (std::memcmp(u.data(), s.u.data(), u.size_bytes()) == 0) return;
  for (std::size_t k = 0; k < u.size(); ++k) {
    if (u[k] == s.u[k]) continue;
    s.u[k] = u[k];
    const std::size_t tree = std::size_t(motor_tree_[k]);
    s.rested[tree] = 0;
    if (s.asleep[tree] != 0) wake_island(s, static_cast<int>(tree));
  }
}

template <int L>
void Sleep::movements(const double* rows, const BasicWorkspace<L>& w, std::span<const int> q,
                      Row<L>* out) const {
  std::fill_n(out, steps_.size(), Row<L>{});
  for (std::size_t i = 0; i < q.size(); ++i) {
    const std::size_t k = std::size_t(q[i]);
    const double* before = rows + (std::size_t(model_.layout.q) + k) * kBlock;
    Row<L>& sum = out[tree_of_q_[k]];
    const double weight = weight_[k];
    for (int l = 0; l < L; ++l) sum[l] += weight * std::abs(w.q0[i][l] - before[l]);
  }
}

void Sleep::wake_island(SleepState& s, int tree) const {
  const int island = s.island[std::size_t(tree)];
  const auto wake = [&](const auto& which) {
    for (std::size_t t = 0; t < steps_.size(); ++t) {
      if (s.asleep[t] == 0 || !which(t)) continue;
      s.island[t] = -1;
      s.asleep[t] = 0;
      s.rested[t] = 0;
      s.bodies -= bodies_[t];
    }
  };
  wake([&](std::size_t t) { return s.island[t] == island; });
  if (!saves_time(s.asleep)) wake([](std::size_t) { return true; });
  s.clearance = 0;
}

bool Sleep::saves_time(std::span<const std::uint8_t> asleep) const {
  int awake = 0;
  for (std::size_t t = 0; t < steps_.size(); ++t) awake += asleep[t] != 0 ? 0 : dofs_[t];
  return kFewestPerAwake * awake <= model_.nv;
}

/// Computes the poses of all links at the q0 of `single`.
void Sleep::find_poses(const kernels::KernelTable& table, const double* column,
                       SingleWorkspace& single) {
  single.stage.block = column;
  single.stage.group = 0;
  table.single.poses_at(model_.view, single.stage, single.q0, single.zero, single.zero,
                        single.poses_after.data());
}

namespace {

/// Calls f with each pair of two links: pair, its shape's frame in body 1, and its size.
template <class F>
void for_pairs(const CompiledModel& m, const kernels::LinkPair& links, const double* column,
               const SingleWorkspace& single, const F& f) {
  const auto world = [&](int link) {
    return frame_in_lane<1>(single.poses_after[std::size_t(link)], 0);
  };
  const Frame<double> link2_in_1 = relative(world(links.link1), world(links.link2));
  for (int i = links.first; i < links.first + links.count; ++i) {
    const kernels::PairContact& pair = m.pairs[std::size_t(m.pair_order[std::size_t(i)])];
    f(pair, compose(link2_in_1, pair.frame2),
      kernels::load_vector<double>(pair.size, pair.size_row, column, 0));
  }
}

}  // namespace

/// Returns a distance by which no point of the links is nearer to a shape of the others; less than
/// `reach` where it is not known to be as large as that.
double Sleep::distance_to_contact(const kernels::LinkPair& links, const double* column,
                                  double reach, const SingleWorkspace& single) const {
  double way = kFarSearch * reach;
  for_pairs(model_, links, column, single,
            [&](const kernels::PairContact& pair, const Frame<double>& at, const auto& size) {
              kernels::with_touched<double>(
                  pair, size, Vec3<double>{}, [&]<class Shape>(const Shape& shape) {
                    const Vec3<double> middle = transposed_times(at.R, pair.middle - at.p);
                    while (way >= reach && nearer_than(shape, middle, pair.extent + way))
                      way /= kFiner;
                  });
            });
  return way;
}

/// Whether a point of the links is nearer than `reach` to a shape of the others.
bool Sleep::within(const kernels::KernelTable& table, const kernels::LinkPair& links,
                   const double* column, double reach, SingleWorkspace& single) const {
  bool found = false;
  for_pairs(
      model_, links, column, single,
      [&](const kernels::PairContact& pair, const Frame<double>& at, const auto& size) {
        if (found) return;
        double pose[12];
        for (int i = 0; i < 9; ++i) pose[i] = at.R.m[i / 3][i % 3];
        pose[9] = at.p.x, pose[10] = at.p.y, pose[11] = at.p.z;
        const int stride = search_stride(pair);
        found = table.find_candidates({&pair, size, pose, reach + pair.overhang,
                                       single.search.data(), stride, Vec3<double>{}, nullptr}) > 0;
      });
  return found;
}

bool Sleep::no_awake_body_in_reach(SleepState& s, double moved) const {
  s.clearance -= moved;
  return bounded_ && s.clearance >= 2 * moved;
}

bool Sleep::wake_touched(const kernels::KernelTable& table, const SleepingLane& at,
                         std::span<const double> q, double moved, SingleWorkspace& single) {
  SleepState& s = at.state;
  for (std::size_t i = 0; i < q.size(); ++i) single.q0[i][0] = q[i];
  find_poses(table, at.column, single);
  double clearance = HUGE_VAL;
  bool touched = false, woken = false;
  for (const TreePair& m : tree_pairs_) {
    if (s.asleep[std::size_t(m.tree1)] == s.asleep[std::size_t(m.tree2)]) continue;
    const kernels::LinkPair& links = model_.link_pairs[std::size_t(m.pair)];
    const double reach = links.margin + 2 * moved;
    const double way = distance_to_contact(links, at.column, reach, single);
    if (way >= reach || !within(table, links, at.column, reach, single)) {
      clearance = std::min(clearance, std::max(way, reach));
      continue;
    }
    constexpr double kTouching = 1e-9;  // [m] below what contacts resolve
    touched = touched || within(table, links, at.column, kTouching, single);
    wake_island(s, s.asleep[std::size_t(m.tree1)] != 0 ? m.tree1 : m.tree2);
    woken = true;
  }
  s.clearance = woken ? 0 : clearance;  // what woke has neighbours of its own
  return touched;
}

/// Labels trees that are awake: those that could touch each other, directly or through others, have
/// the same label, which is their lowest number. Pairs of which neither has rested are left out.
/// Returns false where no tree that has rested is without others that have not.
bool Sleep::group_by_nearness(const kernels::KernelTable& table, const SleepingLane& at,
                              SingleWorkspace& single) {
  const SleepState& s = at.state;
  for (int i = 0; i < model_.nq; ++i) single.q0[i][0] = at.column[(model_.layout.q + i) * kBlock];
  find_poses(table, at.column, single);
  for (std::size_t t = 0; t < label_.size(); ++t) label_[t] = static_cast<int>(t);
  const auto rested = [&](int t) { return s.rested[std::size_t(t)] >= steps_[std::size_t(t)]; };
  for (const TreePair& m : tree_pairs_) {
    const int from = label_[std::size_t(m.tree1)], to = label_[std::size_t(m.tree2)];
    if (from == to || s.asleep[std::size_t(m.tree1)] != 0 || s.asleep[std::size_t(m.tree2)] != 0)
      continue;
    if (!rested(m.tree1) && !rested(m.tree2)) continue;
    const kernels::LinkPair& links = model_.link_pairs[std::size_t(m.pair)];
    if (distance_to_contact(links, at.column, links.margin, single) >= links.margin) continue;
    if (!within(table, links, at.column, links.margin, single)) continue;
    std::ranges::replace(label_, std::max(from, to), std::min(from, to));
  }
  for (std::size_t t = 0; t < label_.size(); ++t)  // one that has not rested keeps all others awake
    if (const int label = label_[t]; s.asleep[t] == 0 && !rested(static_cast<int>(t)))
      std::ranges::replace(label_, label, -1);
  return std::ranges::any_of(label_, [](int label) { return label >= 0; });
}

void Sleep::fall_asleep(const SleepingLane& at, int tree) const {
  const BlockLayout& layout = model_.layout;
  const auto row = [&](int r) -> double& { return at.column[r * kBlock]; };
  for (std::size_t i = 0; i < model_.links.size(); ++i) {
    if (tree_[i] != tree) continue;
    const Link& link = model_.links[i];
    for (int k = link.q; k < link.q + kernels::coordinates(link.kind); ++k)
      row(layout.previous_q + k) = row(layout.q + k);
    for (int k = link.v; k < link.v + kernels::dofs(link.kind); ++k)
      row(layout.previous_v + k) = row(layout.v + k) = 0;
  }
  at.state.asleep[std::size_t(tree)] = 1;
  at.state.island[std::size_t(tree)] = label_[std::size_t(tree)];
  at.state.bodies += bodies_[std::size_t(tree)];
  at.state.clearance = 0;
}

bool Sleep::update_rest_counters(SleepState& s, const double* moved, int stride,
                                 bool plainly) const {
  s.slept += s.bodies;
  bool due = false, resting = false;
  for (std::size_t t = 0; t < steps_.size(); ++t) {
    if (s.bodies > 0 && s.asleep[t] != 0) continue;
    const bool rests = plainly && moved[std::ptrdiff_t(t) * stride] <= limit_[t];
    const int rested = rests ? s.rested[t] + 1 : 0;
    s.rested[t] = rested;
    resting = resting || rests;
    due = due || (rested >= steps_[t] && rested % steps_[t] == 0);
  }
  s.resting = resting;
  return due;
}

void Sleep::put_to_sleep(const kernels::KernelTable& table, const SleepingLane& at,
                         SingleWorkspace& single) {
  SleepState& s = at.state;
  soon_.assign(s.asleep.begin(), s.asleep.end());
  for (std::size_t t = 0; t < steps_.size(); ++t)
    if (s.rested[t] >= steps_[t]) soon_[t] = 1;
  if (!saves_time(soon_) || !group_by_nearness(table, at, single)) return;
  soon_.assign(s.asleep.begin(), s.asleep.end());
  for (std::size_t t = 0; t < steps_.size(); ++t)
    if (label_[t] >= 0) soon_[t] = 1;
  if (!saves_time(soon_)) return;
  for (std::size_t t = 0; t < steps_.size(); ++t)
    if (s.asleep[t] != soon_[t]) fall_asleep(at, static_cast<int>(t));
}

template void Sleep::movements(const double*, const Workspace&, std::span<const int>,
                               Row<kernels::kGroup>*) const;
template void Sleep::movements(const double*, const SingleWorkspace&, std::span<const int>,
                               Row<1>*) const;

}  // namespace tangere
