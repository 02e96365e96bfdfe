// SPDX-License-Identifier: Apache-2.0
// One XML element during reading: attributes as checked values, errors with file and line.
#pragma once

#include <tinyxml2.h>

#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/scene/scene.hpp"
#include "engine/scene/units.hpp"
#include "io/files/nearest_name.hpp"
#include "io/scene/included_texts.hpp"

namespace tangere {

struct IncludedFile;

/// What all elements of one file share.
struct SceneContext {
  std::string file;
  bool allow_unknown = false;
  /// Of text that a program made: where each of its lines comes from. Empty: from the file.
  std::span<const Source> origins = {};
  std::vector<std::string> warnings;
  /// A value from <default> and the number of its line.
  struct Default {
    std::string value;
    int line;
  };
  /// Values for attributes that an element leaves out: [element][attribute].
  std::map<std::string, std::map<std::string, Default>> defaults;

  double length = 1;  ///< factor to metres
  void use_centimetres_and_grams();
  /// Where files of <include> are searched that are not beside theirs; of the outermost context.
  std::vector<std::filesystem::path> folders = {};
  /// The file whose <include> names this one; nullptr for the file that the user names.
  SceneContext* includer = nullptr;
  std::string place = {};  ///< of the file beside the user's, which has ""
  /// Texts that take the place of included files, in the context of the user's file.
  IncludedTexts included_texts = {};
  /// Files that <include> has brought in, in the context of the user's file. Elements refer to
  /// them.
  std::vector<std::shared_ptr<IncludedFile>> included = {};
  /// The context of the file that the user names.
  [[nodiscard]] SceneContext& outermost() {
    return includer == nullptr ? *this : includer->outermost();
  }

  /// Where a line of the text comes from.
  [[nodiscard]] Source source(int line) const;
  /// Returns an area [m²] in the scene's own unit.
  [[nodiscard]] double area(double square_metres) const {
    return square_metres / (length * length);
  }
  /// Factor from the scene's units to SI.
  [[nodiscard]] double factor(Unit unit) const;
};

class SceneNode {
 public:
  /// `include`: of an element that an <include> brings in, this <include>, whose attributes take
  /// the place of the element's own; nullptr if it gives none.
  SceneNode(const tinyxml2::XMLElement& element, SceneContext& context,
            const tinyxml2::XMLElement* include = nullptr)
      : element_(&element), context_(&context), include_(include) {}

  [[nodiscard]] std::string name() const { return element_->Name(); }
  [[nodiscard]] Source source() const { return context_->source(element_->GetLineNum()); }
  [[nodiscard]] SceneContext& context() const { return *context_; }
  [[nodiscard]] const tinyxml2::XMLElement& element() const { return *element_; }
  [[noreturn]] void fail(const std::string& message) const;
  /// Fails because of an attribute's value. The message says if the value comes from <default>.
  [[noreturn]] void fail_at(const char* attribute, const std::string& message) const;
  [[noreturn]] void fail_count(const char* attribute, std::size_t found,
                               const std::string& expected) const;
  void warn(const std::string& message) const;

  /// Refuses attributes outside the three lists. Attributes in `used` are read. Those in `pictures`
  /// matter only to viewers and pass silently. Those in `unused` belong to other types of this
  /// element and give warnings.
  void check_attributes(const std::vector<std::string>& used,
                        const std::vector<std::string>& pictures = {},
                        const std::vector<std::string>& unused = {}) const;

  /// Returns the children in order. Names outside `known` are errors. Stray text gives a warning.
  /// The children of a file that an <include> names stand in its place (included_file.hpp).
  [[nodiscard]] std::vector<SceneNode> children(const std::vector<std::string>& known) const;

  [[nodiscard]] bool has(const char* attribute) const { return find(attribute) != nullptr; }
  /// Whether the element itself gives it, not <default>.
  [[nodiscard]] bool gives(const char* attribute) const { return find_own(attribute) != nullptr; }
  [[nodiscard]] std::string text(const char* attribute) const;  ///< required
  [[nodiscard]] std::string text(const char* attribute, const std::string& fallback) const;
  /// Returns the index of the value among `words`.
  [[nodiscard]] int choice(const char* attribute, const std::vector<std::string>& words,
                           std::optional<int> fallback = std::nullopt) const;
  [[nodiscard]] double number(const char* attribute,
                              std::optional<double> fallback = std::nullopt) const;
  [[nodiscard]] double positive(const char* attribute,
                                std::optional<double> fallback = std::nullopt) const;
  [[nodiscard]] double not_negative(const char* attribute,
                                    std::optional<double> fallback = std::nullopt) const;
  [[nodiscard]] int integer(const char* attribute, int lowest, int highest,
                            std::optional<int> fallback = std::nullopt) const;
  /// Returns as many integers as the fallback has, each from `lowest` to `highest`.
  [[nodiscard]] std::vector<int> integers(const char* attribute, const std::vector<int>& fallback,
                                          int lowest, int highest) const;
  /// Returns any number of finite numbers, or exactly `count` if it is positive.
  [[nodiscard]] std::vector<double> numbers(const char* attribute, std::size_t count = 0) const;
  [[nodiscard]] Vector3 vector(const char* attribute,
                               std::optional<Vector3> fallback = std::nullopt) const;
  [[nodiscard]] Vector3 direction(const char* attribute,
                                  std::optional<Vector3> fallback = std::nullopt) const;
  [[nodiscard]] Quaternion quaternion(const char* attribute) const;  ///< default: identity

 private:
  void add_children(const std::vector<std::string>& known, const tinyxml2::XMLElement* include,
                    std::vector<SceneNode>& out) const;
  [[nodiscard]] const char* find(const char* attribute) const;
  [[nodiscard]] const char* find_own(const char* attribute) const;
  [[nodiscard]] const SceneContext::Default* find_default(const char* attribute) const;

  const tinyxml2::XMLElement* element_;
  SceneContext* context_;
  const tinyxml2::XMLElement* include_;
};

}  // namespace tangere
