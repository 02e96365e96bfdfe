// SPDX-License-Identifier: Apache-2.0
// Values are those of a plain contact; changes follow along the tangents.
#include "engine/derivative/dual_layer_contacts.hpp"

#include "kernels/step/arguments.hpp"

namespace tangere {

using kernels::kGroup;
using kernels::Vec3;
using D = kernels::Dual<double>;

namespace {

Vec3<D> joined(const Vec3<double>& value, const Vec3<double>& change) {
  return {{value.x, change.x}, {value.y, change.y}, {value.z, change.z}};
}

/// Copies numbers without their tangents.
template <class Values, class Duals>
Values values_of(const Duals& from) {
  static_assert(sizeof(Duals) == 2 * sizeof(Values));
  Values to;
  const auto* const x = reinterpret_cast<const D*>(&from);
  auto* const out = reinterpret_cast<double*>(&to);
  for (std::size_t i = 0; i < sizeof to / sizeof(double); ++i) out[i] = x[i].value;
  return to;
}

kernels::Anchor<D> anchor_at(const std::vector<D>& all, std::size_t k) {
  return kernels::load_anchor<D>([&](int i) {
    return all.empty() ? D(0.0) : all[kernels::kAnchorNumbers * k + std::size_t(i)];
  });
}

}  // namespace

DualLayerContacts::DualLayerContacts(const CompiledModel& model)
    : pads_(model.layer_pads),
      sums_(std::size_t(model.layer_link_pairs)),
      materials_(model.layer_pads.size()) {}

/// Copies the values of a pair's candidates.
LayerCandidates DualLayerContacts::values_in_rows(const DualCandidates& candidates,
                                                  std::size_t pair) {
  const std::vector<int>& numbers = candidates.numbers[pair];
  const std::size_t count = numbers.size(), stride = (count + kGroup - 1) / kGroup * kGroup;
  rows_.assign((3 + kernels::kAnchorNumbers) * stride, 0.0);
  const auto copy = [&](const std::vector<D>& from, std::size_t each, double* to) {
    for (std::size_t k = 0; !from.empty() && k < each * count; ++k)
      to[k % each * stride + k / each] = from[k].value;
  };
  copy(candidates.places[pair], 3, rows_.data());
  copy(candidates.anchors[pair], kernels::kAnchorNumbers, rows_.data() + 3 * stride);
  return {rows_.data(), rows_.data() + 3 * stride, numbers.data(), static_cast<int>(stride),
          static_cast<int>(count)};
}

void DualLayerContacts::add_bodies(const kernels::ModelView& view, const kernels::LinkPair& links,
                                   const kernels::ContactScratch<D>& motion, int pad,
                                   const DualCandidates& candidates, const double* block) {
  const LayerPad& of = pads_[std::size_t(pad)];
  for (int member = links.first; member < links.first + links.count; ++member) {
    const auto at = std::size_t(view.pair_order[member]);
    const kernels::PairContact& pair = view.pairs[at];
    if (pair.layer_pad != pad) continue;
    members_.push_back(static_cast<int>(at));
    bodies_.push_back(
        layer_body<D>(of, pair.frame2, motion.link2_in_1, motion.W,
                      kernels::load_law<D>(pair.parameters, pair.law, pair.ramp, block, 0),
                      kernels::load_vector<D>(pair.size, pair.size_row, block, 0)));
    contact_.add_body({pair.shape, pair.grid, pair.law, pair.ramp, pair.memory >= 0, false},
                      values_of<kernels::LayerBody<double>>(bodies_.back()),
                      values_in_rows(candidates, at));
  }
}

void DualLayerContacts::compute(const kernels::ModelView& view,
                                std::span<const kernels::ContactScratch<D>> contacts,
                                const DualCandidates& candidates, const double* block,
                                bool frozen) {
  std::fill(sums_.begin(), sums_.end(), kernels::PairSums<D>::zero());
  for (std::size_t g = 0; g < std::size_t(view.n_link_pairs); ++g) {
    const kernels::LinkPair& links = view.link_pairs[g];
    for (int pad = 0; links.layer >= 0 && pad < static_cast<int>(pads_.size()); ++pad) {
      members_.clear(), bodies_.clear();
      contact_.begin(kernels::active_kernels(), pads_[std::size_t(pad)]);
      add_bodies(view, links, contacts[g], pad, candidates, block);
      if (contact_.empty()) continue;
      contact_.solve();
      std::vector<kernels::Anchor<D>> anchors;
      contact_.for_each_point([&](const LayerContact::Point& p) {
        const auto pair = std::size_t(members_[std::size_t(p.body)]);
        anchors.push_back(contact_.in_pad(
            anchor_at(candidates.anchors[pair], static_cast<std::size_t>(p.candidate))));
      });
      const kernels::Vec6<double> value = contact_.wrench(),
                                  change = contact_.change(
                                      bodies_, anchors,
                                      frozen ? LayerMaterial{} : materials_[std::size_t(pad)]);
      sums_[std::size_t(links.layer)].wrench +=
          {joined(value.a, change.a), joined(value.l, change.l)};
    }
  }
}

}  // namespace tangere
