// SPDX-License-Identifier: Apache-2.0
// Layouts of sensors as files of their own: the root <sensor unit="m-kg"> with <tactile> inside.
#pragma once

#include <tinyxml2.h>

#include <memory>
#include <span>
#include <string>

#include "io/scene/scene_node.hpp"

namespace tangere {

/// Parses the text of a layout into `document` and returns its root. The file's name is that of
/// `context`, which receives warnings. Throws InputError for another root and another unit.
const tinyxml2::XMLElement& parse_layout(tinyxml2::XMLDocument& document, const std::string& text,
                                         SceneContext& context);

/// Text of the elements inside a sensor, such as <imperfections>.
std::string parts_text(const tinyxml2::XMLElement& sensor);

/// A layout of one sensor whose attributes can be changed. Comments and all else stay as they are.
class LayoutFile {
 public:
  /// `name`: for messages. Throws InputError for text that is no layout of one sensor.
  LayoutFile(const std::string& text, const std::string& name);
  ~LayoutFile();
  LayoutFile(const LayoutFile& other);
  LayoutFile(LayoutFile&&) noexcept;
  LayoutFile& operator=(LayoutFile&&) noexcept;

  [[nodiscard]] std::string name() const;  ///< of the sensor; "skin" without one
  [[nodiscard]] bool has(const std::string& attribute) const;
  /// Text of an attribute, of the sensor or of its <part>; "" without one.
  [[nodiscard]] std::string get(const std::string& attribute) const;
  [[nodiscard]] std::string get(const std::string& part, const std::string& attribute) const;
  void set(const std::string& attribute, const std::string& value);
  void remove(const std::string& attribute);

  /// Line of the sensor, for messages.
  [[nodiscard]] Source source() const;
  /// The <tactile> as one line of a scene, on a body, without the attributes and parts that are
  /// named.
  [[nodiscard]] std::string tactile_text(const std::string& body,
                                         std::span<const std::string> without) const;
  /// Sets an attribute of a <part> of the sensor, which is added if it is not there.
  void set(const std::string& part, const std::string& attribute, const std::string& value);
  /// Adds a comment before the sensor.
  void add_comment(const std::string& text);
  /// The file.
  [[nodiscard]] std::string text() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
