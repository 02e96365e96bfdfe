// SPDX-License-Identifier: Apache-2.0
// A file of JSON of which single values are read. Whatever is wrong with it is an IoError that
// names the file and the key.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace tangere {

class JsonFile {
 public:
  /// Throws IoError unless the file is there and an object of JSON.
  explicit JsonFile(const std::string& path);
  ~JsonFile();
  JsonFile(JsonFile&&) noexcept;
  JsonFile& operator=(JsonFile&&) = delete;
  JsonFile(const JsonFile&) = delete;

  /// Keys lead from object to object. has() is false where one of them is missing.
  using Keys = std::vector<std::string>;
  [[nodiscard]] bool has(const Keys& keys) const;
  [[nodiscard]] std::string text(const Keys& keys) const;
  [[nodiscard]] double number(const Keys& keys) const;
  /// A whole number from 0 to 2⁵³.
  [[nodiscard]] std::int64_t count(const Keys& keys) const;
  [[nodiscard]] std::vector<std::uint64_t> counts(const Keys& keys) const;
  [[nodiscard]] std::vector<std::string> texts(const Keys& keys) const;
  /// Of a list of objects the counts under `key` of each.
  [[nodiscard]] std::vector<std::int64_t> counts_of_list(const Keys& keys,
                                                         const std::string& key) const;
  /// Keys of an object, in the file's order.
  [[nodiscard]] std::vector<std::string> keys_of(const Keys& keys) const;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  struct Root;
  std::string path_;
  std::unique_ptr<Root> root_;
};

}  // namespace tangere
