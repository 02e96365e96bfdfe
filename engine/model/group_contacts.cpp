// SPDX-License-Identifier: Apache-2.0
// Bounds the points of each contact by a ball, then sorts contacts by their links.
#include "engine/model/group_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "engine/model/body_shape.hpp"
#include "engine/model/compiled_layer.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/scene/shapes.hpp"
#include "kernels/contact/distance.hpp"

namespace tangere {

namespace {

/// Appends the indices of `items` to `order` group by group, in the order of first appearance.
/// `same`: whether two items belong together. Returns where each group begins, and the end.
template <class Item, class Same>
std::vector<int> gather(const std::vector<Item>& items, const Same& same, std::vector<int>& order) {
  std::vector<int> begins;
  std::vector<char> taken(items.size(), 0);
  for (std::size_t i = 0; i < items.size(); ++i) {
    if (taken[i] != 0) continue;
    begins.push_back(static_cast<int>(order.size()));
    for (std::size_t j = i; j < items.size(); ++j) {
      if (taken[j] != 0 || !same(items[i], items[j])) continue;
      taken[j] = 1;
      order.push_back(static_cast<int>(j));
    }
  }
  begins.push_back(static_cast<int>(order.size()));
  return begins;
}

}  // namespace

void bound(const double* points, int n, kernels::Vec3<double>& middle, double& extent) {
  const kernels::Vec3<double> first = {points[0], points[1], points[2]};
  kernels::Vec3<double> low = first, high = first;
  for (int k = 0; k < n; ++k) {
    const double* p = points + 3 * k;
    low = {std::min(low.x, p[0]), std::min(low.y, p[1]), std::min(low.z, p[2])};
    high = {std::max(high.x, p[0]), std::max(high.y, p[1]), std::max(high.z, p[2])};
  }
  middle = 0.5 * (low + high);
  double square = 0;
  for (int k = 0; k < n; ++k) {
    const kernels::Vec3<double> arm =
        kernels::Vec3<double>{points[3 * k], points[3 * k + 1], points[3 * k + 2]} - middle;
    square = std::max(square, dot(arm, arm));
  }
  // Rounded up by far more than the rounding of poses: a bound that is too small by one bit would
  // be no bound.
  extent = std::sqrt(square) * (1 + 1e-9) + 1e-9;
}

namespace {

/// Returns the radius of a ball around a pair's shape frame outside of which nothing touches; none
/// where there is no such ball, or where it depends on the environment.
double radius_of(const kernels::PairContact& pair) {
  if (!row_of(pair.shape).bounded || pair.size_row >= 0) return INFINITY;
  if (pair.shape == PrimitiveShape::mesh) {
    double square = 0;
    for (int i = 0; i < 3; ++i) {
      const double most = std::max(std::abs(pair.grid->low[i]), std::abs(pair.grid->high[i]));
      square += most * most;
    }
    return pair.size.x * std::sqrt(square);  // the grid is that of scale 1
  }
  CompiledBody body;
  body.shape = pair.shape;
  body.size = pair.size;
  return hull_of(body).radius;
}

/// Puts balls around all contact points and all shapes of two links.
void bound_pair(const CompiledModel& m, kernels::LinkPair& links) {
  std::vector<double> points;
  kernels::Vec3<double> low{INFINITY, INFINITY, INFINITY}, high = -low;
  const auto members =
      std::span(m.pair_order).subspan(std::size_t(links.first), std::size_t(links.count));
  for (const int k : members) {
    const kernels::PairContact& pair = m.pairs[std::size_t(k)];
    points.insert(points.end(), pair.points, pair.points + 3 * pair.n_points);
    const kernels::Vec3<double>& at = pair.frame2.p;
    low = {std::min(low.x, at.x), std::min(low.y, at.y), std::min(low.z, at.z)};
    high = {std::max(high.x, at.x), std::max(high.y, at.y), std::max(high.z, at.z)};
  }
  double points_radius = 0, shapes_radius = 0, balls_radius = 0;
  bool faced = false;
  bound(points.data(), static_cast<int>(points.size() / 3), links.points_middle, points_radius);
  links.shapes_middle = 0.5 * (low + high);
  for (const int k : members) {
    const kernels::PairContact& pair = m.pairs[std::size_t(k)];
    const kernels::Vec3<double> arm = pair.frame2.p - links.shapes_middle;
    shapes_radius =
        std::max(shapes_radius, std::sqrt(dot(arm, arm)) + radius_of(pair) + 2 * pair.overhang);
    balls_radius = std::max({balls_radius, pair.ball_radius, bulge_of(m, pair)});
    faced = faced || pair.faced;
  }
  const auto rounded_up = [](double x) { return x * (1 + 1e-9) + 1e-9; };  // as in bound()
  links.points_radius = points_radius + rounded_up(balls_radius);
  links.shapes_radius = rounded_up(shapes_radius);
  // A chosen face has no bound in depth.
  links.apart = faced ? INFINITY : points_radius + rounded_up(balls_radius + shapes_radius);
}

/// Grows a ball so that it holds another one.
void hold(kernels::LinkBall& ball, const kernels::Vec3<double>& centre, double radius) {
  if (ball.radius < 0) {
    ball = {centre, radius};
    return;
  }
  const kernels::Vec3<double> arm = centre - ball.centre;
  const double way = std::sqrt(dot(arm, arm));
  if (way + radius <= ball.radius) return;
  if (!(radius < INFINITY) || way + ball.radius <= radius) {
    ball = {centre, radius};
    return;
  }
  const double both = 0.5 * (way + radius + ball.radius);
  ball.centre = ball.centre + ((both - ball.radius) / way) * arm;
  ball.radius = both * (1 + 1e-9);
}

}  // namespace

void bound_links(CompiledModel& m) {
  for (kernels::LinkPair& links : m.link_pairs) bound_pair(m, links);
}

double bulge_of(const CompiledModel& m, const kernels::PairContact& pair) {
  return pair.layer_pad < 0 ? 0 : m.layer_pads[std::size_t(pair.layer_pad)].layer->bulge();
}

void number_layers(CompiledModel& m) {
  m.layer_link_pairs = 0;
  for (kernels::LinkPair& links : m.link_pairs) {
    links.layer = -1;
    for (int i = links.first; i < links.first + links.count; ++i)
      if (m.pairs[std::size_t(m.pair_order[std::size_t(i)])].layer_pad >= 0)
        links.layer = m.layer_link_pairs;
    if (links.layer >= 0) ++m.layer_link_pairs;
  }
}

void find_link_balls(CompiledModel& m) {
  m.link_balls.clear();
  if (m.link_pairs.size() < kManyLinkPairs) return;
  m.link_balls.assign(m.links.size(), {{0, 0, 0}, -1});
  for (const kernels::LinkPair& links : m.link_pairs) {
    if (links.link1 >= 0)
      hold(m.link_balls[std::size_t(links.link1)], links.points_middle, links.points_radius);
    if (links.link2 >= 0)
      hold(m.link_balls[std::size_t(links.link2)], links.shapes_middle, links.shapes_radius);
  }
}

void group_contacts(CompiledModel& m) {
  for (kernels::PairContact& p : m.pairs) {
    bound(p.points, p.n_points, p.middle, p.extent);
    p.extent += p.ball_radius;
  }
  for (kernels::GroundContact& g : m.grounds) {
    bound(g.points, g.n_points, g.middle, g.extent);
    g.extent += g.radius;
  }
  const std::vector<int> pairs = gather(
      m.pairs,
      [](const auto& a, const auto& b) { return a.link1 == b.link1 && a.link2 == b.link2; },
      m.pair_order);
  for (std::size_t g = 0; g + 1 < pairs.size(); ++g) {
    const kernels::PairContact& first = m.pairs[std::size_t(m.pair_order[std::size_t(pairs[g])])];
    kernels::LinkPair links = {first.link1, first.link2, pairs[g], pairs[g + 1] - pairs[g],
                               0,           0,           false,    first.frame2.p,
                               false,       {},          {},       INFINITY,
                               INFINITY,    INFINITY};
    links.ball = links.count == 1 && kernels::is_ball(first.shape);
    double pitch = INFINITY;
    for (int i = pairs[g]; i < pairs[g + 1]; ++i) {
      kernels::PairContact& pair = m.pairs[std::size_t(m.pair_order[std::size_t(i)])];
      // Faces between the parts of a body that is put together of several are inside it, and a body
      // that has several may be hollow.
      if (links.count > 1) pair.faced = false;
      links.reach = std::max(links.reach, pair.reach);
      links.faced = links.faced || pair.faced;
      pitch = std::min(pitch, pair.extent * std::sqrt(4 * M_PI / pair.n_points));
    }
    // How far a lane may move before it is searched again. Where points are far apart, a wide
    // margin lists few more of them.
    links.margin = std::max(links.reach / 200, pitch / 16);
    m.link_pairs.push_back(links);
  }
  const std::vector<int> grounds = gather(
      m.grounds, [](const auto& a, const auto& b) { return a.link == b.link; }, m.ground_order);
  for (std::size_t g = 0; g + 1 < grounds.size(); ++g)
    m.grounded.push_back({m.grounds[std::size_t(m.ground_order[std::size_t(grounds[g])])].link,
                          grounds[g], grounds[g + 1] - grounds[g]});
}

}  // namespace tangere
