// SPDX-License-Identifier: Apache-2.0
// Each layout in its own frame; scene_sensors.cpp puts it on its body.
#include "io/tactile_layouts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "engine/compiled_model.hpp"
#include "engine/error.hpp"

namespace tangere {
namespace {

using kernels::Vec3;

constexpr int kMostPoints = 1 << 24;

Vector3 array_of(const Vec3<double>& a) { return {a.x, a.y, a.z}; }
Vec3<double> vec(const Vector3& a) { return {a[0], a[1], a[2]}; }
Vec3<double> unit(const Vec3<double>& a) { return (1 / std::sqrt(dot(a, a))) * a; }

TactilePoint point_at(const Vec3<double>& position, const Vec3<double>& normal, const Vec3<double>& axis0) {
  TactilePoint p;
  p.position = array_of(position);
  p.normal = array_of(normal);
  p.axis0 = array_of(axis0);
  p.axis1 = array_of(cross(normal, axis0));
  return p;
}

/// A list of points, line by line; quotes are spaces.
class PointFile {
 public:
  explicit PointFile(const std::string& path) : path_(path) {
    std::error_code error;
    if (std::filesystem::is_directory(path, error)) throw IoError(path + ": is a folder; expected a list of points");
    file_.open(path, std::ios::binary);
    if (!file_) throw IoError(path + ": cannot be opened for reading");
  }

  /// Numbers of the next line that is not empty; false at the end of the file.
  bool next(std::vector<double>& numbers) {
    while (std::getline(file_, line_)) {
      ++number_;
      std::replace(line_.begin(), line_.end(), '"', ' ');
      numbers.clear();
      for (std::string_view rest = line_;;) {
        const std::size_t begin = rest.find_first_not_of(" \t\r");
        if (begin == std::string_view::npos || rest[begin] == '#') break;
        const std::size_t end = std::min(rest.find_first_of(" \t\r", begin), rest.size());
        numbers.push_back(number(rest.substr(begin, end - begin)));
        rest.remove_prefix(end);
      }
      if (!numbers.empty()) return true;
    }
    if (file_.bad()) throw IoError(path_ + ": reading failed");
    return false;
  }

  [[noreturn]] void fail(const std::string& message) const {
    throw InputError(Source{path_, number_}.prefix() + message);
  }

 private:
  [[nodiscard]] double number(std::string_view word) const {
    if (word.starts_with('+')) word.remove_prefix(1);
    double x = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), x);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(x))
      fail(fmt::format("'{}'; expected a finite number", word));
    return x;
  }

  std::string path_, line_;
  std::ifstream file_;
  int number_ = 0;
};

/// Three numbers from the k-th, of unit length.
Vector3 direction(const PointFile& file, const std::vector<double>& numbers, std::size_t k, const char* what) {
  const Vec3<double> a = {numbers[k], numbers[k + 1], numbers[k + 2]};
  if (!(dot(a, a) > 0)) file.fail(fmt::format("{} has no length; expected a direction", what));
  return array_of(unit(a));
}

TactilePoint parse_point(const PointFile& file, const std::vector<double>& numbers) {
  constexpr std::size_t kPlain = 14, kFactors = 18;
  if (numbers.size() != kPlain && numbers.size() != kFactors)
    file.fail(fmt::format("{} numbers; expected position (3), row and column (2), normal, axis0, axis1 (3 each), and perhaps "
                          "factors of kn, kt, mu, damping (4)",
                          numbers.size()));
  TactilePoint p;
  std::copy_n(numbers.begin(), 3, p.position.begin());
  for (std::size_t k = 0; k < 2; ++k) {
    const double x = numbers[3 + k];
    if (x != std::floor(x) || x < -1 || x > kMostPoints) file.fail(fmt::format("pixel {}; expected a whole number, or -1", x));
    p.pixel[k] = static_cast<int>(x);
  }
  p.normal = direction(file, numbers, 5, "the normal");
  p.axis0 = direction(file, numbers, 8, "axis0");
  p.axis1 = direction(file, numbers, 11, "axis1");
  for (std::size_t k = kPlain; k < numbers.size(); ++k) {
    if (numbers[k] < 0) file.fail(fmt::format("factor {}; expected zero or more", numbers[k]));
    p.factors[k - kPlain] = numbers[k];
  }
  return p;
}

}  // namespace

std::vector<TactilePoint> hemisphere_points(double radius, int count) {
  std::vector<TactilePoint> points;
  const double golden = M_PI * (3 - std::sqrt(5.0));
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (i + 0.5) / count, across = std::sqrt(1 - z * z), turn = golden * i;
    const double c = std::cos(turn), s = std::sin(turn);
    const Vec3<double> normal = {across * c, across * s, z};
    points.push_back(point_at(radius * normal, normal, {z * c, z * s, -across}));
  }
  return points;
}

std::vector<TactilePoint> cylinder_points(double radius, double length, int along, int around) {
  std::vector<TactilePoint> points;
  for (int i = 0; i < along; ++i)
    for (int j = 0; j < around; ++j) {
      const double z = along > 1 ? length * (double(i) / (along - 1) - 0.5) : 0, turn = 2 * M_PI * j / around;
      const double c = std::cos(turn), s = std::sin(turn);
      points.push_back(point_at({radius * c, radius * s, z}, {c, s, 0}, {-s, c, 0}));
      points.back().pixel = {i, j};
    }
  return points;
}

std::vector<TactilePoint> mesh_points(const MeshShape& mesh, double pitch, std::size_t most) {
  std::vector<TactilePoint> points;
  const auto vertex = [&](int k) {
    const double* p = &mesh.vertices[3 * std::size_t(k)];
    return Vec3<double>{p[0], p[1], p[2]};
  };
  for (const std::array<int, 3>& t : mesh.triangles) {
    const Vec3<double> a = vertex(t[0]), ab = vertex(t[1]) - a, ac = vertex(t[2]) - a, bc = ac - ab;
    const Vec3<double> area = cross(ab, ac);
    if (!(dot(area, area) > 0)) continue;  // nothing to feel on
    const double longest = std::sqrt(std::max({dot(ab, ab), dot(ac, ac), dot(bc, bc)})), cuts = std::ceil(longest / pitch);
    if (cuts * cuts + double(points.size()) > double(most))
      throw InputError(fmt::format("a pitch of {} m gives more than {} points on the mesh; expected a larger one", pitch, most));
    const int n = static_cast<int>(cuts);
    const auto add = [&](double u, double v) {
      points.push_back(point_at(a + (u / (3 * n)) * ab + (v / (3 * n)) * ac, unit(area), unit(ab)));
    };
    for (int i = 0; i < n; ++i)
      for (int j = 0; i + j < n; ++j) {
        add(3 * i + 1, 3 * j + 1);
        if (i + j + 1 < n) add(3 * i + 2, 3 * j + 2);  // the small triangle turned the other way
      }
  }
  return points;
}

std::vector<TactilePoint> read_tactile_points(const std::string& path) {
  PointFile file(path);
  std::vector<double> numbers;
  if (!file.next(numbers)) throw InputError(path + ": empty; expected a count of points");
  if (numbers.size() != 1 || numbers[0] != std::floor(numbers[0]) || numbers[0] < 1 || numbers[0] > kMostPoints)
    file.fail("the first line is no count of points");
  const auto count = static_cast<std::size_t>(numbers[0]);
  std::vector<TactilePoint> points;
  while (points.size() < count) {
    if (!file.next(numbers)) file.fail(fmt::format("the file ends after {} of {} points", points.size(), count));
    points.push_back(parse_point(file, numbers));
  }
  if (file.next(numbers)) file.fail(fmt::format("more than the {} points announced", count));
  return points;
}

void move_points(const Pose& pose, std::vector<TactilePoint>& points) {
  const kernels::Frame<double> at = to_frame(pose);
  for (TactilePoint& p : points) {
    p.position = array_of(at.R * vec(p.position) + at.p);
    for (Vector3* a : {&p.normal, &p.axis0, &p.axis1}) *a = array_of(at.R * vec(*a));
  }
}

}  // namespace tangere
