// SPDX-License-Identifier: Apache-2.0
// Sort and sweep along the axis on which the centres spread most.
#include "engine/step/broad_phase.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>

namespace tangere {

using kernels::Row;
using kernels::Stage;

namespace {

/// Slack at first, as a share of the radius, and growth beyond the motion that exceeded it.
constexpr double kSlack = 0.25, kGrowth = 1.5;

bool is_finite(const kernels::LinkBall& ball) { return ball.radius >= 0 && ball.radius < INFINITY; }

}  // namespace

template <int L>
BroadPhase<L>::BroadPhase(const CompiledModel& model) : model_(&model) {
  if (model.link_balls.empty()) return;
  const std::size_t links = model.links.size();
  starts_.resize(3 * links);
  slack_.resize(links);
  moves_.resize(links);
  lanes_.assign(model.link_pairs.size(), 0);
  const auto has_ball = [&](int link) {
    return link >= 0 && is_finite(model.link_balls[std::size_t(link)]);
  };
  std::vector<std::vector<Neighbour>> lists(links);
  for (std::size_t g = 0; g < model.link_pairs.size(); ++g) {
    const int pair = static_cast<int>(g), a = model.link_pairs[g].link1,
              b = model.link_pairs[g].link2;
    if (!has_ball(a) || !has_ball(b)) {
      always_.push_back(pair);
    } else {
      lists[std::size_t(std::min(a, b))].push_back({std::max(a, b), pair});
    }
  }
  for (std::vector<Neighbour>& list : lists) {
    std::sort(list.begin(), list.end(), [](const Neighbour& x, const Neighbour& y) {
      return x.link != y.link ? x.link < y.link : x.pair < y.pair;
    });
    first_neighbour_.push_back(static_cast<int>(neighbours_.size()));
    neighbours_.insert(neighbours_.end(), list.begin(), list.end());
  }
  first_neighbour_.push_back(static_cast<int>(neighbours_.size()));
  for (std::size_t i = 0; i < links; ++i)
    if (is_finite(model.link_balls[i])) balls_.push_back(static_cast<int>(i));
}

template <int L>
void BroadPhase<L>::start(Stage<L>& stage) {
  stage.ball_starts = starts_.data();
  stage.ball_slack = slack_.data();
  stage.ball_moves = moves_.data();
  for (const int i : balls_)
    slack_[std::size_t(i)] = Row<L>::all(kSlack * model_->link_balls[std::size_t(i)].radius);
  for (const int pair : considered_) lanes_[std::size_t(pair)] = 0;
}

template <int L>
bool BroadPhase<L>::widen(unsigned lanes) {
  bool grew = false;
  for (const int i : balls_)
    for (int l = 0; l < L; ++l) {
      double& slack = slack_[std::size_t(i)][l];
      const double moved = moves_[std::size_t(i)][l];
      if ((lanes >> l & 1U) == 0 || !(moved > slack)) continue;
      slack = kGrowth * moved;
      grew = true;
    }
  return grew;
}

template <int L>
void BroadPhase<L>::consider(int link1, int link2, int lane) {
  const int a = std::min(link1, link2), b = std::max(link1, link2);
  const auto end = neighbours_.begin() + first_neighbour_[std::size_t(a) + 1];
  auto at = std::lower_bound(neighbours_.begin() + first_neighbour_[std::size_t(a)], end, b,
                             [](const Neighbour& n, int link) { return n.link < link; });
  for (; at != end && at->link == b; ++at) {
    if (lanes_[std::size_t(at->pair)] == 0) found_.push_back(at->pair);
    lanes_[std::size_t(at->pair)] |= 1U << lane;
  }
}

template <int L>
void BroadPhase<L>::find_in_lane(int lane) {
  const auto at = [&](int link, int axis) { return starts_[std::size_t(3 * link + axis)][lane]; };
  const auto reach = [&](int link) {
    return model_->link_balls[std::size_t(link)].radius + slack_[std::size_t(link)][lane];
  };
  int axis = 0;
  double widest = -1;
  for (int k = 0; k < 3; ++k) {
    double low = INFINITY, high = -INFINITY;
    for (const int i : balls_) low = std::min(low, at(i, k)), high = std::max(high, at(i, k));
    if (high - low > widest) widest = high - low, axis = k;
  }
  extents_.clear();
  for (const int i : balls_) {
    const double low = at(i, axis) - reach(i);
    extents_.push_back({std::isnan(low) ? -INFINITY : low, i});
  }
  std::sort(extents_.begin(), extents_.end(), [](const Extent& a, const Extent& b) {
    return a.low != b.low ? a.low < b.low : a.link < b.link;
  });
  for (auto a = extents_.begin(); a != extents_.end(); ++a) {
    const double high = at(a->link, axis) + reach(a->link);
    for (auto b = a + 1; b != extents_.end() && !(b->low > high); ++b) {
      double square = 0;
      for (int k = 0; k < 3; ++k) {
        const double way = at(a->link, k) - at(b->link, k);
        square += way * way;
      }
      const double sum = reach(a->link) + reach(b->link);
      if (!(square > sum * sum)) consider(a->link, b->link, lane);
    }
  }
}

/// Makes the list of considered pairs from those before and those found.
template <int L>
void BroadPhase<L>::collect() {
  std::swap(before_, considered_);
  found_.insert(found_.end(), before_.begin(), before_.end());
  std::erase_if(found_, [&](int pair) { return lanes_[std::size_t(pair)] == 0; });
  found_.insert(found_.end(), always_.begin(), always_.end());
  std::sort(found_.begin(), found_.end());
  found_.erase(std::unique(found_.begin(), found_.end()), found_.end());
  std::swap(considered_, found_);
  added_.clear();
  dropped_.clear();
  std::set_difference(considered_.begin(), considered_.end(), before_.begin(), before_.end(),
                      std::back_inserter(added_));
  std::set_difference(before_.begin(), before_.end(), considered_.begin(), considered_.end(),
                      std::back_inserter(dropped_));
}

template <int L>
bool BroadPhase<L>::find(unsigned lanes, Stage<L>& stage) {
  found_.clear();
  for (const int pair : considered_) lanes_[std::size_t(pair)] &= ~lanes;
  for (int l = 0; l < L; ++l)
    if ((lanes >> l & 1U) != 0) find_in_lane(l);
  collect();
  stage.considered = considered_.data();
  stage.n_considered = static_cast<int>(considered_.size());
  return !added_.empty();
}

template class BroadPhase<1>;
template class BroadPhase<kernels::kGroup>;

}  // namespace tangere
