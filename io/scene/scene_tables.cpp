// SPDX-License-Identifier: Apache-2.0
// Computes FNV-1a over the bytes of numbers, with lengths between them.
#include "io/scene/scene_tables.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <span>
#include <variant>
#include <vector>

namespace tangere {
namespace {

class Checksum {
 public:
  /// Adds numbers of one kind. An empty list changes the sum, too, but alone does not count as a
  /// table.
  template <class T>
  void add(std::span<const T> numbers) {
    const std::uint64_t count = numbers.size();
    if (count > 0) any_ = true;
    mix({reinterpret_cast<const unsigned char*>(&count), sizeof count});
    mix({reinterpret_cast<const unsigned char*>(numbers.data()), numbers.size_bytes()});
  }
  [[nodiscard]] std::string text() const {
    return any_ ? fmt::format("of checksum {:016x}", hash_) : "none";
  }

 private:
  void mix(std::span<const unsigned char> bytes) {
    for (const unsigned char byte : bytes) hash_ = (hash_ ^ byte) * 0x100000001B3ULL;
  }
  std::uint64_t hash_ = 0xCBF29CE484222325ULL;
  bool any_ = false;
};

}  // namespace

std::string tables_of(const Scene& scene) {
  Checksum sum;
  for (const LinkDescription& link : scene.links) {
    if (const auto* mesh = std::get_if<MeshShape>(&link.body.shape)) {
      sum.add<double>(mesh->vertices);
      sum.add<std::array<int, 3>>(mesh->triangles);
    } else if (const auto* abstract = std::get_if<AbstractShape>(&link.body.shape)) {
      sum.add<double>(abstract->contact_points);
    }
  }
  for (const TactileDescription& sensor : scene.sensors)
    for (const TactilePoint& point : sensor.points) {
      for (const Vector3* v : {&point.position, &point.normal, &point.axis0, &point.axis1}) {
        const std::array<double, 3> numbers{(*v)[0], (*v)[1], (*v)[2]};
        sum.add<double>(numbers);
      }
      sum.add<int>(point.pixel);
      sum.add<double>(point.factors);
    }
  for (const TactileDescription& sensor : scene.sensors) {
    if (sensor.picture) sum.add<std::uint64_t>(std::array{sensor.picture->gel->checksum});
    if (sensor.channels) sum.add<std::uint64_t>(std::array{sensor.channels->map->checksum});
  }
  if (scene.control)
    if (const auto* table = std::get_if<CsvControl>(&*scene.control))
      for (const std::vector<double>& row : table->rows) sum.add<double>(row);
  return sum.text();
}

}  // namespace tangere
