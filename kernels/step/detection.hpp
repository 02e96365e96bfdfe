// SPDX-License-Identifier: Apache-2.0
// Finds which points of a body may touch a shape. First one bounding sphere of all points is tested
// across environments, then those of tiles, then points, eight at a time. For shapes whose distance
// costs much, spheres of eight points are tested before their points.
#pragma once

#include "kernels/contact/distance.hpp"
#include "kernels/contact/elastic_contact.hpp"
#include "kernels/numbers/one_lane.hpp"
#include "kernels/numbers/transpose.hpp"
#include "kernels/step/arguments.hpp"
#include "kernels/step/faces.hpp"
#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// Returns which of eight places in body 1 are nearer than m to a shape posed there.
template <class Shape, class N>
unsigned near_shape(const Shape& shape, const Frame<N>& pose, const Vec3<N>& place, const N& m) {
  const Vec3<N> arm = place - pose.p;
  if constexpr (Shape::kBending == Bending::ball) {
    return lane_bits(nearer_than(shape, arm, m));
  } else {
    return lane_bits(nearer_than(shape, transposed_times(pose.R, arm), m));
  }
}

/// Returns which groups of eight points of two neighbouring tiles may be nearer than m to a shape
/// posed there, of tiles 0 and 1 in `tiles`: bits 0 … 3 are those of the first. All, where `bounds`
/// is null.
template <class Shape, class A>
unsigned near_eights(const Shape& shape, const Frame<Lanes<A>>& pose, const double* bounds,
                     unsigned tiles, const Lanes<A>& m) {
  const unsigned wanted = (tiles & 1U) * 0x0fU + (tiles >> 1U) * 0xf0U;
  if constexpr (Shape::kBending == Bending::general &&
                requires { roughly_nearer_than(shape, pose.p, m); }) {
    if (bounds == nullptr) return wanted;
    const Vec3<Lanes<A>> centre = {load_lanes<A>(bounds), load_lanes<A>(bounds + kGroup),
                                   load_lanes<A>(bounds + 2 * kGroup)};
    const Vec3<Lanes<A>> y = transposed_times(pose.R, centre - pose.p);
    const Lanes<A> reach = load_lanes<A>(bounds + 3 * kGroup) + m;
    return wanted & lane_bits(roughly_nearer_than(shape, y, reach));
  }
  return wanted;
}

template <class N>
void store_frame(const Frame<N>& x, N* rows) {
  for (int i = 0; i < 9; ++i) rows[i] = x.R.m[i / 3][i % 3];
  rows[9] = x.p.x, rows[10] = x.p.y, rows[11] = x.p.z;
}

/// Finds the pairs whose points may be near: tests the ball around all points of a body against the
/// shape, unless the balls around all points and all shapes of the links already exclude contact.
template <class N, int L>
void near_pairs(const ModelView& model, const StageArgs<N>& a, NearPairs<L>& out) {
  const auto view = [](Row<L>* p) { return reinterpret_cast<N*>(p); };
  for_each_link_pair(model, a, [&](int g) {
    const LinkPair& links = model.link_pairs[g];
    const bool was_apart = is_apart(a, g);
    const double margin = a.candidates[model.pair_order[links.first]].margin;
    a.apart[g] = lane_bits(balls_overlap(links, g, a, margin) > N(0.0)) == 0 ? 1 : 0;
    if (a.apart[g] != 0) return;
    if (was_apart) pair_motion(links, a, a.contacts[g]);
    const Frame<N>& x = a.contacts[g].link2_in_1;
    const CandidateList<N>& list = a.candidates[model.pair_order[links.first]];
    out.outrun[g] = was_apart ? ~0U : lane_bits(list_excess(links, list, x) > N(0.0));
    store_frame(x, view(out.link_poses + 12 * g));
    for (int i = 0; i < links.count; ++i) {
      const int k = model.pair_order[links.first + i];
      const PairContact& pair = model.pairs[k];
      const Vec3<N> in_2 = transposed_times(x.R, broadcast<N>(pair.middle) - x.p);
      const Vec3<N> y =
          transposed_times(broadcast<N>(pair.frame2.R), in_2 - broadcast<N>(pair.frame2.p));
      const N reach(pair.extent + margin);
      const Vec3<N> size = load_vector<N>(pair.size, pair.size_row, a.block, a.group);
      out.lanes[k] = with_touched<N>(pair, size, faces_of(a, pair, k), [&](const auto& shape) {
        return lane_bits(nearer_than(shape, y, reach));
      });
      if (out.lanes[k] != 0)
        store_frame(compose(x, broadcast<N>(pair.frame2)), view(out.shape_poses + 12 * k));
    }
  });
}

#if defined(__AVX2__)
/// Numbers of the bits that are set in four, as pairs of 32-bit halves of 64-bit numbers.
struct FourBits {
  alignas(32) int halves[16][8] = {};
  alignas(16) int numbers[16][4] = {};
  constexpr FourBits() {
    for (int bits = 0; bits < 16; ++bits)
      for (int k = 0, at = 0; k < 4; ++k)
        if ((bits >> k & 1) != 0) {
          numbers[bits][at] = k;
          halves[bits][2 * at] = 2 * k, halves[bits][2 * at + 1] = 2 * k + 1;
          ++at;
        }
  }
};
inline constexpr FourBits kFourBits;
#endif

/// Appends the lanes in `which`. It may write up to eight numbers, however many are appended.
template <class A>
void append(const Lanes<A>& a, unsigned which, double* out) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    _mm512_storeu_pd(out, _mm512_maskz_compress_pd(static_cast<__mmask8>(which), a.r[0]));
    return;
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) {
    for (int i = 0; i < 2; ++i) {
      const unsigned bits = which >> (4 * i) & 0xfU;
      const __m256i from =
          _mm256_load_si256(reinterpret_cast<const __m256i*>(kFourBits.halves[bits]));
      const __m256d of = a.r[i];
      _mm256_storeu_pd(
          out, _mm256_castsi256_pd(_mm256_permutevar8x32_epi32(_mm256_castpd_si256(of), from)));
      out += __builtin_popcount(bits);
    }
    return;
  }
#endif
  alignas(64) double lanes[kGroup];
  store_lanes(a, lanes);
  for (; which != 0; which &= which - 1) *out++ = lanes[__builtin_ctz(which)];
}

/// Appends the numbers first + l of the lanes l in `which`. It may write up to eight.
template <class A>
void append_numbers(int first, unsigned which, int* out) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    const __m512i all =
        _mm512_add_epi32(_mm512_set1_epi32(first),
                         _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 0, 0, 0, 0, 0, 0, 0, 0));
    const __m512i kept = _mm512_maskz_compress_epi32(static_cast<__mmask16>(which), all);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm512_castsi512_si256(kept));
    return;
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) {
    for (int i = 0; i < 2; ++i) {
      const unsigned bits = which >> (4 * i) & 0xfU;
      const __m128i numbers =
          _mm_load_si128(reinterpret_cast<const __m128i*>(kFourBits.numbers[bits]));
      _mm_storeu_si128(reinterpret_cast<__m128i*>(out),
                       _mm_add_epi32(numbers, _mm_set1_epi32(first + 4 * i)));
      out += __builtin_popcount(bits);
    }
    return;
  }
#endif
  for (; which != 0; which &= which - 1) *out++ = first + __builtin_ctz(which);
}

/// Shape and pose are local copies. Otherwise the compiler would have to assume that storing to
/// `points` can change them.
template <class A, class Shape>
int search_shape(const CandidateSearch& s, Shape shape) {
  using N = Lanes<A>;
  Frame<N> pose;
  for (int i = 0; i < 9; ++i) pose.R.m[i / 3][i % 3] = N(s.pose[i]);
  pose.p = {N(s.pose[9]), N(s.pose[10]), N(s.pose[11])};
  const PairContact& pair = *s.pair;
  const N margin(s.margin);
  double *x = s.points, *y = x + s.stride, *z = y + s.stride;
  constexpr int kEights = kContactTile / kGroup;  // of a tile
  int count = 0;
  for (int group = 0; group * kGroup < pair.n_tiles; ++group) {
    const double* b = pair.tile_bounds + 4 * kGroup * group;
    const Vec3<N> centre = {load_lanes<A>(b), load_lanes<A>(b + kGroup),
                            load_lanes<A>(b + 2 * kGroup)};
    const N reach = load_lanes<A>(b + 3 * kGroup) + margin;
    const unsigned near_tiles = near_shape(shape, pose, centre, reach);
    for (int two = 0; near_tiles >> two != 0; two += 2) {
      const unsigned tiles = near_tiles >> two & 3U;
      if (tiles == 0) continue;
      const int first = group * kGroup + two;
      if (first >= pair.n_tiles) break;  // padding, near where the pose is not finite
      const double* const eights =
          pair.eight_bounds == nullptr ? nullptr : pair.eight_bounds + 2 * kGroup * first;
      for (unsigned near = near_eights(shape, pose, eights, tiles, margin); near != 0;
           near &= near - 1) {
        const int eight = __builtin_ctz(near), tile = first + eight / kEights,
                  k = eight % kEights * kGroup;
        if (tile * kContactTile + k >= pair.n_points) break;
        const double* p = pair.tile_points + 3 * kContactTile * tile;
        const Vec3<N> place = {load_lanes<A>(p + k), load_lanes<A>(p + kContactTile + k),
                               load_lanes<A>(p + 2 * kContactTile + k)};
        const unsigned in = near_shape(shape, pose, place, margin);
        if (in == 0) continue;
        if (count + kGroup > s.stride) {  // no room: the points are only counted
          count += __builtin_popcount(in);
          continue;
        }
        append(place.x, in, x + count);
        append(place.y, in, y + count);
        append(place.z, in, z + count);
        if (s.weights != nullptr)
          append(load_lanes<A>(pair.tile_weights + tile * kContactTile + k), in, s.weights + count);
        if (s.index != nullptr) append_numbers<A>(tile * kContactTile + k, in, s.index + count);
        count += __builtin_popcount(in);
      }
    }
  }
  for (int k = count; k % kGroup != 0 && k < s.stride; ++k) {
    x[k] = y[k] = z[k] = kFarAway;
    if (s.weights != nullptr) s.weights[k] = 0;
  }
  return count;
}

template <class A>
int search_candidates(const CandidateSearch& s) {
  using N = Lanes<A>;
  return with_touched<N>(
      *s.pair, broadcast<N>(s.size), broadcast<N>(s.faces),
      [&]<class Shape>(const Shape& shape) { return search_shape<A, Shape>(s, shape); });
}

/// Makes rows of the own numbers of all lanes, of which each point has `Numbers`, eight points at a
/// time. Rows after those of the points are filled, up to a multiple of eight.
template <class A, int Numbers>
void transpose_all(const GroupStage::List& list, const double* own, double filler,
                   Row<kGroup>* rows) {
  for (int k = 0; k < list.count; k += kGroup)
    for (int c = 0; c < Numbers; ++c) {
      Lanes<A> x[kGroup];
      for (int l = 0; l < kGroup; ++l)
        x[l] = k < list.own_count[l] ? load_lanes<A>(own + (l * Numbers + c) * list.stride + k)
                                     : Lanes<A>(filler);
      transpose(x);
      for (int i = 0; i < kGroup; ++i) store_lanes(x[i], rows[Numbers * (k + i) + c].lane);
    }
}

/// The same of `lanes`; the rows of other lanes stay. They are filled up to `list.count` from
/// `before` on, where they ended.
template <class A, int Numbers>
void transpose_numbers(const GroupStage::List& list, unsigned lanes, int before, const double* own,
                       double filler, Row<kGroup>* rows) {
  if (rows == nullptr) return;
  if (lanes == (1U << kGroup) - 1) return transpose_all<A, Numbers>(list, own, filler, rows);
  for (int l = 0; l < kGroup; ++l) {
    const bool made = (lanes >> l & 1U) != 0;
    const int end = list.own_count[l], rest = made || end > before ? end : before;
    for (int c = 0; c < Numbers; ++c) {
      const double* const column = own + (l * Numbers + c) * list.stride;
      for (int k = 0; k < end && made; ++k) rows[Numbers * k + c][l] = column[k];
      for (int k = rest; k < list.count; ++k) rows[Numbers * k + c][l] = filler;
    }
  }
}

/// Makes rows of eight lanes from the own lists of `lanes`, all but their anchors. Shorter lists
/// end in far points.
template <class A>
void transpose_rows(GroupStage::List& list, unsigned lanes) {
  const int before = list.count;
  list.count = 0;
  for (const int count : list.own_count) list.count = count > list.count ? count : list.count;
  transpose_numbers<A, 3>(list, lanes, before, list.own, kFarAway, list.points);
  transpose_numbers<A, 1>(list, lanes, before, list.own_weights, 0, list.weights);
}

/// Makes rows of eight lanes from the own anchors of all lanes.
template <class A>
void transpose_anchors(const GroupStage::List& list) {
  transpose_all<A, kAnchorNumbers>(list, list.own_anchors, 0, list.anchors);
}

}  // namespace tangere::kernels
