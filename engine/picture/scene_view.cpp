// SPDX-License-Identifier: Apache-2.0
// A ray is described from the point at the solid's depth, so that numbers in the solid's axes are
// about as large as the solid: p(s) = o + s d with depth = middle + s. Then
//
//   ball, ellipsoid, by semi-axes: A s² + 2 B s + C = 0, A = d·d, B = o·d, C = o·o - 1,
//                                  s = (-B - √(B² - AC))/A
//   cuboid: slabs, entered at -o_k/d_k - |a_k/d_k|, left at -o_k/d_k + |a_k/d_k|
//   cylinder: the infinite one and a slab. Capsule: the infinite cylinder within the straight part,
//   else the ball of that end. Half-space: s = -o_z/d_z
//
// A highlight is (n·h)^e with h along light - d, both unit: n·h = (n·light - n·d)/√(2 - 2 light·d).
#include "engine/picture/scene_view.hpp"

#include <algorithm>
#include <cmath>

#include "engine/picture/clones.hpp"

namespace tangere {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;
constexpr float kBrightest = 255;
constexpr std::array<float, 3> kSky{200, 216, 235};
constexpr float kSmallest = 1e-20F;  // in place of a direction's number that is zero
constexpr float kNowhere = 1e30F;    // depth of a ray that meets nothing [m]
constexpr std::size_t kBits = 8;     // of exponents
constexpr float kDarker = 0.2F;      // of the tone of every other square

/// Rays of a row of pixels in the axes of a solid.
struct RayRow {
  const float* u;
  float* depth;
  std::int32_t* numbers;
  std::uint32_t* colours;
  int first, end;      // columns
  float middle, side;  // o_k = o_k + x_k (u middle - side), d_k = d_k + x_k u
  std::array<float, 3> o, d, x;
  std::array<float, 3> size, light, colour;
  float ambient, direct;
  float square, pixel;  // sides of squares [m], and of a pixel at depth 1 m
  float far;
  std::int32_t number;
  // Of solids with a highlight.
  std::array<float, 3> unit;               // lengths along axes of the solid by those of o and d
  float specular;                          // 0: none
  std::array<float, kBits> exponent_bits;  // each 0 or 1, the lowest first
};

struct Ray {
  float ox, oy, oz, dx, dy, dz;
};
/// Where a ray enters a solid, kNowhere if it does not, the cosine between the normal and the
/// light, and the normal in the solid's axes, unit.
struct Hit {
  float s, cosine, x, y, z;
};

[[gnu::always_inline]] inline float root(float x) { return std::sqrt(x > 0 ? x : 0.0F); }
[[gnu::always_inline]] inline float nonzero(float x) {
  return x > -kSmallest && x < kSmallest ? kSmallest : x;
}

[[gnu::always_inline]] inline Hit ball_hit(const Ray& r, const RayRow& row) {
  const float a = r.dx * r.dx + (r.dy * r.dy + r.dz * r.dz),
              b = r.ox * r.dx + (r.oy * r.dy + r.oz * r.dz),
              c = r.ox * r.ox + (r.oy * r.oy + r.oz * r.oz) - 1.0F, under = b * b - a * c,
              s = (-b - root(under)) / a;
  const float x = r.ox + s * r.dx, y = r.oy + s * r.dy, z = r.oz + s * r.dz;
  return {under > 0 ? s : kNowhere, row.light[0] * x + (row.light[1] * y + row.light[2] * z), x, y,
          z};
}

[[gnu::always_inline]] inline Hit ellipsoid_hit(const Ray& r, const RayRow& row) {
  const float a = r.dx * r.dx + (r.dy * r.dy + r.dz * r.dz),
              b = r.ox * r.dx + (r.oy * r.dy + r.oz * r.dz),
              c = r.ox * r.ox + (r.oy * r.oy + r.oz * r.oz) - 1.0F, under = b * b - a * c,
              s = (-b - root(under)) / a;
  const float x = (r.ox + s * r.dx) * row.size[0], y = (r.oy + s * r.dy) * row.size[1],
              z = (r.oz + s * r.dz) * row.size[2];  // size: inverse semi-axes
  const float length = std::sqrt(x * x + (y * y + z * z));
  return {under > 0 ? s : kNowhere,
          (row.light[0] * x + (row.light[1] * y + row.light[2] * z)) / length, x / length,
          y / length, z / length};
}

[[gnu::always_inline]] inline Hit cuboid_hit(const Ray& r, const RayRow& row) {
  const float ix = 1.0F / nonzero(r.dx), iy = 1.0F / nonzero(r.dy), iz = 1.0F / nonzero(r.dz);
  const float mx = -r.ox * ix, my = -r.oy * iy, mz = -r.oz * iz;
  const float wx = std::abs(row.size[0] * ix), wy = std::abs(row.size[1] * iy),
              wz = std::abs(row.size[2] * iz);
  const float nx = mx - wx, ny = my - wy, nz = mz - wz;
  const float fx = mx + wx, fy = my + wy, fz = mz + wz;
  const float xy = nx > ny ? nx : ny, enter = xy > nz ? xy : nz;
  const float least = fx < fy ? fx : fy, leave = least < fz ? least : fz;
  const float along_x = r.dx > 0 ? -row.light[0] : row.light[0],
              along_y = r.dy > 0 ? -row.light[1] : row.light[1],
              along_z = r.dz > 0 ? -row.light[2] : row.light[2];
  const float across = nx > ny ? along_x : along_y;
  const bool side = xy > nz, first = nx > ny;
  return {enter < leave ? enter : kNowhere, side ? across : along_z,
          side & first ? (r.dx > 0 ? -1.0F : 1.0F) : 0.0F,
          side & !first ? (r.dy > 0 ? -1.0F : 1.0F) : 0.0F,
          side ? 0.0F : (r.dz > 0 ? -1.0F : 1.0F)};
}

[[gnu::always_inline]] inline Hit cylinder_hit(const Ray& r, const RayRow& row) {
  const float radius = row.size[0], half = row.size[1];
  const float square = r.dx * r.dx + r.dy * r.dy, a = square > kSmallest ? square : kSmallest,
              b = r.ox * r.dx + r.oy * r.dy, c = r.ox * r.ox + r.oy * r.oy - radius * radius,
              under = b * b - a * c, width = root(under) / a, into = -b / a - width,
              out = -b / a + width;
  const float iz = 1.0F / nonzero(r.dz), mz = -r.oz * iz, wz = std::abs(half * iz);
  const float enter = into > mz - wz ? into : mz - wz, leave = out < mz + wz ? out : mz + wz;
  const float x = r.ox + enter * r.dx, y = r.oy + enter * r.dy;
  const float round = (row.light[0] * x + row.light[1] * y) / radius,
              flat = r.dz > 0 ? -row.light[2] : row.light[2];
  const bool side = into > mz - wz;
  return {(under > 0) & (enter < leave) ? enter : kNowhere, side ? round : flat,
          side ? x / radius : 0.0F, side ? y / radius : 0.0F,
          side ? 0.0F : (r.dz > 0 ? -1.0F : 1.0F)};
}

[[gnu::always_inline]] inline Hit capsule_hit(const Ray& r, const RayRow& row) {
  const float radius = row.size[0], half = row.size[1];
  const float square = r.dx * r.dx + r.dy * r.dy, a = square > kSmallest ? square : kSmallest,
              b = r.ox * r.dx + r.oy * r.dy, flat = r.ox * r.ox + r.oy * r.oy - radius * radius,
              under = b * b - a * flat, side = (-b - root(under)) / a, height = r.oz + side * r.dz;
  const float low = height > -half ? height : -half, end = low < half ? low : half;
  const float from = r.oz - (height > 0 ? half : -half);
  const float whole = square + r.dz * r.dz, along = b + from * r.dz,
              rest = along * along - whole * (flat + from * from);
  const float cap = (-along - root(rest)) / whole, beyond = std::abs(height - end);
  const float s = beyond > 0 ? cap : side, met = beyond > 0 ? rest : 1.0F;
  const float x = r.ox + s * r.dx, y = r.oy + s * r.dy, z = r.oz + s * r.dz - end;
  const float least = under < met ? under : met;
  return {least > 0 ? s : kNowhere,
          (row.light[0] * x + (row.light[1] * y + row.light[2] * z)) / radius, x / radius,
          y / radius, z / radius};
}

/// Returns the tone of squares, which fades to its mean where squares are small in the picture.
[[gnu::always_inline]] inline float tone_of_square(float x, float y, float footprint,
                                                   float darker) {
  const auto down = [](float a) {
    const float whole = static_cast<float>(static_cast<std::int32_t>(a));
    return static_cast<std::int32_t>(a) - (whole > a ? 1 : 0);
  };
  const float limit = 1e9F;
  const auto bounded = [limit](float a) { return a > -limit ? (a < limit ? a : limit) : -limit; };
  const float odd = static_cast<float>((down(bounded(x)) + down(bounded(y))) & 1);
  const float fade = 2.0F - 2.0F * footprint, contrast = fade > 0 ? (fade < 1 ? fade : 1.0F) : 0.0F;
  return 1.0F - darker * (0.5F + (odd - 0.5F) * contrast);
}

/// x to the power of 1 to 255, of x from 0 to 1, by the exponent's bits. Factors of bits that are
/// not set are 1 by arithmetic, because compilers make no vectors of branches. What is too small to
/// be seen is zero, because numbers without a leading one are slow.
[[gnu::always_inline]] inline float power(float x, const std::array<float, kBits>& bits) {
  constexpr float kUnseen = 1e-18F;
  float product = 1;
  for (const float bit : bits) {
    const float with = product * (bit * x + (1.0F - bit));
    product = with > kUnseen ? with : 0.0F;
    x = x * x > kUnseen ? x * x : 0.0F;
  }
  return product;
}

/// The strength of the highlight at a surface that the light reaches, 0 to 1. Of a ray with
/// directions dx, dy, dz in the solid's axes, of any length.
[[gnu::always_inline]] inline float highlight(const Hit& hit, float dx, float dy, float dz,
                                              const RayRow& row) {
  const float length = std::sqrt(dx * dx + (dy * dy + dz * dz));
  const float across = (hit.x * dx + (hit.y * dy + hit.z * dz)) / length,
              ahead = (row.light[0] * dx + (row.light[1] * dy + row.light[2] * dz)) / length;
  const float square = 2.0F - 2.0F * ahead,
              half = (hit.cosine - across) / std::sqrt(square > kSmallest ? square : kSmallest);
  return power(half > 0 ? (half < 1 ? half : 1.0F) : 0.0F, row.exponent_bits);
}

/// The colour's numbers times a tone, and white, rounded; at most white.
[[gnu::always_inline]] inline std::uint32_t packed(const std::array<float, 3>& colour, float tone,
                                                   float white) {
  const auto byte = [tone, white](float level) {
    const float lit = level * tone + white;
    return static_cast<std::uint32_t>(
        static_cast<std::int32_t>((lit < kBrightest ? lit : kBrightest) + 0.5F));
  };
  return byte(colour[0]) | (byte(colour[1]) << 8) | (byte(colour[2]) << 16);
}

/// Puts what is nearer into a pixel. With masks, for which compilers have vectors.
[[gnu::always_inline]] inline void put(float t, std::int32_t number, std::uint32_t colour,
                                       float& depth, std::int32_t& numbers,
                                       std::uint32_t& colours) {
  const float before = depth;
  const std::int32_t nearer = -static_cast<std::int32_t>(t < before);
  depth = t < before ? t : before;
  numbers = (number & nearer) | (numbers & ~nearer);
  const auto mask = static_cast<std::uint32_t>(nearer);
  colours = (colour & mask) | (colours & ~mask);
}

template <Hit (*Law)(const Ray&, const RayRow&), bool kMatte>
[[gnu::always_inline]] inline void cast_row(const RayRow& given) {
  const RayRow row = given;
  const float* const u = row.u;
  float* const depth = row.depth;
  std::int32_t* const numbers = row.numbers;
  std::uint32_t* const colours = row.colours;
#pragma GCC ivdep
  for (int j = row.first; j < row.end; ++j) {
    const float e = u[j] * row.middle - row.side;
    const Ray ray{row.o[0] + row.x[0] * e,    row.o[1] + row.x[1] * e,
                  row.o[2] + row.x[2] * e,    row.d[0] + row.x[0] * u[j],
                  row.d[1] + row.x[1] * u[j], row.d[2] + row.x[2] * u[j]};
    const Hit hit = Law(ray, row);
    const float t = row.middle + hit.s;
    const float lit = hit.cosine > 0 ? (hit.cosine < 1 ? hit.cosine : 1.0F) : 0.0F;
    const float tone = row.ambient + row.direct * lit;
    float white = 0;
    if constexpr (!kMatte)
      white = row.specular *
              highlight(hit, ray.dx * row.unit[0], ray.dy * row.unit[1], ray.dz * row.unit[2], row);
    put(t > static_cast<float>(kNearest) ? t : kNowhere, row.number,
        packed(row.colour, tone, white), depth[j], numbers[j], colours[j]);
  }
}

/// Of a half-space all rays begin at the pinhole: middle = 0.
template <bool kMatte>
[[gnu::always_inline]] inline void cast_half_space_row(const RayRow& given) {
  const RayRow row = given;
  const float* const u = row.u;
  float* const depth = row.depth;
  std::int32_t* const numbers = row.numbers;
  std::uint32_t* const colours = row.colours;
  const float lit = row.light[2] > 0 ? row.light[2] : 0.0F, tone = row.ambient + row.direct * lit,
              per_square = row.square > 0 ? 1.0F / row.square : 0.0F,
              footprint = row.pixel * per_square, darker = row.square > 0 ? kDarker : 0.0F,
              specular = row.light[2] > 0 ? row.specular : 0.0F;
#pragma GCC ivdep
  for (int j = row.first; j < row.end; ++j) {
    const float dz = row.d[2] + row.x[2] * u[j], t = -row.o[2] / dz;
    const bool seen = (dz < 0) & (t > static_cast<float>(kNearest)) & (t < row.far);
    const float near = seen ? t : 0.0F;
    const float x = (row.o[0] + near * (row.d[0] + row.x[0] * u[j])) * per_square,
                y = (row.o[1] + near * (row.d[1] + row.x[1] * u[j])) * per_square;
    const float across = near * footprint / (seen ? -dz : 1.0F);
    const float tone_here = tone * tone_of_square(x, y, across, darker);
    float white = 0;
    if constexpr (!kMatte)
      white = specular * highlight({t, row.light[2], 0, 0, 1}, row.d[0] + row.x[0] * u[j],
                                   row.d[1] + row.x[1] * u[j], dz, row);
    put(seen ? t : kNowhere, row.number, packed(row.colour, tone_here, white), depth[j], numbers[j],
        colours[j]);
  }
}

TANGERE_CLONES void cast_ball(const RayRow& row) { cast_row<ball_hit, true>(row); }
TANGERE_CLONES void cast_ellipsoid(const RayRow& row) { cast_row<ellipsoid_hit, true>(row); }
TANGERE_CLONES void cast_cuboid(const RayRow& row) { cast_row<cuboid_hit, true>(row); }
TANGERE_CLONES void cast_cylinder(const RayRow& row) { cast_row<cylinder_hit, true>(row); }
TANGERE_CLONES void cast_capsule(const RayRow& row) { cast_row<capsule_hit, true>(row); }
TANGERE_CLONES void cast_half_space(const RayRow& row) { cast_half_space_row<true>(row); }
TANGERE_CLONES void cast_shiny_ball(const RayRow& row) { cast_row<ball_hit, false>(row); }
TANGERE_CLONES void cast_shiny_ellipsoid(const RayRow& row) { cast_row<ellipsoid_hit, false>(row); }
TANGERE_CLONES void cast_shiny_cuboid(const RayRow& row) { cast_row<cuboid_hit, false>(row); }
TANGERE_CLONES void cast_shiny_cylinder(const RayRow& row) { cast_row<cylinder_hit, false>(row); }
TANGERE_CLONES void cast_shiny_capsule(const RayRow& row) { cast_row<capsule_hit, false>(row); }
TANGERE_CLONES void cast_shiny_half_space(const RayRow& row) { cast_half_space_row<false>(row); }

/// How rows of a kind of solid are drawn, by whether it has a highlight.
using CastRow = void (*)(const RayRow&);
CastRow cast_of(SolidKind kind, bool shiny) {
  switch (kind) {
    case SolidKind::ball: return shiny ? cast_shiny_ball : cast_ball;
    case SolidKind::ellipsoid: return shiny ? cast_shiny_ellipsoid : cast_ellipsoid;
    case SolidKind::cuboid: return shiny ? cast_shiny_cuboid : cast_cuboid;
    case SolidKind::cylinder: return shiny ? cast_shiny_cylinder : cast_cylinder;
    case SolidKind::capsule: return shiny ? cast_shiny_capsule : cast_capsule;
    case SolidKind::half_space: return shiny ? cast_shiny_half_space : cast_half_space;
  }
  return nullptr;
}

/// Lengths along axis k by those in which the law of a solid counts.
double unit_of(const ViewSolid& solid, std::size_t k) {
  return solid.kind == SolidKind::ball || solid.kind == SolidKind::ellipsoid ? solid.size[k] : 1.0;
}

/// What all rows of a solid share.
RayRow rows_of(const ViewSolid& solid, const Vector3& light, double ambient, double direct,
               double focal, double far) {
  const auto single = [](double x) { return static_cast<float>(x); };
  const bool plane = solid.kind == SolidKind::half_space;
  RayRow row{};
  row.middle = single(plane ? 0 : solid.origin[2]);
  row.side = single(plane ? 0 : solid.origin[0]);
  row.ambient = single(ambient + std::clamp(solid.emission, 0.0, 1.0)), row.direct = single(direct);
  row.specular = kBrightest * single(direct * std::clamp(solid.specular, 0.0, 1.0));
  const int exponent = std::clamp(solid.exponent, 1, kLargestExponent);
  for (std::size_t k = 0; k < kBits; ++k)
    row.exponent_bits[k] = static_cast<float>(exponent >> k & 1);
  row.square = single(solid.square), row.pixel = single(1 / focal);
  row.far = single(far);
  row.number = solid.number;
  for (std::size_t k = 0; k < 3; ++k) {
    row.unit[k] = single(unit_of(solid, k));
    row.x[k] = single(solid.axes[k][0] / unit_of(solid, k));
    row.size[k] = single(solid.kind == SolidKind::ellipsoid ? 1 / solid.size[k] : solid.size[k]);
    row.light[k] = single(dot(light, solid.axes[k]));
    row.colour[k] = kBrightest * single(std::clamp(solid.colour[k], 0.0, 1.0));
  }
  return row;
}

TANGERE_CLONES void unpack(const std::uint32_t* from, std::uint8_t* to, std::size_t count) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < count; ++i) {
    to[3 * i] = static_cast<std::uint8_t>(from[i]);
    to[3 * i + 1] = static_cast<std::uint8_t>(from[i] >> 8);
    to[3 * i + 2] = static_cast<std::uint8_t>(from[i] >> 16);
  }
}

}  // namespace

double ViewGrid::focal() const { return 0.5 * rows / std::tan(0.5 * fov * kDegree); }

void unpack_colours(std::span<const std::uint32_t> colours, std::span<std::uint8_t> bytes) {
  unpack(colours.data(), bytes.data(), colours.size());
}

SceneView::SceneView(const ViewGrid& grid)
    : grid_(grid),
      focal_(grid.focal()),
      depth_(grid.pixels()),
      numbers_(grid.pixels()),
      colours_(grid.pixels()) {
  for (int j = 0; j < grid.cols; ++j)
    u_.push_back(static_cast<float>((j + 0.5 - 0.5 * grid.cols) / focal_));
}

double SceneView::ray_row(int row) const { return (row + 0.5 - 0.5 * grid_.rows) / focal_; }

void SceneView::begin(const Vector3& light, double ambient, double brightness) {
  light_ = light, ambient_ = ambient * brightness, direct_ = (1 - ambient) * brightness;
  std::fill(depth_.begin(), depth_.end(), static_cast<float>(grid_.far));
  std::fill(numbers_.begin(), numbers_.end(), kNoSolid);
  std::fill(colours_.begin(), colours_.end(), packed(kSky, static_cast<float>(brightness), 0));
}

SceneView::Pixels SceneView::pixels_of(std::span<const Vector3> centres, double radius) const {
  constexpr double kMargin = 0.01;  // of a pixel, for rounding
  const Pixels all{0, grid_.rows, 0, grid_.cols};
  double nearest = centres[0][2], farthest = nearest;
  for (const Vector3& c : centres)
    nearest = std::min(nearest, c[2]), farthest = std::max(farthest, c[2]);
  if (!(farthest + radius > kNearest) || nearest - radius > grid_.far) return {};
  if (nearest - radius <= kNearest) return all;
  std::array<double, 2> low{1e9, 1e9}, high{-1e9, -1e9};  // along x and y
  for (const Vector3& c : centres)
    for (std::size_t k = 0; k < 2; ++k) {
      const double z = c[2], width = radius * std::sqrt(c[k] * c[k] + z * z - radius * radius),
                   square = z * z - radius * radius;
      low[k] = std::min(low[k], (c[k] * z - width) / square);
      high[k] = std::max(high[k], (c[k] * z + width) / square);
    }
  const auto clamp = [&](double place, int count) {
    return static_cast<int>(std::clamp(place, 0.0, double(count)));
  };
  const auto first = [&](std::size_t k, int count) {
    return clamp(std::ceil(low[k] * focal_ + 0.5 * count - 0.5 - kMargin), count);
  };
  const auto end = [&](std::size_t k, int count) {
    return clamp(std::floor(high[k] * focal_ + 0.5 * count + 0.5 + kMargin), count);
  };
  return {first(1, grid_.rows), end(1, grid_.rows), first(0, grid_.cols), end(0, grid_.cols)};
}

SceneView::Pixels SceneView::pixels_of(const ViewSolid& solid) const {
  const Vector3& s = solid.size;
  switch (solid.kind) {
    case SolidKind::half_space: return {0, grid_.rows, 0, grid_.cols};
    case SolidKind::ball:
    case SolidKind::ellipsoid: return pixels_of({&solid.origin, 1}, std::max({s[0], s[1], s[2]}));
    case SolidKind::cylinder:
    case SolidKind::capsule: {
      const Vector3 way = s[1] * solid.axes[2];
      const std::array<Vector3, 2> ends{solid.origin - way, solid.origin + way};
      return pixels_of(ends, s[0]);
    }
    case SolidKind::cuboid: break;
  }
  std::array<Vector3, 8> corners;
  for (std::size_t k = 0; k < corners.size(); ++k) {
    corners[k] = solid.origin;
    for (std::size_t i = 0; i < 3; ++i)
      corners[k] = corners[k] + ((k >> i & 1U) != 0 ? s[i] : -s[i]) * solid.axes[i];
  }
  return pixels_of(corners, 0);
}

void SceneView::add(const ViewSolid& solid) {
  const Pixels pixels = pixels_of(solid);
  const bool plane = solid.kind == SolidKind::half_space;
  RayRow row = rows_of(solid, light_, ambient_, direct_, focal_, grid_.far);
  const CastRow cast_row = cast_of(solid.kind, row.specular > 0);
  if (plane && !(dot(solid.axes[2], solid.origin) < 0)) return;  // the pinhole is inside
  row.u = u_.data();
  row.first = pixels.first_col, row.end = pixels.end_col;
  for (int i = pixels.first_row; i < pixels.end_row; ++i) {
    const double v = ray_row(i);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3& axis = solid.axes[k];
      const double scale = unit_of(solid, k),
                   begin = plane ? -dot(axis, solid.origin)
                                 : axis[1] * (v * solid.origin[2] - solid.origin[1]);
      row.o[k] = static_cast<float>(begin / scale);
      row.d[k] = static_cast<float>((axis[1] * v + axis[2]) / scale);
    }
    if (plane && row.d[2] + row.x[2] * u_.front() >= 0 && row.d[2] + row.x[2] * u_.back() >= 0)
      continue;  // above the horizon
    const std::size_t first = std::size_t(i) * std::size_t(grid_.cols);
    row.depth = depth_.data() + first;
    row.numbers = numbers_.data() + first;
    row.colours = colours_.data() + first;
    cast_row(row);
  }
}

}  // namespace tangere
