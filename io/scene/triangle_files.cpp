// SPDX-License-Identifier: Apache-2.0
// Both formats exist in text and in bytes. The bytes of an STL file are known by its size, those of
// a PLY file by its header.
#include "io/scene/triangle_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "engine/base/error.hpp"
#include "io/files/text_file.hpp"
#include "io/files/word_reader.hpp"
#include "io/scene/polygons.hpp"

namespace tangere {
namespace {

constexpr std::size_t kLargestSurface = std::size_t{256} << 20;
constexpr double kFarthest = 1e6;  // as in lists of points
constexpr std::size_t kMostHeaderLines = 1000;
constexpr std::size_t kStlHeader = 80, kStlTriangle = 50;

/// Returns the bytes at `at` as a number, of which the lowest byte comes first unless `big`.
template <class T>
T number_at(std::string_view bytes, std::size_t at, bool big = false) {
  std::array<char, sizeof(T)> raw{};
  std::memcpy(raw.data(), bytes.data() + at, sizeof(T));
  if (big != (std::endian::native == std::endian::big)) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<T>(raw);
}

bool is_stl_in_bytes(std::string_view bytes) {
  return bytes.size() >= kStlHeader + 4 &&
         bytes.size() ==
             kStlHeader + 4 +
                 kStlTriangle * std::size_t{number_at<std::uint32_t>(bytes, kStlHeader)};
}

void add_corner(RawMesh& mesh, const Vector3& at) {
  const int next = static_cast<int>(mesh.positions.size());
  if (next % 3 == 0) mesh.triangles.push_back({next, next + 1, next + 2});
  mesh.positions.push_back(at);
}

/// A triangle has a normal, three corners and two bytes that mean nothing.
RawMesh stl_in_bytes(std::string_view bytes, const std::string& path) {
  RawMesh mesh;
  for (std::size_t at = kStlHeader + 4; at < bytes.size(); at += kStlTriangle)
    for (std::size_t corner = 1; corner <= 3; ++corner) {
      Vector3 p{};
      for (std::size_t c = 0; c < 3; ++c) {
        p[c] = double{number_at<float>(bytes, at + 12 * corner + 4 * c)};
        if (!(std::abs(p[c]) <= kFarthest))
          throw InputError(fmt::format("{}: triangle {} has the number {}; expected at most {:g}",
                                       path, (at - kStlHeader - 4) / kStlTriangle, p[c],
                                       kFarthest));
      }
      add_corner(mesh, p);
    }
  return mesh;
}

/// Returns the word in small letters, because some programs write capitals.
std::string small(std::string_view word) {
  std::string out(word.substr(0, 40));
  for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

RawMesh stl_in_text(const std::string& path) {
  // Some programs write `end solid`, `end facet`, `end loop`.
  static const std::vector<std::string> kSkipped = {"solid", "facet", "endfacet", "endsolid"};
  WordReader file(path);
  RawMesh mesh;
  while (file.next()) {
    const std::vector<std::string_view>& words = file.words;
    const std::string word = small(words[0]);
    if (word == "vertex") {
      if (words.size() != 4)
        file.fail(fmt::format("a vertex of {} numbers; expected x y z", words.size() - 1));
      add_corner(mesh, {file.position(1), file.position(2), file.position(3)});
    } else if (word == "outer" || word == "endloop" || word == "end") {
      if (mesh.positions.size() % 3 != 0)
        file.fail(fmt::format("a facet of {} vertices too few or too many; expected three",
                              mesh.positions.size() % 3));
    } else if (std::find(kSkipped.begin(), kSkipped.end(), word) == kSkipped.end()) {
      file.fail(fmt::format("'{}'; expected vertex or another element of an STL file",
                            words[0].substr(0, 40)));
    }
  }
  if (mesh.positions.size() % 3 != 0)
    file.fail("the file ends within a facet; expected three vertices");
  return mesh;
}

/// Whether the first word is `solid`, behind a byte order mark and blanks.
bool is_stl_in_text(std::string_view bytes) {
  if (bytes.starts_with(kByteOrderMark)) bytes.remove_prefix(kByteOrderMark.size());
  bytes.remove_prefix(std::min(bytes.find_first_not_of(" \t\r\n"), bytes.size()));
  return small(bytes.substr(0, 5)) == "solid";
}

// --- PLY ---

enum class PlyFormat { text, little, big };
enum class PlyType { i8, u8, i16, u16, i32, u32, f32, f64 };

struct PlyProperty {
  std::string name;
  PlyType type;
  bool list = false;
  PlyType count = PlyType::u8;
};
struct PlyElement {
  std::string name;
  long count = 0;
  std::vector<PlyProperty> properties;

  [[nodiscard]] int find(std::initializer_list<const char*> names) const {
    for (std::size_t k = 0; k < properties.size(); ++k)
      for (const char* requested : names)
        if (properties[k].name == requested) return static_cast<int>(k);
    return -1;
  }
};

/// A PLY file from its start on.
class PlyFile {
 public:
  explicit PlyFile(const std::string& path)
      : path_(path), bytes_(read_text_file(path, kLargestSurface, "a surface")) {}

  std::vector<PlyElement> read_header();
  /// Returns the next number of the body.
  double take(PlyType type);
  [[noreturn]] void fail(const std::string& message) const { throw InputError(place() + message); }
  /// "file:line: ", or "file: byte n: " where it is not text.
  [[nodiscard]] std::string place() const {
    if (format_ != PlyFormat::text) return fmt::format("{}: byte {}: ", path_, at_);
    const auto end = bytes_.begin() + static_cast<std::ptrdiff_t>(std::min(at_, bytes_.size()));
    return fmt::format("{}:{}: ", path_, 1 + std::count(bytes_.begin(), end, '\n'));
  }
  /// Where the next number is read, and a way back there for messages.
  [[nodiscard]] std::size_t at() const { return at_; }
  void go_to(std::size_t at) { at_ = at; }
  /// Of the bytes that are left.
  [[nodiscard]] double most_numbers() const {
    return static_cast<double>(bytes_.size() - std::min(at_, bytes_.size()));
  }

 private:
  std::vector<std::string> header_line();
  [[nodiscard]] PlyType type_named(const std::string& name) const;
  template <class T>
  double binary() {
    if (bytes_.size() - at_ < sizeof(T)) fail("the file ends within its elements");
    const T x = number_at<T>(bytes_, at_, format_ == PlyFormat::big);
    at_ += sizeof(T);
    return static_cast<double>(x);
  }

  std::string path_, bytes_;
  std::size_t at_ = 0;
  PlyFormat format_ = PlyFormat::text;  // that of the header; read_header() sets that of the body
};

/// Returns the words of the next line and moves behind it.
std::vector<std::string> PlyFile::header_line() {
  const std::size_t end = bytes_.find('\n', at_);
  if (end == std::string::npos) fail("no 'end_header'; expected the header of a PLY file");
  std::vector<std::string> words(1);
  for (; at_ < end; ++at_) {
    const char c = bytes_[at_];
    if (c != ' ' && c != '\t' && c != '\r') {
      words.back() += c;
    } else if (!words.back().empty()) {
      words.emplace_back();
    }
  }
  if (words.size() > 1 && words.back().empty()) words.pop_back();
  return words;
}

PlyType PlyFile::type_named(const std::string& name) const {
  static const std::vector<std::array<const char*, 2>> kNames = {
      {"char", "int8"}, {"uchar", "uint8"}, {"short", "int16"},   {"ushort", "uint16"},
      {"int", "int32"}, {"uint", "uint32"}, {"float", "float32"}, {"double", "float64"}};
  for (std::size_t k = 0; k < kNames.size(); ++k)
    if (name == kNames[k][0] || name == kNames[k][1]) return static_cast<PlyType>(k);
  fail("type '" + name.substr(0, 40) + "'; expected a type of PLY, such as float or int");
}

std::vector<PlyElement> PlyFile::read_header() {
  static const std::vector<std::string> kFormats = {"ascii", "binary_little_endian",
                                                    "binary_big_endian"};
  if (bytes_.starts_with(kByteOrderMark)) at_ = kByteOrderMark.size();
  if (header_line()[0] != "ply") fail("expected 'ply', the first line of a PLY file");
  PlyFormat body = PlyFormat::text;
  std::vector<PlyElement> elements;
  for (std::size_t line = 0;; ++line) {
    if (line > kMostHeaderLines)
      fail(fmt::format("a header of more than {} lines", kMostHeaderLines));
    ++at_;  // the end of the line before
    const std::vector<std::string> words = header_line();
    const std::string& what = words[0];
    if (what == "end_header") break;
    if (what == "comment" || what == "obj_info" || what.empty()) continue;
    if (what == "format" && words.size() == 3) {
      const auto known = std::find(kFormats.begin(), kFormats.end(), words[1]);
      if (known == kFormats.end())
        fail("format '" + words[1].substr(0, 40) + "'; expected " + kFormats[0] + ", " +
             kFormats[1] + " or " + kFormats[2]);
      body = static_cast<PlyFormat>(known - kFormats.begin());
    } else if (what == "element" && words.size() == 3) {
      long count = -1;
      const char* const end = words[2].data() + words[2].size();
      if (std::from_chars(words[2].data(), end, count).ptr != end || count < 0)
        fail("'" + words[2].substr(0, 40) + "'; expected a number of elements");
      elements.push_back({words[1], count, {}});
    } else if (what == "property" && words.size() == 3 && !elements.empty()) {
      elements.back().properties.push_back({words[2], type_named(words[1])});
    } else if (what == "property" && words.size() == 5 && words[1] == "list" && !elements.empty()) {
      elements.back().properties.push_back(
          {words[4], type_named(words[3]), true, type_named(words[2])});
    } else {
      fail("'" + what.substr(0, 40) + "'; expected format, element, property or end_header");
    }
  }
  ++at_;
  format_ = body;
  return elements;
}

double PlyFile::take(PlyType type) {
  if (format_ == PlyFormat::text) {
    at_ = std::min(bytes_.find_first_not_of(" \t\r\n", at_), bytes_.size());
    if (at_ == bytes_.size()) fail("the file ends within its elements");
    const std::size_t end = std::min(bytes_.find_first_of(" \t\r\n", at_), bytes_.size());
    double x = NAN;
    const auto read = std::from_chars(bytes_.data() + at_, bytes_.data() + end, x);
    if (read.ec != std::errc() || read.ptr != bytes_.data() + end)
      fail("'" + bytes_.substr(at_, std::min<std::size_t>(end - at_, 40)) + "'; expected a number");
    at_ = end;
    return x;
  }
  switch (type) {
    case PlyType::i8: return binary<std::int8_t>();
    case PlyType::u8: return binary<std::uint8_t>();
    case PlyType::i16: return binary<std::int16_t>();
    case PlyType::u16: return binary<std::uint16_t>();
    case PlyType::i32: return binary<std::int32_t>();
    case PlyType::u32: return binary<std::uint32_t>();
    case PlyType::f32: return binary<float>();
    case PlyType::f64: break;
  }
  return binary<double>();
}

/// Returns the numbers of each property of the next element of a kind.
void take_element(PlyFile& file, const PlyElement& kind, std::vector<std::vector<double>>& out) {
  out.resize(kind.properties.size());
  for (std::size_t k = 0; k < kind.properties.size(); ++k) {
    const PlyProperty& p = kind.properties[k];
    const double count = p.list ? file.take(p.count) : 1;
    if (!(count >= 0 && count <= file.most_numbers()))
      file.fail(
          fmt::format("a list of {} numbers; expected 0 to the {} that the rest of the file "
                      "can hold",
                      count, file.most_numbers()));
    out[k].clear();
    for (double i = 0; i < count; ++i) out[k].push_back(file.take(p.type));
  }
}

/// A list of vertices of a face or of strips of triangles, and where it ends in the file.
struct VertexList {
  std::vector<double> vertices;
  std::size_t end;
  bool strips;
};

/// Adds the triangles of a strip: each vertex after the second makes one with the two before it,
/// every other one turned round. A strip ends at -1.
void add_strips(const std::vector<int>& vertices, RawMesh& mesh) {
  std::size_t first = 0;
  for (std::size_t k = 0; k < vertices.size(); ++k) {
    if (vertices[k] < 0) first = k + 1;
    if (vertices[k] < 0 || k < first + 2) continue;
    const bool turned = (k - first) % 2 == 1;
    mesh.triangles.push_back(
        {vertices[k - (turned ? 1 : 2)], vertices[k - (turned ? 2 : 1)], vertices[k]});
  }
}

/// Adds the triangles of a list, after all vertices are known.
void add_list(PlyFile& file, const VertexList& list, RawMesh& mesh) {
  file.go_to(list.end);
  const auto all = static_cast<double>(mesh.positions.size());
  std::vector<int> vertices;
  for (const double v : list.vertices) {
    const bool end_of_strip = list.strips && v == -1;
    if (!end_of_strip && !(v >= 0 && v < all && v == std::floor(v)))
      file.fail(fmt::format("vertex {}; expected one of 0 to {}", v, all - 1));
    vertices.push_back(static_cast<int>(v));
  }
  if (list.strips) return add_strips(vertices, mesh);
  const std::string fault = cut_polygon(mesh.positions, vertices, mesh.triangles);
  if (!fault.empty() && mesh.fault.empty())
    mesh.fault = fmt::format("{}a face of {} corners has {}; expected a polygon", file.place(),
                             vertices.size(), fault);
}

}  // namespace

RawMesh read_stl(const std::string& path) {
  const std::string bytes = read_text_file(path, kLargestSurface, "a surface");
  if (is_stl_in_bytes(bytes)) return stl_in_bytes(bytes, path);
  if (!is_stl_in_text(bytes))
    throw InputError(path +
                     ": neither starts with 'solid' nor has as many bytes as its number of "
                     "triangles takes; expected an STL file");
  return stl_in_text(path);
}

RawMesh read_ply(const std::string& path) {
  PlyFile file(path);
  RawMesh mesh;
  std::vector<VertexList> lists;  // faces may come before vertices
  std::vector<std::vector<double>> numbers;
  for (const PlyElement& kind : file.read_header()) {
    const int x = kind.find({"x"}), y = kind.find({"y"}), z = kind.find({"z"}),
              corners = kind.find({"vertex_indices", "vertex_index"});
    const bool vertices = kind.name == "vertex", strips = kind.name == "tristrips",
               faces = kind.name == "face" || strips;
    if (vertices && (x < 0 || y < 0 || z < 0)) file.fail("a vertex without x, y or z");
    if (faces && corners < 0)
      file.fail("element " + kind.name + " without a list of vertex_indices");
    if (kind.properties.empty()) continue;
    for (long k = 0; k < kind.count; ++k) {
      take_element(file, kind, numbers);
      if (faces) {
        const std::vector<double>& list = numbers[std::size_t(corners)];
        if (!strips && list.size() < 3)
          file.fail(fmt::format("a face of {} vertices; expected three or more", list.size()));
        lists.push_back({list, file.at(), strips});
      }
      if (!vertices) continue;
      Vector3 at{};
      for (std::size_t c = 0; c < 3; ++c) {
        const std::vector<double>& n = numbers[std::size_t(std::array{x, y, z}[c])];
        at[c] = n.size() == 1 ? n[0] : NAN;
        if (!(std::abs(at[c]) <= kFarthest))
          file.fail(fmt::format("vertex {} has {}; expected a number of at most {:g}", k, at[c],
                                kFarthest));
      }
      mesh.positions.push_back(at);
    }
  }
  for (const VertexList& list : lists) add_list(file, list, mesh);
  return mesh;
}

}  // namespace tangere
