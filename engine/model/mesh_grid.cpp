// SPDX-License-Identifier: Apache-2.0
// The sign of a distance is that of the winding number: how often the surface encloses a place. On
// a line along z it changes by one where a triangle crosses the line. Which triangles do is decided
// by sides of edges. Two triangles with a common edge take the same decision about it, so that none
// is missed and none is counted twice.
//
// The coefficients solve (c[i-1] + 4 c[i] + c[i+1])/6 = d[i] along each axis in turn. Beyond the
// last nodes they are extrapolated linearly. The extrapolation affects a few cells, so the grid
// extends kPadding cells beyond the mesh.
#include "engine/model/mesh_grid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>

#include "engine/base/error.hpp"
#include "engine/model/node_distances.hpp"
#include "kernels/contact/shapes/spline.hpp"

namespace tangere {

using kernels::Vec3;

namespace {

constexpr int kBeyond = 2;                         // cells: of the box of what touches
constexpr int kPadding = kBeyond + kernels::kRim;  // of the grid

struct Crossing {
  double z;
  int turn;  ///< +1: the triangle faces upwards
};

/// Finds where the vertical lines through the nodes cross the surface. The lines are moved aside by
/// so little that it does not matter, and by so much that they miss the corners of what people
/// draw.
class Crossings {
 public:
  Crossings(const MeshShape& mesh, const GridNodes& nodes)
      : mesh_(mesh),
        nodes_(nodes),
        crossings_(std::size_t(nodes.count[0]) * std::size_t(nodes.count[1])) {
    for (const std::array<int, 3>& t : mesh.triangles) add(t);
  }

  /// Calls f(k, winding number) for the nodes of a line from above.
  template <class F>
  void for_each(int i, int j, const F& f) {
    std::vector<Crossing>& all = line(i, j);
    std::sort(all.begin(), all.end(),
              [](const Crossing& a, const Crossing& b) { return a.z > b.z; });
    int winding = 0;
    std::size_t next = 0;
    for (int k = nodes_.count[2] - 1; k >= 0; --k) {
      for (; next < all.size() && all[next].z > nodes_.place(2, k); ++next)
        winding += all[next].turn;
      f(k, winding);
    }
  }

 private:
  std::vector<Crossing>& line(int i, int j) {
    return crossings_[std::size_t(i) * std::size_t(nodes_.count[1]) + std::size_t(j)];
  }
  [[nodiscard]] const double* vertex(int k) const { return &mesh_.vertices[3 * std::size_t(k)]; }
  [[nodiscard]] double aside(int axis) const {
    return nodes_.cell * (axis == 0 ? 1.234567e-7 : 2.718281e-7);
  }
  /// Whether a place lies to the left of an edge. The edge turned round gives the opposite.
  [[nodiscard]] bool left_of(int a, int b, double x, double y) const {
    const bool turned = a > b;
    const double *from = vertex(turned ? b : a), *to = vertex(turned ? a : b);
    const bool left = (to[0] - from[0]) * (y - from[1]) - (to[1] - from[1]) * (x - from[0]) > 0;
    return left != turned;
  }
  void add(const std::array<int, 3>& t) {
    const double *a = vertex(t[0]), *b = vertex(t[1]), *c = vertex(t[2]);
    const double area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    int first[2], last[2];
    for (int axis = 0; axis < 2; ++axis) {
      const auto [low, high] = std::minmax({a[axis], b[axis], c[axis]});
      const double from = nodes_.origin[axis] + aside(axis);
      first[axis] = std::max(0, static_cast<int>(std::floor((low - from) / nodes_.cell)));
      last[axis] = std::min(nodes_.count[axis] - 1,
                            static_cast<int>(std::ceil((high - from) / nodes_.cell)));
    }
    for (int i = first[0]; i <= last[0]; ++i)
      for (int j = first[1]; j <= last[1]; ++j) {
        const double x = nodes_.place(0, i) + aside(0), y = nodes_.place(1, j) + aside(1);
        const bool left = left_of(t[0], t[1], x, y);
        if (left_of(t[1], t[2], x, y) != left || left_of(t[2], t[0], x, y) != left) continue;
        if (area == 0) continue;  // sides disagree by rounding alone
        const double u = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area,
                     v = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area;
        line(i, j).push_back({u * a[2] + v * b[2] + (1 - u - v) * c[2], left ? 1 : -1});
      }
  }

  const MeshShape& mesh_;
  const GridNodes& nodes_;
  std::vector<std::vector<Crossing>> crossings_;
};

/// Throws unless every node is outside or inside, and returns which ones are inside.
std::vector<bool> inside(const MeshShape& mesh, const GridNodes& nodes) {
  Crossings crossings(mesh, nodes);
  std::vector<bool> out(nodes.all());
  for (int i = 0; i < nodes.count[0]; ++i)
    for (int j = 0; j < nodes.count[1]; ++j)
      crossings.for_each(i, j, [&](int k, int winding) {
        if (winding != 0 && winding != 1)
          throw InputError(fmt::format(
              "the surface encloses the place ({:g} {:g} {:g}) m {} times; expected a surface that "
              "does not overlap itself, or resolution=\"0\" for a mesh that nothing touches",
              nodes.place(0, i), nodes.place(1, j), nodes.place(2, k), winding));
        out[nodes.at(i, j, k)] = winding == 1;
      });
  return out;
}

/// Returns the signed distance at every node.
std::vector<double> distances(const MeshShape& mesh, const GridNodes& nodes) {
  const std::vector<bool> negative = inside(mesh, nodes);
  std::vector<double> d = node_distances(mesh.vertices, mesh.triangles, nodes);
  for (std::size_t n = 0; n < d.size(); ++n)
    if (negative[n]) d[n] = -d[n];
  return d;
}

/// Turns values along one axis into coefficients, two more than values. `count`: of values along
/// the axes, of which `axis` grows by two.
std::vector<double> coefficients_along(const std::vector<double>& values, int (&count)[3],
                                       int axis) {
  const auto n = std::size_t(count[axis]);
  std::size_t inner = 1, outer = 1;
  for (int c = 0; c < 3; ++c) {
    if (c < axis) outer *= std::size_t(count[c]);
    if (c > axis) inner *= std::size_t(count[c]);
  }
  // Thomas' algorithm with the factors of (1 4 1), rows 1 … n - 2. The first and the last
  // coefficient are the values there.
  std::vector<double> factor(n);
  for (std::size_t i = 1; i + 1 < n; ++i) factor[i] = 1 / (4 - (i > 1 ? factor[i - 1] : 0));
  std::vector<double> out((n + 2) * inner * outer);
  for (std::size_t o = 0; o < outer; ++o) {
    const double* from = &values[o * n * inner];
    double* to = &out[o * (n + 2) * inner + inner];  // its first row is the one beyond
    for (std::size_t s = 0; s < inner; ++s) {
      to[s] = from[s];
      to[(n - 1) * inner + s] = from[(n - 1) * inner + s];
    }
    for (std::size_t i = 1; i + 1 < n; ++i)
      for (std::size_t s = 0; s < inner; ++s) {
        double right = 6 * from[i * inner + s] - to[(i - 1) * inner + s];
        if (i + 2 == n) right -= to[(i + 1) * inner + s];
        to[i * inner + s] = right * factor[i];
      }
    for (std::size_t i = n - 2; i-- > 1;)
      for (std::size_t s = 0; s < inner; ++s)
        to[i * inner + s] -= factor[i] * to[(i + 1) * inner + s];
    for (std::size_t s = 0; s < inner; ++s) {
      double* const row = to + s;
      row[0 - std::ptrdiff_t(inner)] = 2 * row[0] - row[inner];
      row[n * inner] = 2 * row[(n - 1) * inner] - row[(n - 2) * inner];
    }
  }
  count[axis] += 2;
  return out;
}

/// Turns coefficients (x, y, z) into the order of DistanceGrid: (y, cells along z, x, 4).
std::vector<float> quads_along_z(const std::vector<double>& values, const int (&count)[3],
                                 int cells) {
  const auto nx = std::size_t(count[0]), ny = std::size_t(count[1]), nz = std::size_t(count[2]);
  std::vector<float> out(ny * std::size_t(cells) * nx * kernels::kQuad);
  float* to = out.data();
  for (std::size_t j = 0; j < ny; ++j)
    for (std::size_t k = 0; k < std::size_t(cells); ++k)
      for (std::size_t i = 0; i < nx; ++i)
        for (std::size_t z = k; z < k + kernels::kQuad; ++z)
          *to++ = static_cast<float>(values[(i * ny + j) * nz + z]);
  return out;
}

/// Control points of φ in a cell, (4, 4, 4).
using Cell = std::array<double, 64>;
constexpr int kStride[3] = {16, 4, 1};

/// Returns a bound of |∇φ| in a cell: a derivative by an axis lies between `factor` times the least
/// and the greatest difference of neighbours along it.
double steepest_in(const Cell& c, double factor) {
  double square = 0;
  for (const int stride : kStride) {
    double most = 0;
    for (int line = 0; line < 64; line += 4 * stride)
      for (int k = line; k < line + 3 * stride; ++k)
        most = std::max(most, std::abs(c[std::size_t(k + stride)] - c[std::size_t(k)]));
    square += most * most;
  }
  return factor * std::sqrt(square);
}

/// Turns the control points of the spline into those of the same polynomial as a Bézier form, which
/// lie far closer to it: (c₀ + 4 c₁ + c₂)/6, (2 c₁ + c₂)/3, (c₁ + 2 c₂)/3, (c₁ + 4 c₂ + c₃)/6.
Cell bezier(Cell c) {
  for (const int stride : kStride)
    for (int line = 0; line < 64; line += 4 * stride)
      for (int k = line; k < line + stride; ++k) {
        double* const at = &c[std::size_t(k)];
        const double c0 = at[0], c1 = at[stride], c2 = at[2 * stride], c3 = at[3 * stride];
        at[0] = (c0 + 4 * c1 + c2) * (1.0 / 6), at[stride] = (2 * c1 + c2) * (1.0 / 3);
        at[2 * stride] = (c1 + 2 * c2) * (1.0 / 3), at[3 * stride] = (c1 + 4 * c2 + c3) * (1.0 / 6);
      }
  return c;
}

/// Second derivatives of a cell's polynomial by its axes: control points of a form of degree 3
/// along each axis. Every one of them is a matrix, and ∇∇φ at a place is a mean of them.
struct SecondDerivatives {
  Cell entry[3][3];  ///< those of a ≤ b

  /// `c`: control points of the Bézier form.
  explicit SecondDerivatives(const Cell& c) {
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = a; b < 3; ++b) {
        Cell& out = entry[a][b];
        out = differences(differences(c, kStride[a], 3), kStride[b], a == b ? 2 : 3);
        if (a == b) raise_degree(out, kStride[a], 1);
        raise_degree(out, kStride[a], 2);
        if (a != b) raise_degree(out, kStride[b], 2);
      }
  }

 private:
  /// Calls f with the first of four control points of every line along an axis.
  template <class F>
  static void for_each_line(Cell& c, int stride, const F& f) {
    for (int line = 0; line < 64; line += 4 * stride)
      for (int k = line; k < line + stride; ++k) f(&c[std::size_t(k)]);
  }
  /// Returns the derivative along an axis, of a form that has this degree along it.
  static Cell differences(Cell c, int stride, int degree) {
    for_each_line(c, stride, [&](double* at) {
      for (int i = 0; i < degree; ++i)
        at[i * stride] = degree * (at[(i + 1) * stride] - at[i * stride]);
    });
    return c;
  }
  /// Writes the same polynomial as a form of one degree more than this.
  static void raise_degree(Cell& c, int stride, int degree) {
    const double part = 1.0 / (degree + 1);
    for_each_line(c, stride, [&](double* at) {
      at[(degree + 1) * stride] = at[degree * stride];
      for (int i = degree; i > 0; --i)
        at[i * stride] = part * (i * at[(i - 1) * stride] + (degree + 1 - i) * at[i * stride]);
    });
  }
};

/// Returns the least eigenvalue of a symmetric matrix (xx, yy, zz, xy, xz, yz), or a little less.
double least_eigenvalue(double xx, double yy, double zz, double xy, double xz, double yz) {
  const double mean = (xx + yy + zz) / 3, a = xx - mean, b = yy - mean, c = zz - mean;
  const double size = std::sqrt((a * a + b * b + c * c + 2 * (xy * xy + xz * xz + yz * yz)) / 6);
  if (!(size > 0)) return mean;
  const double det = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
  const double third = std::acos(std::clamp(det / (2 * size * size * size), -1.0, 1.0)) / 3;
  return mean + 2 * size * (std::cos(third + 2 * M_PI / 3) - 1e-6);
}

/// Returns how far φ bends downwards in a cell, or `known` where that is more: no less than
/// -vᵀ∇∇φ v for any unit vector v. The least eigenvalue of a mean of matrices is no less than the
/// least of theirs. `close`: control points of the Bézier form.
double sag_in(const Cell& close, double known) {
  const SecondDerivatives d(close);
  double sag = known;
  for (std::size_t k = 0; k < 64; ++k) {
    const double xx = d.entry[0][0][k], yy = d.entry[1][1][k], zz = d.entry[2][2][k],
                 xy = d.entry[0][1][k], xz = d.entry[0][2][k], yz = d.entry[1][2][k];
    // Nothing to do where the matrix plus `sag` has no negative eigenvalue.
    const double a = xx + sag, b = yy + sag, c = zz + sag, minor = a * b - xy * xy;
    const double det = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
    if (a > 0 && minor > 0 && det > 0) continue;
    sag = std::max(sag, -least_eigenvalue(xx, yy, zz, xy, xz, yz));
  }
  return sag;
}

/// Control points of the spline in a cell.
Cell cell_of(const kernels::DistanceGrid& g, std::ptrdiff_t first) {
  Cell c;
  for (int n = 0; n < 64; ++n)
    c[std::size_t(n)] = g.coefficients[first + n / 4 % 4 * g.plane + n / 16 * 4 + n % 4];
  return c;
}

/// Calls f with the place of every cell and its first coefficient.
template <class F>
void for_each_cell(const kernels::DistanceGrid& g, const F& f) {
  for (int j = 0; j < g.cells[1]; ++j)
    for (int k = 0; k < g.cells[2]; ++k)
      for (int i = 0; i < g.cells[0]; ++i) f(i, j, k, kernels::first_coefficient(g, i, j, k));
}

/// Fills `floors` and `slope` of a grid: the least control point of a Bézier form is no more than
/// φ in its cell, and the steepest cell with φ > 0 bounds |∇φ|. What is deep inside, where the
/// nearest place jumps, has no part in the slope: on the way to a place that touches, φ falls from
/// its value to zero outside.
void bound_cells(MeshGrid& grid) {
  constexpr double kRounding = 4e-6;  // of sums of 64 products in single precision
  kernels::DistanceGrid& g = grid.view;
  grid.floors.assign(grid.coefficients.size() / kernels::kQuad, 0.0F);
  g.floors = grid.floors.data();
  double most = 0;
  for_each_cell(g, [&](int, int, int, std::ptrdiff_t at) {
    const Cell c = cell_of(g, at), close = bezier(c);
    double low = close[0], high = close[0];
    for (const double x : close) low = std::min(low, x), high = std::max(high, x);
    const double size = std::max(-low, high) + g.cell;
    grid.floors[std::size_t(at / kernels::kQuad)] = static_cast<float>(low - kRounding * size);
    if (high > 0 && steepest_in(c, 1) > most) most = std::max(most, steepest_in(close, 3));
  });
  g.slope = most / g.cell * (1 + 1e-6);
}

/// Fills `sags`. A cell has no part in them where φ < 0 everywhere, and where φ is more than it can
/// fall on a way of kSagBlock cells.
void bound_bending(MeshGrid& grid) {
  constexpr int kBlock = kernels::kSagBlock;
  kernels::DistanceGrid& g = grid.view;
  int count[3];
  for (int c = 0; c < 3; ++c) count[c] = (g.cells[c] + kBlock - 1) / kBlock;
  const auto block = [&](int i, int j, int k) {
    return (std::size_t(i) * std::size_t(count[1]) + std::size_t(j)) * std::size_t(count[2]) +
           std::size_t(k);
  };
  const std::size_t blocks = std::size_t(count[0]) * std::size_t(count[1]) * std::size_t(count[2]);
  std::vector<double> own(blocks);
  for_each_cell(g, [&](int i, int j, int k, std::ptrdiff_t at) {
    if (grid.floors[std::size_t(at / kernels::kQuad)] > g.slope * g.cell * kBlock) return;
    const Cell close = bezier(cell_of(g, at));
    if (*std::max_element(close.begin(), close.end()) <= 0) return;
    double& sag = own[block(i / kBlock, j / kBlock, k / kBlock)];
    sag = sag_in(close, sag);
  });
  grid.sags.assign(own.size(), 0.0F);
  for (int i = 0; i < count[0]; ++i)
    for (int j = 0; j < count[1]; ++j)
      for (int k = 0; k < count[2]; ++k) {
        double most = 0;
        for (int a = std::max(i - 1, 0); a < std::min(i + 2, count[0]); ++a)
          for (int b = std::max(j - 1, 0); b < std::min(j + 2, count[1]); ++b)
            for (int c = std::max(k - 1, 0); c < std::min(k + 2, count[2]); ++c)
              most = std::max(most, own[block(a, b, c)]);
        grid.sags[block(i, j, k)] = static_cast<float>(most * (1 + 1e-6));
      }
  g.sags = grid.sags.data();
}

}  // namespace

std::shared_ptr<const MeshGrid> make_mesh_grid(const MeshShape& mesh) {
  double low[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    low[v % 3] = std::min(low[v % 3], mesh.vertices[v]);
    high[v % 3] = std::max(high[v % 3], mesh.vertices[v]);
  }
  const double longest = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  auto out = std::make_shared<MeshGrid>();
  kernels::DistanceGrid& g = out->view;
  GridNodes nodes{};
  nodes.cell = g.cell = longest / mesh.resolution;
  for (int c = 0; c < 3; ++c) {
    g.cells[c] = static_cast<int>(std::ceil((high[c] - low[c]) / g.cell - 1e-9)) + 2 * kPadding;
    g.origin[c] = nodes.origin[c] = 0.5 * (low[c] + high[c] - g.cells[c] * g.cell);
    g.low[c] = low[c] - kBeyond * g.cell;
    g.high[c] = high[c] + kBeyond * g.cell;
    nodes.count[c] = g.cells[c] + 1;
  }
  std::vector<double> values = distances(mesh, nodes);
  int count[3] = {nodes.count[0], nodes.count[1], nodes.count[2]};
  for (int axis = 2; axis >= 0; --axis) values = coefficients_along(values, count, axis);
  g.row = kernels::kQuad * count[0];
  g.plane = g.cells[2] * g.row;
  out->coefficients = quads_along_z(values, count, g.cells[2]);
  g.coefficients = out->coefficients.data();
  bound_cells(*out);
  bound_bending(*out);
  out->fit = mesh_fit(mesh, g);
  return out;
}

std::shared_ptr<const MeshGrid> shared_mesh_grid(const MeshShape& mesh) {
  struct Made {
    std::vector<double> vertices;
    std::vector<std::array<int, 3>> triangles;
    int resolution;
    std::weak_ptr<const MeshGrid> grid;
  };
  static std::mutex mutex;
  static std::vector<Made> made;
  const std::lock_guard lock(mutex);
  std::erase_if(made, [](const Made& old) { return old.grid.expired(); });
  for (const Made& old : made)
    if (old.resolution == mesh.resolution && old.vertices == mesh.vertices &&
        old.triangles == mesh.triangles)
      if (auto grid = old.grid.lock()) return grid;
  auto grid = make_mesh_grid(mesh);
  made.push_back({mesh.vertices, mesh.triangles, mesh.resolution, grid});
  return grid;
}

std::shared_ptr<const MeshGrid> fitting_mesh_grid(const MeshShape& mesh) {
  if (!(mesh.error > 0)) return shared_mesh_grid(mesh);
  MeshShape tried = mesh;
  double found = 0;
  for (const int cells : {16, 24, 32, 48, 64, 96, MeshShape::kMostCells}) {
    tried.resolution = cells;
    auto grid = shared_mesh_grid(tried);
    found = mesh.scale * grid->fit.error;
    if (found <= mesh.error) return grid;
  }
  throw InputError(
      fmt::format("with {} cells along its longest side, the most, the distance to the mesh is off "
                  "by {:.3g} m; "
                  "expected an error of that or more, not {:g} m",
                  MeshShape::kMostCells, found, mesh.error));
}

std::shared_ptr<const MeshGrid> coarse_mesh_grid(const MeshShape& mesh) {
  constexpr double kAcross = 3;  // cells of the smallest width
  constexpr int kLeast = 16, kMost = 64;
  double low[3], high[3];
  for (std::size_t k = 0; k < mesh.vertices.size(); ++k) {
    const double x = mesh.vertices[k];
    low[k % 3] = k < 3 ? x : std::min(low[k % 3], x);
    high[k % 3] = k < 3 ? x : std::max(high[k % 3], x);
  }
  const auto [least, most] = std::minmax({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  MeshShape coarse = mesh;
  coarse.error = 0;
  coarse.resolution =
      static_cast<int>(std::clamp<double>(std::ceil(kAcross * most / least), kLeast, kMost));
  return shared_mesh_grid(coarse);
}

}  // namespace tangere
