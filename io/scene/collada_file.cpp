// SPDX-License-Identifier: Apache-2.0
// Geometries stand apart from the nodes that place them, so elements are found by their ids.
#include "io/scene/collada_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <string_view>

#include "engine/base/error.hpp"
#include "io/files/text_file.hpp"
#include "io/scene/polygons.hpp"
#include "io/scene/xml_document.hpp"

namespace tangere {
namespace {

using tinyxml2::XMLElement;

constexpr std::size_t kMostBytes = std::size_t{256} << 20U;
constexpr std::size_t kMostTriangles = 10'000'000, kMostPositions = 10'000'000;
constexpr int kMostNodes = 100'000;  // that the scene visits
constexpr int kDeepest = 100;        // of nodes in nodes
constexpr double kLargest = 1e6;     // of a position, as of other surface files

/// An affine map x → A x + b, rows of (A b).
using Affine = std::array<double, 12>;
constexpr Affine kSame = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

/// The map that applies `second` first.
Affine compose(const Affine& first, const Affine& second) {
  Affine out{};
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 4; ++c) {
      double sum = c == 3 ? first[4 * r + 3] : 0;
      for (std::size_t k = 0; k < 3; ++k) sum += first[4 * r + k] * second[4 * k + c];
      out[4 * r + c] = sum;
    }
  return out;
}

Vector3 apply(const Affine& map, const Vector3& x) {
  Vector3 out{};
  for (std::size_t r = 0; r < 3; ++r)
    out[r] = map[4 * r] * x[0] + map[4 * r + 1] * x[1] + map[4 * r + 2] * x[2] + map[4 * r + 3];
  return out;
}

bool mirrors(const Affine& a) {
  return a[0] * (a[5] * a[10] - a[6] * a[9]) - a[1] * (a[4] * a[10] - a[6] * a[8]) +
             a[2] * (a[4] * a[9] - a[5] * a[8]) <
         0;
}

/// A turn by `degrees` about an axis.
Affine turn(const Vector3& axis, double degrees) {
  const double size = std::hypot(axis[0], axis[1], axis[2]),
               angle = degrees * std::numbers::pi / 180, c = std::cos(angle), s = std::sin(angle);
  const double x = axis[0] / size, y = axis[1] / size, z = axis[2] / size;
  return {c + x * x * (1 - c),     x * y * (1 - c) - z * s, x * z * (1 - c) + y * s, 0,
          y * x * (1 - c) + z * s, c + y * y * (1 - c),     y * z * (1 - c) - x * s, 0,
          z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c),     0};
}

/// Positions of a <vertices>, and how many numbers of its array each takes.
struct Positions {
  std::vector<double> numbers;
  std::size_t stride = 3, offset = 0;

  [[nodiscard]] std::size_t count() const { return (numbers.size() - offset) / stride; }
};

class ColladaFile {
 public:
  explicit ColladaFile(const std::string& path) : path_(path) {
    const std::string text = read_text_file(path, kMostBytes, "a COLLADA file");
    std::vector<std::string> ignored;
    root_ = &parse_xml(document_, text, path, "the root <COLLADA>", ignored);
    if (std::string_view(root_->Name()) != "COLLADA")
      fail(*root_, fmt::format("the root <{}>; expected <COLLADA>", root_->Name()));
    find_ids(*root_);
  }

  RawMesh read() {
    double metre = 1;
    if (const XMLElement* const asset = root_->FirstChildElement("asset"))
      if (const XMLElement* const unit = asset->FirstChildElement("unit"))
        metre = unit->DoubleAttribute("meter", 1);
    if (!(metre > 0 && metre <= kLargest)) fail(*root_, "<unit> has no positive length in metres");
    const Affine scale = {metre, 0, 0, 0, 0, metre, 0, 0, 0, 0, metre, 0};
    const XMLElement* const scene = root_->FirstChildElement("scene");
    const XMLElement* const shown =
        scene == nullptr ? nullptr : scene->FirstChildElement("instance_visual_scene");
    if (shown != nullptr)
      add_nodes(target(*shown), scale, 0);
    else
      for_each(*root_, "library_geometries", [&](const XMLElement& library) {
        for_each(library, "geometry", [&](const XMLElement& g) { add_geometry(g, scale); });
      });
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const XMLElement& at, const std::string& message) const {
    throw InputError(fmt::format("{}:{}: {}", path_, at.GetLineNum(), message));
  }

  void find_ids(const XMLElement& from) {
    for (const XMLElement* e = from.FirstChildElement(); e != nullptr;
         e = e->NextSiblingElement()) {
      if (const char* const id = e->Attribute("id")) ids_.emplace(id, e);
      find_ids(*e);
    }
  }

  template <class F>
  static void for_each(const XMLElement& in, const char* name, const F& f) {
    for (const XMLElement* e = in.FirstChildElement(name); e != nullptr;
         e = e->NextSiblingElement(name))
      f(*e);
  }

  /// The element that an attribute names, "#id".
  const XMLElement& target(const XMLElement& from, const char* attribute = "url") const {
    const char* const text = from.Attribute(attribute);
    const std::string_view name = text == nullptr ? "" : text;
    const auto found = name.starts_with('#') ? ids_.find(name.substr(1)) : ids_.end();
    if (found == ids_.end())
      fail(from, fmt::format("<{}> {}=\"{}\"; expected # and the id of an element of this file",
                             from.Name(), attribute, name.substr(0, 80)));
    return *found->second;
  }

  template <class T>
  std::vector<T> numbers(const XMLElement& of) const {
    std::vector<T> out;
    std::string text;  // comments may stand between its parts
    for (const tinyxml2::XMLNode* n = of.FirstChild(); n != nullptr; n = n->NextSibling())
      if (n->ToText() != nullptr) text += std::string(n->Value()) + " ";
    const std::string_view all(text);
    for (std::size_t k = 0; k < all.size();) {
      k = all.find_first_not_of(" \t\r\n", k);
      if (k == std::string_view::npos) break;
      const std::size_t end = std::min(all.find_first_of(" \t\r\n", k), all.size());
      T x{};
      if (all[k] == '+') ++k;
      const auto [at, error] = std::from_chars(all.data() + k, all.data() + end, x);
      if (error != std::errc() || at != all.data() + end || !(std::abs(double(x)) <= 1e9))
        fail(of, fmt::format("<{}> has '{}'; expected numbers of at most 1e9", of.Name(),
                             all.substr(k, std::min<std::size_t>(end - k, 40))));
      out.push_back(x);
      k = end;
    }
    return out;
  }

  std::vector<double> numbers(const XMLElement& of, std::size_t count) const {
    std::vector<double> out = numbers<double>(of);
    if (out.size() != count)
      fail(of, fmt::format("<{}> has {} numbers; expected {}", of.Name(), out.size(), count));
    return out;
  }

  /// The map of one child of a node; the same for what is no map.
  [[nodiscard]] Affine map_of(const XMLElement& part) const {
    const std::string_view name = part.Name();
    Affine out = kSame;
    if (name == "matrix") {
      const std::vector<double> x = numbers(part, 16);
      std::copy(x.begin(), x.begin() + 12, out.begin());
    } else if (name == "translate") {
      const std::vector<double> x = numbers(part, 3);
      for (std::size_t k = 0; k < 3; ++k) out[4 * k + 3] = x[k];
    } else if (name == "scale") {
      const std::vector<double> x = numbers(part, 3);
      for (std::size_t k = 0; k < 3; ++k) out[5 * k] = x[k];
    } else if (name == "rotate") {
      const std::vector<double> x = numbers(part, 4);
      if (x[0] == 0 && x[1] == 0 && x[2] == 0) fail(part, "<rotate> about no axis");
      out = turn({x[0], x[1], x[2]}, x[3]);
    } else if (name == "lookat" || name == "skew") {
      fail(part, fmt::format("<{}>; expected matrix, translate, rotate or scale", name));
    }
    return out;
  }

  /// Adds what a node, or a scene of nodes, has.
  void add_nodes(const XMLElement& in, const Affine& placed, int depth) {
    if (++nodes_ > kMostNodes) fail(in, fmt::format("more than {} nodes", kMostNodes));
    if (depth > kDeepest) fail(in, fmt::format("nodes nested deeper than {}", kDeepest));
    Affine map = placed;
    for (const XMLElement* e = in.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
      const std::string_view name = e->Name();
      if (name == "node")
        add_nodes(*e, map, depth + 1);
      else if (name == "instance_node")
        add_nodes(target(*e), map, depth + 1);
      else if (name == "instance_geometry")
        add_geometry(target(*e), map);
      else if (name == "instance_controller")
        fail(*e, "a skinned surface; expected instance_geometry");
      else
        map = compose(map, map_of(*e));
    }
  }

  void add_geometry(const XMLElement& geometry, const Affine& map) {
    const XMLElement* const mesh = geometry.FirstChildElement("mesh");
    if (mesh == nullptr) fail(geometry, "a geometry without <mesh>; expected a surface of faces");
    std::map<const XMLElement*, int> first;  // position of the mesh, by <vertices>
    for (const XMLElement* e = mesh->FirstChildElement(); e != nullptr;
         e = e->NextSiblingElement()) {
      const std::string_view kind = e->Name();
      if (kind == "triangles" || kind == "polylist" || kind == "polygons" || kind == "trifans" ||
          kind == "tristrips")
        add_faces(*e, kind, map, first);
    }
  }

  /// Positions of a <vertices>.
  [[nodiscard]] Positions positions(const XMLElement& vertices) const {
    const XMLElement* place = vertices.FirstChildElement("input");
    while (place != nullptr && !place->Attribute("semantic", "POSITION"))
      place = place->NextSiblingElement("input");
    if (place == nullptr) fail(vertices, "<vertices> without an input POSITION");
    const XMLElement& source = target(*place, "source");
    const XMLElement* const array = source.FirstChildElement("float_array");
    if (array == nullptr) fail(source, "<source> without <float_array>");
    Positions out{numbers<double>(*array)};
    if (const XMLElement* const common = source.FirstChildElement("technique_common"))
      if (const XMLElement* const accessor = common->FirstChildElement("accessor")) {
        out.stride = accessor->UnsignedAttribute("stride", 1);
        out.offset = accessor->UnsignedAttribute("offset", 0);
      }
    if (out.stride < 3 || out.offset + 3 > out.numbers.size())
      fail(source,
           fmt::format("{} numbers of positions, {} apart from number {} on; expected x y z of "
                       "each",
                       out.numbers.size(), out.stride, out.offset));
    return out;
  }

  /// Adds the positions of a <vertices> to the mesh, once. Returns the first, and how many.
  std::pair<int, std::size_t> add_positions(const XMLElement& vertices, const Affine& map,
                                            std::map<const XMLElement*, int>& first) {
    const Positions from = positions(vertices);
    const auto [at, fresh] = first.emplace(&vertices, static_cast<int>(mesh_.positions.size()));
    for (std::size_t k = 0; k < from.count() && fresh; ++k) {
      const double* const x = &from.numbers[from.offset + from.stride * k];
      const Vector3 placed = apply(map, {x[0], x[1], x[2]});
      for (const double c : placed)
        if (!(std::abs(c) <= kLargest))
          fail(vertices, fmt::format("a position of {:g} m; expected at most {:g}", c, kLargest));
      mesh_.positions.push_back(placed);
      if (mesh_.positions.size() > kMostPositions)
        fail(vertices, fmt::format("more than {} positions", kMostPositions));
    }
    return {at->second, from.count()};
  }

  void add_faces(const XMLElement& faces, std::string_view kind, const Affine& map,
                 std::map<const XMLElement*, int>& first) {
    std::size_t stride = 0;
    std::optional<std::size_t> offset;
    const XMLElement* vertices = nullptr;
    for_each(faces, "input", [&](const XMLElement& input) {
      const std::size_t at = input.UnsignedAttribute("offset", 0);
      stride = std::max(stride, at + 1);
      if (!input.Attribute("semantic", "VERTEX")) return;
      offset = at;
      vertices = &target(input, "source");
    });
    if (!offset) fail(faces, fmt::format("<{}> without an input VERTEX", kind));
    const auto [begin, count] = add_positions(*vertices, map, first);
    std::vector<int> sizes;
    if (kind == "polylist")
      for_each(faces, "vcount", [&](const XMLElement& e) { sizes = numbers<int>(e); });
    const auto add_list = [&](const XMLElement& p) {
      std::vector<int> corners;
      const std::vector<int> all = numbers<int>(p);
      if (all.size() % stride != 0)
        fail(p, fmt::format("{} numbers; expected {} for each corner", all.size(), stride));
      for (std::size_t k = *offset; k < all.size(); k += stride) {
        if (all[k] < 0 || std::size_t(all[k]) >= count)
          fail(p, fmt::format("vertex {}; expected one of 0 to {}", all[k], count - 1));
        corners.push_back(begin + all[k]);
      }
      add_polygons(p, kind, corners, sizes, mirrors(map));
    };
    for_each(faces, "p", add_list);
    for_each(faces, "ph", [&](const XMLElement& ph) {
      fail(ph, "a polygon with a hole; expected polygons without");
    });
  }

  /// Adds the faces of one list of corners. `mirrored`: they are clockwise seen from outside.
  void add_polygons(const XMLElement& p, std::string_view kind, const std::vector<int>& corners,
                    std::vector<int> sizes, bool mirrored) {
    const auto add = [&](std::vector<int> polygon) {
      if (mirrored) std::reverse(polygon.begin(), polygon.end());
      const std::string fault = cut_polygon(mesh_.positions, polygon, mesh_.triangles);
      if (!fault.empty() && mesh_.fault.empty())
        mesh_.fault = fmt::format("{}:{}: a face of {} corners has {}; expected a polygon", path_,
                                  p.GetLineNum(), polygon.size(), fault);
      if (mesh_.triangles.size() > kMostTriangles)
        fail(p, fmt::format("more than {} triangles", kMostTriangles));
    };
    if (kind == "trifans" || kind == "tristrips") {
      for (std::size_t k = 2; k < corners.size(); ++k) {
        const bool odd = kind == "tristrips" && k % 2 == 1;
        const int a = kind == "trifans" ? corners[0] : corners[k - 2], b = corners[k - 1];
        add({odd ? b : a, odd ? a : b, corners[k]});
      }
      return;
    }
    if (kind == "triangles") sizes.assign(corners.size() / 3, 3);
    if (kind == "polygons") sizes = {static_cast<int>(corners.size())};
    std::size_t at = 0;
    for (const int size : sizes) {
      if (size < 3 || at + std::size_t(size) > corners.size())
        fail(p, fmt::format("a face of {} corners, of {} that are left; expected three or more",
                            size, corners.size() - at));
      add({corners.begin() + std::ptrdiff_t(at), corners.begin() + std::ptrdiff_t(at) + size});
      at += std::size_t(size);
    }
    if (at != corners.size())
      fail(p, fmt::format("{} corners beyond the faces", corners.size() - at));
  }

  std::string path_;
  tinyxml2::XMLDocument document_;
  const XMLElement* root_ = nullptr;
  std::map<std::string, const XMLElement*, std::less<>> ids_;
  RawMesh mesh_;
  int nodes_ = 0;
};

}  // namespace

RawMesh read_collada(const std::string& path) { return ColladaFile(path).read(); }

}  // namespace tangere
