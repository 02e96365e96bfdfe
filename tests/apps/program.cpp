// SPDX-License-Identifier: Apache-2.0
// Uses fork and exec, so that no shell interprets the arguments of a test.
#include "tests/apps/program.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include "tests/files.hpp"

namespace tangere::apps {
namespace fs = std::filesystem;
namespace {

fs::path new_folder() {
  std::string name = fs::temp_directory_path() / "tangere_test_XXXXXX";
  if (mkdtemp(name.data()) == nullptr)
    throw std::system_error(errno, std::generic_category(), "mkdtemp " + name);
  return name;
}

void redirect(const std::string& path, int descriptor) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NOCTTY, 0600);
  if (file < 0 || dup2(file, descriptor) < 0) _exit(126);
  close(file);
}

/// Runs in the child, between fork and exec.
[[noreturn]] void become_program(const std::string& folder, std::vector<std::string> words,
                                 std::vector<std::string> environment, const std::string& out,
                                 const std::string& err, const std::optional<Limit>& limit) {
  // A test runner in the background may ignore them, and the program would inherit that.
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
  if (chdir(folder.c_str()) != 0) _exit(126);
  redirect(out, STDOUT_FILENO);
  redirect(err, STDERR_FILENO);
  for (std::string& variable : environment) putenv(variable.data());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  if (limit) {
    rlimit limits{};
    getrlimit(limit->resource, &limits);
    limits.rlim_cur = limit->value;
    if (setrlimit(limit->resource, &limits) != 0) _exit(126);
  }
  execv(TANGERE_PROGRAM, argv.data());
  _exit(126);
}

pid_t start(const std::string& folder, const std::vector<std::string>& words,
            const std::vector<std::string>& environment, const std::string& out,
            const std::string& err, const std::optional<Limit>& limit) {
  const pid_t process = fork();
  if (process == 0) become_program(folder, words, environment, out, err, limit);
  if (process < 0) throw std::system_error(errno, std::generic_category(), "fork");
  return process;
}

}  // namespace

Folder::Folder() : root_(new_folder()) {}
Folder::~Folder() { fs::remove_all(root_); }

std::vector<std::string> Folder::files() const {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(root_)) names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  return names;
}

std::string Folder::write(const std::string& name, const std::string& text) const {
  std::ofstream file(root_ / name, std::ios::binary);
  if (!(file << text)) throw std::runtime_error("cannot write " + path(name));
  return path(name);
}

std::string Folder::read(const std::string& name) const { return file_bytes(root_ / name); }

Program::Program(const Folder& folder, const Words& arguments,
                 const std::vector<std::string>& environment, const Streams& streams,
                 const std::optional<Limit>& limit)
    : scratch_(new_folder()),
      process_(start(folder.path(), Words{"tangere"} + arguments, environment,
                     streams.out.empty() ? (scratch_ / "out").string() : streams.out,
                     streams.err.empty() ? (scratch_ / "err").string() : streams.err, limit)) {}

Program::~Program() {
  if (process_ > 0) {
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  fs::remove_all(scratch_);
}

void Program::send(int signal) const { kill(process_, signal); }

Outcome Program::wait() {
  int status = 0;
  while (waitpid(process_, &status, 0) < 0)
    if (errno != EINTR) throw std::system_error(errno, std::generic_category(), "waitpid");
  process_ = -1;
  Outcome outcome;
  if (WIFEXITED(status)) outcome.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) outcome.signal = WTERMSIG(status);
  if (fs::exists(scratch_ / "out")) outcome.out = file_bytes(scratch_ / "out");
  if (fs::exists(scratch_ / "err")) outcome.err = file_bytes(scratch_ / "err");
  return outcome;
}

Outcome run(const Folder& folder, const Words& arguments,
            const std::vector<std::string>& environment, const Streams& streams,
            const std::optional<Limit>& limit) {
  return Program(folder, arguments, environment, streams, limit).wait();
}

Words subcommands() {
  const std::string help = run(Folder(), {"--help"}).out;
  std::istringstream lines(help.substr(help.find("\nSubcommands:\n") + 14));
  Words names;
  for (std::string line; std::getline(lines, line) && line.starts_with("  ");)
    names.push_back(line.substr(2, line.find(' ', 2) - 2));
  return names;
}

const std::string& page_of(const std::string& subcommand) {
  static std::map<std::string, std::string> pages;
  if (!pages.contains(subcommand)) {
    const std::string page = file_bytes(TANGERE_SOURCE_DIR "/docs/command.md");
    const auto section = [&](const std::string& title) {
      const std::size_t from = page.find("\n## " + title + "\n");
      if (from == std::string::npos)
        throw std::runtime_error("docs/command.md has no section '" + title + "'");
      return page.substr(from, page.find("\n## ", from + 1) - from);
    };
    pages[subcommand] = section("What all subcommands share");
    if (!subcommand.empty()) pages[subcommand] += section(subcommand);
  }
  return pages[subcommand];
}

static std::vector<std::string> undocumented_keys(const nlohmann::json& object,
                                                  const std::string& page) {
  std::vector<std::string> missing;
  for (const auto& [key, value] : object.items()) {
    // The keys of this one are names of the scene's.
    const bool named = key == "effects" && value.is_object();
    if (!named && object.is_object() && page.find("`" + key + "`") == std::string::npos)
      missing.push_back(key);
    if (!value.is_structured()) continue;
    for (const nlohmann::json& part : named ? value : nlohmann::json::array({value}))
      for (std::string& deeper : undocumented_keys(part, page))
        missing.push_back(std::move(deeper));
  }
  return missing;
}

std::vector<std::string> undocumented_keys(const nlohmann::json& answer) {
  // Nothing is known of the subcommand where a program's options are wrong.
  const nlohmann::json& command = answer.at("command");
  return undocumented_keys(answer, page_of(command.is_null() ? "" : command.get<std::string>()));
}

nlohmann::json run_json(const Folder& folder, const Words& words, int exit_code) {
  const Outcome outcome = run(folder, words + Words{"--json"});
  const std::string what = testing::PrintToString(words);
  EXPECT_EQ(outcome.exit_code, exit_code) << what << ": " << outcome.err;
  nlohmann::json answer = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(answer.at("exit_code"), exit_code) << what;
  EXPECT_EQ(answer.at("command"), words.at(0)) << what;
  EXPECT_THAT(undocumented_keys(answer), testing::IsEmpty()) << what;
  return answer;
}

double peak_memory() {
  struct rusage usage {};
  getrusage(RUSAGE_CHILDREN, &usage);
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-union-access): the member's name stands for a union
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

std::string scene(const std::string& name) { return TANGERE_SOURCE_DIR "/scenes/" + name; }

}  // namespace tangere::apps
