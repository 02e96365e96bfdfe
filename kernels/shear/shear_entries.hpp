// SPDX-License-Identifier: Apache-2.0
// Reads and writes entries of a shear state as vectors of eight points.
#pragma once

#include <cstddef>

#include "kernels/numbers/linalg.hpp"
#include "kernels/numbers/transpose.hpp"
#include "kernels/shear/shear_types.hpp"

namespace tangere::kernels {

template <class A>
Vec3<Lanes<A>> load3(const double* rows, int stride, int k) {
  return {load_lanes<A>(rows + k), load_lanes<A>(rows + stride + k),
          load_lanes<A>(rows + 2 * stride + k)};
}
template <class A>
void store3(const Vec3<Lanes<A>>& x, double* rows, int stride, int k) {
  store_lanes(x.x, rows + k), store_lanes(x.y, rows + stride + k);
  store_lanes(x.z, rows + 2 * stride + k);
}

/// Points of one contact: number of the first one among all points, and rising numbers in the
/// contact.
struct PointNumbers {
  int first;
  const int* index;
};

// An entry is a vector (point, x, y, z) of 64-bit numbers. Only the lower half of the first counts.
static_assert(sizeof(ShearEntry) == 32 && offsetof(ShearEntry, s) == 8);

#if defined(__AVX512F__)

/// Returns the numbers of eight points.
inline __m256i point_numbers(const PointNumbers& at) {
  return _mm256_add_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(at.index)),
                          _mm256_set1_epi32(at.first));
}

/// Reads eight adjacent entries. Returns false if they are of other points.
inline bool read_adjacent(const PointNumbers& points, const ShearEntry* at,
                          Vec3<Lanes<xsimd::avx512bw>>& s) {
  const auto* const from = reinterpret_cast<const double*>(at);
  const __m512i px = _mm512_setr_epi64(0, 4, 8, 12, 1, 5, 9, 13),
                yz = _mm512_setr_epi64(2, 6, 10, 14, 3, 7, 11, 15);
  __m512d px_of[2], yz_of[2];
  for (int i = 0; i < 2; ++i) {
    const __m512d two = _mm512_loadu_pd(from + 16 * i), next = _mm512_loadu_pd(from + 16 * i + 8);
    px_of[i] = _mm512_permutex2var_pd(two, px, next);
    yz_of[i] = _mm512_permutex2var_pd(two, yz, next);
  }
  const __m512d p = _mm512_shuffle_f64x2(px_of[0], px_of[1], 0x44);
  const __m256i numbers = _mm512_cvtepi64_epi32(_mm512_castpd_si512(p));
  const __m256i differ = _mm256_xor_si256(numbers, point_numbers(points));
  if (_mm256_testz_si256(differ, differ) == 0) return false;
  s.x.r[0] = _mm512_shuffle_f64x2(px_of[0], px_of[1], 0xee);
  s.y.r[0] = _mm512_shuffle_f64x2(yz_of[0], yz_of[1], 0x44);
  s.z.r[0] = _mm512_shuffle_f64x2(yz_of[0], yz_of[1], 0xee);
  return true;
}

/// Writes the entries of the points in `which`, and numbers without meaning behind them: eight
/// entries in all.
inline void write_eight(const PointNumbers& points, const Vec3<Lanes<xsimd::avx512bw>>& s,
                        unsigned which, ShearEntry* to) {
  __m512d of[4] = {_mm512_castsi512_pd(_mm512_cvtepi32_epi64(point_numbers(points))), s.x.r[0],
                   s.y.r[0], s.z.r[0]};
  if (which != 0xff)
    for (__m512d& x : of) x = _mm512_maskz_compress_pd(static_cast<__mmask8>(which), x);
  const __m512i low = _mm512_setr_epi64(0, 8, 1, 9, 2, 10, 3, 11),
                high = _mm512_setr_epi64(4, 12, 5, 13, 6, 14, 7, 15),
                first = _mm512_setr_epi64(0, 1, 8, 9, 2, 3, 10, 11),
                second = _mm512_setr_epi64(4, 5, 12, 13, 6, 7, 14, 15);
  auto* out = reinterpret_cast<double*>(to);
  for (const __m512i& half : {low, high}) {
    const __m512d px = _mm512_permutex2var_pd(of[0], half, of[1]),
                  yz = _mm512_permutex2var_pd(of[2], half, of[3]);
    _mm512_storeu_pd(out, _mm512_permutex2var_pd(px, first, yz));
    _mm512_storeu_pd(out + 8, _mm512_permutex2var_pd(px, second, yz));
    out += 16;
  }
}
#endif

#if defined(__AVX2__)
// Four entries at a time. Always inlined, because sources of several instruction sets contain it.

/// Returns the numbers of points `first` to `first` + 3 of eight.
[[gnu::always_inline]] inline __m128i four_numbers(const PointNumbers& at, int first) {
  return _mm_add_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(at.index + first)),
                       _mm_set1_epi32(at.first));
}

/// Reads the entries of the first `count` of eight points, which are adjacent, and zeros of the
/// others. Eight entries are read. Returns false if those are of other points.
[[gnu::always_inline]] inline bool read_adjacent(const PointNumbers& points, int count,
                                                 const ShearEntry* at,
                                                 Vec3<Lanes<xsimd::avx2>>& s) {
  const auto* const from = reinterpret_cast<const double*>(at);
  const __m256i low_halves = _mm256_setr_epi32(0, 2, 4, 6, 0, 2, 4, 6);
  for (int i = 0; i < 2; ++i) {
    __m256d x[4];
    for (int k = 0; k < 4; ++k) x[k] = _mm256_loadu_pd(from + 4 * (4 * i + k));
    transpose_four(x);
    const __m128i counted =
        _mm_cmpgt_epi32(_mm_set1_epi32(count - 4 * i), _mm_setr_epi32(0, 1, 2, 3));
    const __m128i numbers =
        _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(_mm256_castpd_si256(x[0]), low_halves));
    if (_mm_testz_si128(counted, _mm_xor_si128(numbers, four_numbers(points, 4 * i))) == 0)
      return false;
    const __m256d kept = _mm256_castsi256_pd(_mm256_cvtepi32_epi64(counted));
    s.x.r[i] = _mm256_and_pd(kept, x[1]);
    s.y.r[i] = _mm256_and_pd(kept, x[2]);
    s.z.r[i] = _mm256_and_pd(kept, x[3]);
  }
  return true;
}

/// Writes the entries of the points in `which`, and up to eight entries in all. Returns the place
/// behind those of the points.
[[gnu::always_inline]] inline ShearEntry* write_eight(const PointNumbers& points,
                                                      const Vec3<Lanes<xsimd::avx2>>& s,
                                                      unsigned which, ShearEntry* to) {
  for (int i = 0; i < 2; ++i) {
    __m256d x[4] = {_mm256_castsi256_pd(_mm256_cvtepi32_epi64(four_numbers(points, 4 * i))),
                    s.x.r[i], s.y.r[i], s.z.r[i]};
    transpose_four(x);
    for (int k = 0; k < 4; ++k) {
      _mm256_storeu_pd(reinterpret_cast<double*>(to), x[k]);
      to += which >> (4 * i + k) & 1U;
    }
  }
  return to;
}
#endif

/// Returns the elastic displacements of up to eight points, zeros where a point has no entry. Calls
/// go through the points of a contact in order, and so through the entries.
template <class A>
[[gnu::always_inline]] inline Vec3<Lanes<A>> read_entries(const PointNumbers& points, int count,
                                                          ShearEntries& entries) {
  const ShearEntry *at = entries.at, *const end = entries.end;
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    Vec3<Lanes<A>> s;
    if (count >= kGroup && end - at >= kGroup && read_adjacent(points, at, s)) {
      entries.at = at + kGroup;
      return s;
    }
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) {
    Vec3<Lanes<A>> s;
    if (end - at >= kGroup && read_adjacent(points, count, at, s)) {
      entries.at = at + (count < kGroup ? count : kGroup);
      return s;
    }
  }
#endif
  alignas(64) double s[3 * kGroup] = {};
  for (int i = 0; i < kGroup && i < count; ++i) {
    const int point = points.first + points.index[i];
    while (at != end && at->point < point) ++at;
    if (at == end || at->point != point) continue;
    s[i] = at->s[0], s[kGroup + i] = at->s[1], s[2 * kGroup + i] = at->s[2];
    ++at;
  }
  entries.at = at;
  return load3<A>(s, kGroup, 0);
}

/// Appends the entries of the points in `which` of eight. It may write up to eight, however many
/// are appended.
template <class A>
[[gnu::always_inline]] inline ShearEntry* write_entries(const PointNumbers& points,
                                                        const Vec3<Lanes<A>>& s, unsigned which,
                                                        ShearEntry* to) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    write_eight(points, s, which, to);
    return to + __builtin_popcount(which);
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) return write_eight(points, s, which, to);
#endif
  alignas(64) double x[3 * kGroup];
  store3(s, x, kGroup, 0);
  for (; which != 0; which &= which - 1) {
    const int l = __builtin_ctz(which);
    *to++ = {points.first + points.index[l], {x[l], x[kGroup + l], x[2 * kGroup + l]}};
  }
  return to;
}

}  // namespace tangere::kernels
