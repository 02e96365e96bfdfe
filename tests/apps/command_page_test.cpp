// SPDX-License-Identifier: Apache-2.0
// The lists of options in docs/command.md are made from the help of each subcommand. With
// TANGERE_WRITE_DOCS=1 in the environment, this test writes them; else it compares.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>
#include <regex>
#include <sstream>

#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using testing::HasSubstr;

constexpr const char* kPage = TANGERE_SOURCE_DIR "/docs/command.md";

/// Options with one text in so many subcommands are listed once.
constexpr std::size_t kShared = 3;

struct Option {
  std::string name, description;  ///< "--row N REQUIRED", "Row of ..."
  auto operator<=>(const Option&) const = default;
};

/// What stands below one title of a help text.
struct Group {
  std::string title;
  std::vector<Option> options;
};

/// Groups of a help text: titles end in a colon; an option has two spaces before its name, and two
/// or more, or a new line, before its description.
std::vector<Group> groups_of(const std::string& help) {
  std::vector<Group> groups;
  std::istringstream lines(help.substr(0, help.find("\nExample:\n")));
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("  ")) {
      if (line.ends_with(':')) groups.push_back({line.substr(0, line.size() - 1), {}});
      continue;
    }
    std::vector<Option>& options = groups.back().options;
    std::size_t text = line.find_first_not_of(' ');
    if (text == 2) {
      const std::size_t end = line.find("  ", text);
      options.push_back({line.substr(text, end - text), ""});
      text = line.find_first_not_of(' ', end);
    }
    if (text == std::string::npos) continue;
    std::string& description = options.back().description;
    description += (description.empty() ? "" : " ") + line.substr(text);
  }
  return groups;
}

/// The text with options, elements of scenes and quoted commands as code.
std::string with_code(const std::string& text) {
  static const std::regex code("<[a-z]+>|--[a-z-]+"), command("'(tangere [a-z]+)'");
  return std::regex_replace(std::regex_replace(text, code, "`$&`"), command, "`$1`");
}

/// Returns "`-o`, `--output`" for "-o,--output F.h5 REQUIRED".
std::string names(const Option& option) {
  const std::string flags = option.name.substr(0, option.name.find(' '));
  return "`" + std::regex_replace(flags, std::regex(","), "`, `") + "`";
}

/// The bullet without line breaks: names as code, the value, the description, what else holds.
std::string bullet(const Option& option) {
  std::istringstream words(option.name);
  std::string word, text = "- " + names(option), rules;
  words >> word;
  while (words >> word) {
    if (word == "REQUIRED")
      rules += " Required.";
    else if (word == "...")
      rules += " May be given several times.";
    else if (word == "Excludes:" && words >> word)
      rules += " Not with `" + word + "`.";
    else
      text += " " + word;
  }
  std::smatch parts;
  static const std::regex with_default(R"(^(.*?)\.?(?: \[default: (.*)\])?$)");
  EXPECT_TRUE(std::regex_match(option.description, parts, with_default)) << option.description;
  if (parts[2].matched) rules += " Default: " + with_code(parts.str(2)) + ".";
  return text + ": " + with_code(parts.str(1)) + "." + rules;
}

/// The bullet in lines of at most 100 columns.
std::string wrapped(const std::string& text) {
  std::string lines;
  std::size_t column = 0;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    const auto width = static_cast<std::size_t>(
        std::count_if(word.begin(), word.end(), [](char c) { return (c & 0xC0) != 0x80; }));
    const bool fits = column + 1 + width <= 100;
    if (column > 0) lines += fits ? " " : "\n  ";
    column = (column == 0 ? 0 : fits ? column + 1 : 2) + width;
    lines += word;
  }
  return lines + "\n";
}

/// How many subcommands have an option with one text.
using Uses = std::map<Option, std::size_t>;

/// Lists of the options of one subcommand, a list for each group. Of the shared ones it has the
/// names, but for those of all `subcommands`.
std::string lists(const std::vector<Group>& groups, const Uses& uses, std::size_t subcommands) {
  std::string text, also, titled;
  for (const Group& group : groups) {
    std::string bullets;
    for (const Option& option : group.options) {
      if (uses.at(option) < kShared)
        bullets += wrapped(bullet(option));
      else if (uses.at(option) < subcommands)
        also += (also.empty() ? "" : ", ") + names(option);
    }
    if (group.title == "Positionals" || group.title == "Options")
      text += bullets;
    else
      titled += "\n" + group.title + ":\n\n" + bullets;
  }
  if (!also.empty()) text += wrapped("- " + also + ": [as above](#what-all-subcommands-share).");
  return text + titled;
}

/// Replaces what stands between <!-- options NAME --> and <!-- end -->.
void replace(std::string& page, const std::string& name, const std::string& text) {
  const std::string begin = "<!-- options " + name + " -->\n";
  ASSERT_THAT(page, HasSubstr(begin));
  const std::size_t first = page.find(begin) + begin.size();
  page.replace(first, page.find("<!-- end -->", first) - first, text);
}

TEST(CommandPage, HasTheOptionsOfTheProgram) {
  const Folder folder;
  const Words subcommands = apps::subcommands();
  std::vector<std::vector<Group>> all;
  std::vector<Option> shared;
  Uses uses;
  for (const std::string& name : subcommands) {
    all.push_back(groups_of(run(folder, {name, "--help"}).out));
    for (const Group& group : all.back())
      for (const Option& option : group.options)
        if (++uses[option] == kShared) shared.push_back(option);
  }
  std::stable_partition(shared.begin(), shared.end(),
                        [&](const Option& option) { return uses[option] == subcommands.size(); });
  std::string page = file_bytes(kPage), list;
  for (const Option& option : shared) list += wrapped(bullet(option));
  replace(page, "of all", list);
  for (std::size_t k = 0; k < all.size(); ++k)
    replace(page, subcommands[k], lists(all[k], uses, subcommands.size()));
  if (std::getenv("TANGERE_WRITE_DOCS") != nullptr) std::ofstream(kPage) << page;
  EXPECT_EQ(file_bytes(kPage), page)
      << "TANGERE_WRITE_DOCS=1 apps_test --gtest_filter='CommandPage.*' makes it";
}

}  // namespace
}  // namespace tangere::apps
