// SPDX-License-Identifier: Apache-2.0
// Reads braces: one that follows a list of parameters, in a namespace or a type, begins a function.
#include "tests/house/function_lines.hpp"

#include <algorithm>
#include <cctype>
#include <regex>

namespace tangere::house {
namespace {

constexpr int kMostLines = 90;

/// Replaces comments, texts, characters and lines of the preprocessor by spaces. Lines stay.
std::string code_of(const std::string& text) {
  std::string code = text;
  const auto blank = [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < std::min(to, code.size()); ++i)
      if (code[i] != '\n') code[i] = ' ';
    return std::min(to, code.size());
  };
  const auto after = [&](std::string_view end, std::size_t from) {
    const std::size_t at = text.find(end, from);
    return at == std::string::npos ? text.size() : at + end.size();
  };
  const auto quoted = [&](std::size_t from) {
    std::size_t i = from + 1;
    while (i < text.size() && text[i] != text[from]) i += text[i] == '\\' ? 2 : 1;
    return i + 1;
  };
  bool line_begins = true;
  for (std::size_t i = 0; i < text.size();) {
    const char c = text[i];
    const bool inside_word = i > 0 && (std::isalnum(static_cast<unsigned char>(text[i - 1])) != 0);
    if (c == '#' && line_begins) {
      std::size_t end = text.find('\n', i);
      while (end != std::string::npos && text[end - 1] == '\\') end = text.find('\n', end + 1);
      i = blank(i, end);
    } else if (text.compare(i, 2, "//") == 0) {
      i = blank(i, text.find('\n', i));
    } else if (text.compare(i, 2, "/*") == 0) {
      i = blank(i, after("*/", i));
    } else if (text.compare(i, 2, "R\"") == 0) {
      const std::size_t open = text.find('(', i);
      i = blank(i, after(")" + text.substr(i + 2, open - i - 2) + "\"", open));
    } else if (c == '"' || (c == '\'' && !inside_word)) {  // 1'000 has no characters
      i = blank(i, quoted(i));
    } else {
      line_begins = c == '\n' || (line_begins && c == ' ');
      ++i;
    }
  }
  return code;
}

struct Scope {
  bool holds_functions = false;  ///< a namespace or a type
  int function = 0;              ///< first line, if it is one
};

/// What the brace after `head`, which begins in line `line`, opens inside of `outer`. `before`: the
/// first line of the function that was closed last.
Scope opened_by(const std::string& head, int line, const Scope& outer, int before) {
  static const std::regex type(
      R"(^\s*(template\s*<[^{}]*>\s*)?(inline\s+)?(namespace|class|struct|union|enum|extern)\b)");
  if (!outer.holds_functions) return {};
  if (std::regex_search(head, type)) return {true};
  if (head.find(')') == std::string::npos) return {};
  // A constructor may set its members in braces before its own.
  const std::size_t first = head.find_first_not_of(" \n");
  return {false, head[first] == ',' ? before : line};
}

}  // namespace

std::vector<Violation> check_functions(const Tree& tree) {
  std::vector<Violation> found;
  for (const auto& [path, text] : tree) {
    const bool source = path.ends_with(".cpp") || path.ends_with(".hpp");
    if (!source || path.starts_with("tests/")) continue;
    const std::string code = code_of(text);
    std::vector<Scope> scopes{{true}};
    std::string head;
    int line = 1, head_line = 1, last = 1;
    for (const char c : code) {
      if (c == '{') {
        scopes.push_back(opened_by(head, head_line, scopes.back(), last));
      } else if (c == '}' && scopes.size() > 1) {
        if (const int first = scopes.back().function; first > 0) {
          last = first;
          if (const int lines = line - first + 1; lines > kMostLines)
            found.push_back({path, first,
                             "a function of " + std::to_string(lines) + " lines, at most " +
                                 std::to_string(kMostLines)});
        }
        scopes.pop_back();
      }
      if (c == '{' || c == '}' || c == ';') {
        head.clear();
      } else if (!head.empty() || (c != ' ' && c != '\n')) {
        if (head.empty()) head_line = line;
        head += c;
      }
      if (c == '\n') ++line;
    }
  }
  return found;
}

}  // namespace tangere::house
