// SPDX-License-Identifier: Apache-2.0
// Three characters of the data become four: base64 of the bytes that a browser's Float32Array has.
#include "io/view/view_page.hpp"

#include <cstring>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <variant>

#include "engine/scene/shapes.hpp"
#include "io/files/printable_text.hpp"
#include "io/picture/body_faces.hpp"
#include "io/view/page_files.hpp"

namespace tangere {
namespace {

using Json = nlohmann::ordered_json;

std::string base64(const unsigned char* bytes, std::size_t size) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((size + 2) / 3 * 4);
  for (std::size_t i = 0; i < size; i += 3) {
    const std::size_t left = std::min<std::size_t>(3, size - i);
    unsigned group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < left ? bytes[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k)
      text += k <= left ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

/// Numbers of four bytes. The program runs on little-endian machines only (kernels/README.md).
template <class T>
Json packed(const std::vector<T>& values) {
  static_assert(sizeof(T) == 4);
  Json object;
  object["type"] = std::is_same_v<T, float> ? "float32" : "int32";
  object["base64"] =
      base64(reinterpret_cast<const unsigned char*>(values.data()), 4 * values.size());
  return object;
}

std::vector<float> single(std::span<const double> values) { return {values.begin(), values.end()}; }

std::vector<float> single(std::span<const Vector3> points) {
  std::vector<float> numbers;
  for (const Vector3& p : points)
    for (const double x : p) numbers.push_back(static_cast<float>(x));
  return numbers;
}

Json packed_triangles(std::span<const std::array<int, 3>> triangles) {
  std::vector<std::int32_t> corners;
  for (const auto& triangle : triangles)
    corners.insert(corners.end(), triangle.begin(), triangle.end());
  return packed(corners);
}

/// Parameters from which page/solids.js draws a shape. Shapes not listed here are sent as
/// triangles.
struct DrawnFrom {
  Json operator()(const SphereShape&) const { return Json::object(); }
  Json operator()(const CuboidShape&) const { return Json::object(); }
  Json operator()(const CylinderShape&) const { return Json::object(); }
  Json operator()(const CapsuleShape&) const { return Json::object(); }
  Json operator()(const PlaneShape&) const { return Json::object(); }
  Json operator()(const AbstractShape& s) const {
    return {{"points", packed(single(s.contact_points))}};
  }
  Json operator()(const MeshShape& s) const {
    std::vector<double> vertices = s.vertices;
    for (double& x : vertices) x *= s.scale;
    return {{"vertices", packed(single(vertices))}, {"triangles", packed_triangles(s.triangles)}};
  }
  Json operator()(const auto& s) const {
    const RoundSurface surface = round_surface_of(s);
    return {{"vertices", packed(single(surface.vertices))},
            {"normals", packed(single(surface.normals))},
            {"triangles", packed_triangles(surface.triangles)}};
  }
};

Json shape_of(const Shape& shape) {
  Json out = {{"kind", shape_name(shape)}};
  for (const NamedSize& size : named_sizes(shape))
    out[size.name] = size.values.size() == 1 ? Json(size.values[0]) : Json(size.values);
  out.update(std::visit(DrawnFrom{}, shape));
  return out;
}

Json bodies_of(const std::vector<LinkDescription>& links) {
  Json bodies = Json::array();
  for (const LinkDescription& link : links) {
    Json body = shape_of(link.body.shape);
    body["name"] = link.body.name;
    body["rgba"] = link.body.rgba;
    bodies.push_back(std::move(body));
  }
  return bodies;
}

Json sensor_of(const ViewSensor& s) {
  return {{"name", s.name},           {"body", s.body},           {"points", s.points},
          {"cells", s.cells()},       {"rows", s.rows},           {"cols", s.cols},
          {"height", s.height},       {"width", s.width},         {"position", packed(s.position)},
          {"axis0", packed(s.axis0)}, {"axis1", packed(s.axis1)}, {"press", packed(s.press)},
          {"place", packed(s.place)}, {"turn", packed(s.turn)}};
}

Json episode_of(const ViewEpisode& e) {
  Json traces = Json::array(), fields = Json::array();
  for (const ViewTrace& t : e.traces)
    traces.push_back(
        {{"group", t.group}, {"name", t.name}, {"unit", t.unit}, {"values", packed(t.values)}});
  for (const ViewField& f : e.fields)
    fields.push_back({{"at", packed(f.at)}, {"values", packed(f.values)}});
  Json pictures = Json::array();
  for (const ViewShown& shown : e.pictures) {
    Json files = Json::array();
    for (const std::string& file : shown.files)
      files.push_back(base64(reinterpret_cast<const unsigned char*>(file.data()), file.size()));
    pictures.push_back({{"at", packed(shown.at)}, {"jpeg", std::move(files)}});
  }
  return {{"label", e.label},
          {"shapes", e.shapes},
          {"rows", packed(std::vector<std::int32_t>(e.rows.begin(), e.rows.end()))},
          {"time", packed(e.time)},
          {"poses", packed(e.poses)},
          {"end_effectors", packed(e.end_effectors)},
          {"traces", std::move(traces)},
          {"fields", std::move(fields)},
          {"pictures", std::move(pictures)}};
}

/// Puts `text` in place of the first `mark`.
void put(std::string& page, std::string_view mark, std::string_view text) {
  page.replace(page.find(mark), mark.size(), text);
}

}  // namespace

std::string view_json(const ViewData& data) {
  Json page{{"format", "tangere view"}, {"title", data.title}, {"source", data.source},
            {"kind", data.kind},        {"notes", data.notes}, {"stride", data.stride}};
  page["ground"] = Json();
  if (data.scene.ground)
    page["ground"] = {{"position", data.scene.ground->position},
                      {"normal", data.scene.ground->normal}};
  page["shapes"] = Json::array();
  for (const auto& links : data.shapes) page["shapes"].push_back(bodies_of(links));
  page["sensors"] = Json::array();
  for (const ViewSensor& sensor : data.sensors) page["sensors"].push_back(sensor_of(sensor));
  page["pictures"] = Json::array();
  for (const ViewPicture& picture : data.pictures)
    page["pictures"].push_back(
        {{"name", picture.name}, {"rows", picture.rows}, {"cols", picture.cols}});
  page["end_effectors"] = Json::array();
  for (const EndEffectorDescription& end : data.scene.end_effectors)
    page["end_effectors"].push_back(
        {{"name", end.name}, {"radius", end.radius}, {"rgba", end.rgba}});
  page["episodes"] = Json::array();
  for (const ViewEpisode& episode : data.episodes) page["episodes"].push_back(episode_of(episode));
  // Names come from files: bytes that are no UTF-8 are replaced, characters that the page should
  // not obey are spelt out, and no name ends the block.
  const std::string text =
      printable(page.dump(-1, ' ', false, Json::error_handler_t::replace), "\\\\u");
  std::string safe;
  safe.reserve(text.size());
  for (const char c : text) {
    if (c == '/' && !safe.empty() && safe.back() == '<') safe += '\\';
    safe += c;
  }
  // "<!--" would open a comment in which "</script>" does not end the block.
  for (std::size_t at = safe.find("<!--"); at != std::string::npos; at = safe.find("<!--", at + 1))
    safe.replace(at, 1, "\\u003c");
  return safe;
}

std::string render_view_page(const ViewData& data) {
  std::string page(page_file("page.html"));
  put(page, "/*style*/", page_file("page.css"));
  put(page, "/*program*/", page_file("program"));
  put(page, "/*data*/", view_json(data));
  return page;
}

}  // namespace tangere
