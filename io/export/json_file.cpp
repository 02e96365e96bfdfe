// SPDX-License-Identifier: Apache-2.0
// Keeps the library for JSON out of the headers.
#include "io/export/json_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include "engine/base/error.hpp"
#include "io/files/text_file.hpp"

namespace tangere {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr std::size_t kLargestJson = std::size_t{1} << 30;
constexpr std::int64_t kLargestCount = std::int64_t{1} << 53;

std::int64_t whole_number(const OrderedJson& value) {
  if (!value.is_number_integer() && !value.is_number_unsigned()) return -1;
  if (value.is_number_unsigned() && value.get<std::uint64_t>() > std::uint64_t{kLargestCount})
    return -1;
  const auto number = value.get<std::int64_t>();
  return number > kLargestCount ? -1 : number;
}

[[noreturn]] void fail(const std::string& path, const JsonFile::Keys& keys, const char* expected) {
  throw IoError(fmt::format("'{}' is damaged: '{}' is missing or is no {}", path,
                            fmt::join(keys, "/"), expected));
}

const OrderedJson* find_value(const OrderedJson& root, const JsonFile::Keys& keys) {
  const OrderedJson* value = &root;
  for (const std::string& key : keys) {
    if (!value->is_object()) return nullptr;
    const auto next = value->find(key);
    if (next == value->end()) return nullptr;
    value = &*next;
  }
  return value;
}

const OrderedJson& checked(const std::string& path, const OrderedJson& root,
                           const JsonFile::Keys& keys) {
  const OrderedJson* const value = find_value(root, keys);
  if (value == nullptr) fail(path, keys, "value");
  return *value;
}

}  // namespace

struct JsonFile::Root {
  OrderedJson json;
};

JsonFile::JsonFile(const std::string& path) : path_(path), root_(std::make_unique<Root>()) {
  const std::string text = read_text_file(path, kLargestJson, "a file of JSON");
  root_->json = OrderedJson::parse(text, nullptr, false);
  if (!root_->json.is_object())
    throw IoError(fmt::format("'{}' is damaged: expected an object of JSON", path));
}
JsonFile::~JsonFile() = default;
JsonFile::JsonFile(JsonFile&&) noexcept = default;

bool JsonFile::has(const Keys& keys) const { return find_value(root_->json, keys) != nullptr; }

std::string JsonFile::text(const Keys& keys) const {
  const OrderedJson& value = checked(path_, root_->json, keys);
  if (!value.is_string()) fail(path_, keys, "text");
  return value.get<std::string>();
}

double JsonFile::number(const Keys& keys) const {
  const OrderedJson& value = checked(path_, root_->json, keys);
  if (!value.is_number()) fail(path_, keys, "number");
  return value.get<double>();
}

std::int64_t JsonFile::count(const Keys& keys) const {
  const std::int64_t number = whole_number(checked(path_, root_->json, keys));
  if (number < 0) fail(path_, keys, "whole number from 0 on");
  return number;
}

std::vector<std::uint64_t> JsonFile::counts(const Keys& keys) const {
  const OrderedJson& value = checked(path_, root_->json, keys);
  if (!value.is_array()) fail(path_, keys, "list");
  std::vector<std::uint64_t> list;
  for (const OrderedJson& one : value) {
    const std::int64_t number = whole_number(one);
    if (number < 0) fail(path_, keys, "list of whole numbers");
    list.push_back(static_cast<std::uint64_t>(number));
  }
  return list;
}

std::vector<std::string> JsonFile::texts(const Keys& keys) const {
  const OrderedJson& value = checked(path_, root_->json, keys);
  if (!value.is_array()) fail(path_, keys, "list");
  std::vector<std::string> list;
  for (const OrderedJson& one : value) {
    if (!one.is_string()) fail(path_, keys, "list of texts");
    list.push_back(one.get<std::string>());
  }
  return list;
}

std::vector<std::int64_t> JsonFile::counts_of_list(const Keys& keys, const std::string& key) const {
  const OrderedJson& value = checked(path_, root_->json, keys);
  if (!value.is_array()) fail(path_, keys, "list");
  std::vector<std::int64_t> list;
  for (const OrderedJson& one : value) {
    const auto found = one.is_object() ? one.find(key) : one.end();
    const std::int64_t number = one.is_object() && found != one.end() ? whole_number(*found) : -1;
    if (number < 0) fail(path_, keys, "list of objects with counts");
    list.push_back(number);
  }
  return list;
}

std::vector<std::string> JsonFile::keys_of(const Keys& keys) const {
  const OrderedJson& value = checked(path_, root_->json, keys);
  if (!value.is_object()) fail(path_, keys, "object");
  std::vector<std::string> list;
  for (const auto& [key, one] : value.items()) list.push_back(key);
  return list;
}

}  // namespace tangere
