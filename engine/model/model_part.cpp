// SPDX-License-Identifier: Apache-2.0
// Filters the arrays of a model and renumbers references to links, dofs and contacts.
#include "engine/model/model_part.hpp"

#include <algorithm>
#include <utility>

#include "engine/model/components.hpp"
#include "engine/model/group_contacts.hpp"

namespace tangere {

namespace {

constexpr int kGone = -2;  // -1 is the world

class Filter {
 public:
  Filter(const CompiledModel& whole, std::span<const int> tree,
         std::span<const std::uint8_t> left_out, bool pushing_alone)
      : whole_(whole),
        part_(std::make_unique<ModelPart>()),
        m_(part_->model),
        pushing_alone_(pushing_alone) {
    links(tree, left_out);
    dofs();
    pairs();
    grounds();
    loops();
    components();
    find_link_balls(m_);
    m_.layer_pads = whole.layer_pads;
    number_layers(m_);
    m_.solids = whole.solids;
    for (const CompiledSensor& s : whole.sensors) {  // only their links matter for a step
      m_.sensors.emplace_back();
      m_.sensors.back().link = s.link < 0 ? s.link : link_[std::size_t(s.link)];
    }
    std::erase_if(m_.sensors, [](const CompiledSensor& s) { return s.link == kGone; });
    m_.origin = whole.origin;
    m_.moved = whole.moved;
    m_.fall_time = whole.fall_time;
    // As in the whole, whose bits its steps have.
    m_.pattern = whole.pattern.slot.empty()
                     ? block_pattern(m_.links, m_.nv)
                     : analyse_pattern(m_.links, m_.nv, touching_, {}, m_.loops);
    m_.view = whole.view;
    point_view(m_);
  }

  std::unique_ptr<ModelPart> part() { return std::move(part_); }

 private:
  [[nodiscard]] int link(int whole_link) const {
    return whole_link < 0 ? whole_link : link_[std::size_t(whole_link)];
  }

  [[nodiscard]] bool stays(const kernels::ContactParameters& contact) const {
    return !pushing_alone_ || can_exert_force(contact);
  }

  void links(std::span<const int> tree, std::span<const std::uint8_t> left_out) {
    link_.assign(whole_.links.size(), kGone);
    for (std::size_t i = 0; i < whole_.links.size(); ++i) {
      if (left_out[std::size_t(tree[i])] != 0) continue;
      kernels::Link l = whole_.links[i];
      for (int k = 0; k < kernels::coordinates(l.kind); ++k) part_->q.push_back(l.q + k);
      for (int k = 0; k < kernels::dofs(l.kind); ++k) part_->v.push_back(l.v + k);
      l.q = std::exchange(m_.nq, m_.nq + kernels::coordinates(l.kind));
      l.v = std::exchange(m_.nv, m_.nv + kernels::dofs(l.kind));
      l.parent = link(l.parent);
      link_[i] = static_cast<int>(m_.links.size());
      m_.links.push_back(l);
    }
  }

  void dofs() {
    dof_.assign(std::size_t(whole_.nv), kGone);
    for (std::size_t i = 0; i < part_->v.size(); ++i) {
      const std::size_t dof = std::size_t(part_->v[i]);
      dof_[dof] = static_cast<int>(i);
      m_.dof_effects.push_back(whole_.dof_effects[dof]);
      m_.unknown_scale.push_back(whole_.unknown_scale[dof]);
    }
  }

  /// Bodies that only a sleeping one connects keep their common norm, so that their steps have the
  /// bits that they have where all are awake.
  void components() {
    if (pushing_alone_) {
      std::vector<std::pair<int, int>> coupled = touching_;
      for (const kernels::Loop& loop : m_.loops) coupled.emplace_back(loop.link1, loop.link2);
      auto [dofs, begin] = find_components(m_.links, coupled);
      m_.component_dofs = std::move(dofs);
      m_.component_begin = std::move(begin);
      return;
    }
    m_.component_begin = {0};
    for (int c = 0; c < whole_.components(); ++c) {
      for (int k = whole_.component_begin[std::size_t(c)];
           k < whole_.component_begin[std::size_t(c) + 1]; ++k)
        if (const int dof = dof_[std::size_t(whole_.component_dofs[std::size_t(k)])]; dof >= 0)
          m_.component_dofs.push_back(dof);
      const int end = static_cast<int>(m_.component_dofs.size());
      if (end > m_.component_begin.back()) m_.component_begin.push_back(end);
    }
  }

  void pairs() {
    for (kernels::LinkPair links : whole_.link_pairs) {
      const int first = links.first;
      links.link1 = link(links.link1);
      links.link2 = link(links.link2);
      if (links.link1 == kGone || links.link2 == kGone) continue;
      links.first = static_cast<int>(m_.pair_order.size());
      for (int i = first; i < first + links.count; ++i) {
        kernels::PairContact pair = whole_.pairs[std::size_t(whole_.pair_order[std::size_t(i)])];
        if (!stays(pair.parameters)) continue;
        pair.link1 = links.link1;
        pair.link2 = links.link2;
        m_.pair_order.push_back(static_cast<int>(m_.pairs.size()));
        m_.pairs.push_back(pair);
      }
      links.count = static_cast<int>(m_.pair_order.size()) - links.first;
      if (links.count == 0) continue;
      m_.link_pairs.push_back(links);
      touching_.emplace_back(links.link1, links.link2);
    }
  }

  void grounds() {
    for (kernels::GroundedLink grounded : whole_.grounded) {
      const int first = grounded.first;
      grounded.link = link(grounded.link);
      if (grounded.link == kGone) continue;
      grounded.first = static_cast<int>(m_.ground_order.size());
      for (int i = first; i < first + grounded.count; ++i) {
        kernels::GroundContact ground =
            whole_.grounds[std::size_t(whole_.ground_order[std::size_t(i)])];
        if (!stays(ground.parameters)) continue;
        ground.link = grounded.link;
        m_.ground_order.push_back(static_cast<int>(m_.grounds.size()));
        m_.grounds.push_back(ground);
      }
      grounded.count = static_cast<int>(m_.ground_order.size()) - grounded.first;
      if (grounded.count > 0) m_.grounded.push_back(grounded);
    }
  }

  void loops() {
    for (kernels::Loop loop : whole_.loops) {
      loop.link1 = link(loop.link1);
      loop.link2 = link(loop.link2);
      if (loop.link1 != kGone && loop.link2 != kGone) m_.loops.push_back(loop);
    }
  }

  const CompiledModel& whole_;
  std::unique_ptr<ModelPart> part_;
  CompiledModel& m_;
  bool pushing_alone_;           // contacts that never push are left out
  std::vector<int> link_, dof_;  // of each link and dof of the whole: its number in the part
  std::vector<std::pair<int, int>> touching_;
};

}  // namespace

std::vector<int> trees_of(const CompiledModel& m) {
  std::vector<int> tree;
  tree.reserve(m.links.size());
  int trees = 0;
  for (const kernels::Link& l : m.links)
    tree.push_back(l.parent < 0 ? trees++ : tree[std::size_t(l.parent)]);
  for (const kernels::Loop& loop : m.loops) {
    if (loop.link1 < 0 || loop.link2 < 0) continue;
    const auto [low, high] =
        std::minmax({tree[std::size_t(loop.link1)], tree[std::size_t(loop.link2)]});
    if (low == high) continue;
    for (int& t : tree)
      if (t >= high) t = t == high ? low : t - 1;
  }
  return tree;
}

std::unique_ptr<ModelPart> part_of(const CompiledModel& whole, std::span<const int> tree,
                                   std::span<const std::uint8_t> left_out) {
  return Filter(whole, tree, left_out, false).part();
}

std::unique_ptr<ModelPart> without_inert_contacts(const CompiledModel& whole) {
  const auto all_push = [](const auto& contacts) {
    return std::ranges::all_of(contacts,
                               [](const auto& c) { return can_exert_force(c.parameters); });
  };
  if (whole.has_shear_state() || whole.has_followers() || !whole.transmissions.empty() ||
      (all_push(whole.pairs) && all_push(whole.grounds)))
    return nullptr;
  const std::vector<int> one_tree(whole.links.size(), 0);
  const std::uint8_t stays = 0;
  return Filter(whole, one_tree, {&stays, 1}, true).part();
}

}  // namespace tangere
