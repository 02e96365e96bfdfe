// SPDX-License-Identifier: Apache-2.0
// One socket is the program's input and output. So a program that has ended causes an error of a
// call, not a signal, and one descriptor serves both directions.
#include "apps/policy_program.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstring>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "apps/console.hpp"
#include "engine/base/error.hpp"
#include "io/dataset/dataset_layout.hpp"
#include "kernels/numbers/block.hpp"

namespace tangere::apps {
namespace {

static_assert(std::endian::native == std::endian::little,
              "the protocol's numbers are little-endian");

constexpr const char* kProtocol = "tangere policy 1";
constexpr std::size_t kLongestLine = 4096;
constexpr int kStopPoll = 100;    // [ms]
constexpr double kTimeToEnd = 5;  // [s]

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Whether the shell has nothing to do but to start one program.
bool is_one_command(const std::string& command) {
  const std::string first = command.substr(0, command.find(' '));
  return command.front() != ' ' && first != "exec" && first != "exit" &&
         command.find_first_of(";&|<>()$`*?[]#~!{}\\\n") == std::string::npos &&
         first.find('=') == std::string::npos;
}

Json described(const TensorSpec& tensor) {
  return {{"name", tensor.name},
          {"shape", tensor.shape},
          {"unit", tensor.unit},
          {"scale", tensor.scale.empty() ? std::vector<double>{1} : tensor.scale}};
}

template <class T>
char* put(char* at, std::span<const T> numbers) {
  std::memcpy(at, numbers.data(), numbers.size_bytes());
  return at + numbers.size_bytes();
}

}  // namespace

void PolicyProgram::Socket::close() {
  if (descriptor_ >= 0) ::close(descriptor_);
  descriptor_ = -1;
}

PolicyProgram::PolicyProgram(const Task& task, std::uint64_t seed, const std::string& version,
                             const std::string& command, double timeout, std::function<bool()> stop)
    : task_(task), command_(command), timeout_(timeout), stop_(std::move(stop)) {
  start();
  try {
    introduce(seed, version);
  } catch (...) {
    end();
    throw;
  }
  for (const TensorSpec& tensor : task.spec().observations)
    for (std::size_t i = 0; i < tensor.size(); ++i)
      factors_.push_back(
          normalise_ && !tensor.scale.empty() ? 1 / tensor.scale[i % tensor.scale.size()] : 1.0);
  constexpr std::size_t kHead = (1 + 2 * std::size_t{kernels::kBlock}) * sizeof(std::int64_t);
  bytes_.resize(kHead + kernels::kBlock * factors_.size() * sizeof(float));
}

PolicyProgram::~PolicyProgram() { end(); }

std::string PolicyProgram::who() const { return fmt::format("the program '{}'", command_); }

void PolicyProgram::start() {
  int pair[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) != 0)
    throw IoError(fmt::format("no socket for {}: {}", who(), std::strerror(errno)));
  socket_.open(pair[0]);
  Socket other;
  other.open(pair[1]);
  // The program's parent is then this process, not a shell that waits for it.
  const std::string line = is_one_command(command_) ? "exec " + command_ : command_;
  process_ = fork();
  if (process_ < 0)
    throw IoError(fmt::format("{} cannot be started: {}", who(), std::strerror(errno)));
  if (process_ > 0) {
    setpgid(process_, process_);
    return;
  }
  // Ctrl-C is for this program alone, which then ends the other one.
  setpgid(0, 0);
  for (const int signal : {SIGINT, SIGTERM, SIGXFSZ}) std::signal(signal, SIG_DFL);
  dup2(pair[1], STDIN_FILENO);
  dup2(pair[1], STDOUT_FILENO);
  execl("/bin/sh", "sh", "-c", line.c_str(), static_cast<char*>(nullptr));
  _exit(127);
}

void PolicyProgram::introduce(std::uint64_t seed, const std::string& version) {
  const TaskSpec& spec = task_.spec();
  Json observations = Json::array();
  for (const TensorSpec& tensor : spec.observations) observations.push_back(described(tensor));
  const Json greeting{{"protocol", kProtocol},
                      {"version", version},
                      {"task", spec.name},
                      {"seed", seed},
                      {"horizon", spec.horizon},
                      {"observations", observations},
                      {"action",
                       {{"name", spec.action.name},
                        {"shape", spec.action.shape},
                        {"low", spec.action.low},
                        {"high", spec.action.high}}}};
  const double deadline = now() + timeout_;
  const std::string line = greeting.dump() + "\n";
  // What a program said before it ended is heard: it explains more than that it ended.
  static_cast<void>(write(line.data(), line.size(), deadline));
  const std::string heard = read_line(deadline);
  if (stopped_) return;
  const Json reply = Json::parse(heard, nullptr, false);
  if (!reply.is_object() || reply.value("protocol", Json()) != kProtocol ||
      !reply.value("name", Json()).is_string() ||
      !reply.value("normalise", Json(true)).is_boolean())
    throw InputError(
        fmt::format("{} answers '{}'; expected a line {{\"protocol\": \"{}\", \"name\": NAME}}, "
                    "and nothing else "
                    "on its standard output",
                    who(), heard.substr(0, 200), kProtocol));
  name_ = reply["name"].get<std::string>();
  normalise_ = reply.value("normalise", true);
  check_policy_name(who(), name_);
}

void PolicyProgram::answer(const PolicyInputs& inputs, std::span<double> actions) {
  const std::lock_guard lock(mutex_);
  if (failure_) std::rethrow_exception(failure_);  // other threads do not wait for it again
  try {
    exchange(inputs, actions);
  } catch (...) {
    failure_ = std::current_exception();
    throw;
  }
}

void PolicyProgram::exchange(const PolicyInputs& inputs, std::span<double> actions) {
  if (stopping()) stopped_ = true;
  if (stopped_) return std::fill(actions.begin(), actions.end(), 0.0);
  // Without its shell, for example, what it has started may still answer.
  if (siginfo_t how; has_ended(how)) fail_ended();
  const auto n = static_cast<std::int64_t>(inputs.episodes.size());
  char* at = put(bytes_.data(), std::span(&n, 1));
  at = put(at, inputs.episodes);
  at = put(at, inputs.actions);
  for (std::size_t i = 0; i < inputs.observations.size(); ++i) {
    // The number that a Python environment shows, to the bit.
    const auto shown = static_cast<float>(inputs.observations[i] * factors_[i % factors_.size()]);
    std::memcpy(at, &shown, sizeof shown);
    at += sizeof shown;
  }
  const double deadline = now() + timeout_;
  if (!write(bytes_.data(), static_cast<std::size_t>(at - bytes_.data()), deadline)) fail_ended();
  std::int64_t count = 0;
  if (!read(reinterpret_cast<char*>(&count), sizeof count, deadline) && !stopped_) fail_ended();
  if (!stopped_ && count != std::ssize(actions))
    throw InputError(fmt::format(
        "{} answers {} numbers to a question about {} environments; expected {}, {} for each, and "
        "nothing else on its standard output",
        who(), count, n, actions.size(), task_.spec().action.size()));
  if (!stopped_ && !read(reinterpret_cast<char*>(actions.data()), actions.size_bytes(), deadline) &&
      !stopped_)
    fail_ended();
  if (stopped_) return std::fill(actions.begin(), actions.end(), 0.0);
  for (std::size_t i = 0; i < actions.size(); ++i) {
    const std::size_t width = task_.spec().action.size(), e = i / width;
    if (!std::isfinite(actions[i]))
      throw InputError(fmt::format(
          "{} answers {} as number {} of action {} of episode {}; expected a finite number", who(),
          actions[i], i % width, inputs.actions[e], inputs.episodes[e]));
  }
}

void PolicyProgram::wait_for(short events, double deadline) {
  pollfd waiting{socket_.get(), events, 0};
  while (!stopping()) {
    const int ready = poll(&waiting, 1, kStopPoll);
    if (ready > 0 && now() <= deadline) return;  // the deadline also limits partial reads
    if (ready < 0 && errno != EINTR)
      throw IoError(fmt::format("cannot wait for {}: {}", who(), std::strerror(errno)));
    late_ = now() > deadline;
    if (late_)
      throw IoError(
          fmt::format("{} has not answered within {} s (--program-timeout)", who(), timeout_));
    // Its children may keep the socket open.
    if (siginfo_t how; ready == 0 && has_ended(how)) fail_ended();
  }
  stopped_ = true;
}

/// Returns false if the other end is closed.
bool PolicyProgram::write(const char* bytes, std::size_t count, double deadline) {
  while (count > 0 && !stopped_) {
    const ssize_t sent = send(socket_.get(), bytes, count, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent > 0) {
      bytes += sent;
      count -= static_cast<std::size_t>(sent);
    } else if (errno == EAGAIN) {
      wait_for(POLLOUT, deadline);
    } else if (errno != EINTR) {
      return false;
    }
  }
  return true;
}

/// Returns false at the end of the program's output, or when the run is to stop.
bool PolicyProgram::read(char* bytes, std::size_t count, double deadline) {
  while (count > 0) {
    const ssize_t received = recv(socket_.get(), bytes, count, MSG_DONTWAIT);
    if (received > 0) {
      bytes += received;
      count -= static_cast<std::size_t>(received);
      continue;
    }
    if (received == 0) return false;
    if (errno == EAGAIN) {
      wait_for(POLLIN, deadline);
      if (stopped_) return false;
    } else if (errno != EINTR) {
      return false;
    }
  }
  return true;
}

std::string PolicyProgram::read_line(double deadline) {
  std::string line;
  for (char c = 0; line.size() < kLongestLine; line += c) {
    if (!read(&c, 1, deadline)) {
      if (stopped_) break;
      fail_ended();
    }
    if (c == '\n') break;
  }
  return line;
}

/// Whether it has ended, and how. It stays a zombie, so that its group keeps its number.
bool PolicyProgram::has_ended(siginfo_t& how) const {
  how = {};
  return waitid(P_PID, static_cast<id_t>(process_), &how, WEXITED | WNOHANG | WNOWAIT) == 0 &&
         how.si_pid == process_;
}

/// It has closed its output, so its end is near.
void PolicyProgram::fail_ended() {
  siginfo_t how;
  const double deadline = now() + 1;
  bool ended = false;
  while (!(ended = has_ended(how)) && now() < deadline)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  if (!ended) throw IoError(fmt::format("{} has closed its standard output", who()));
  throw IoError(fmt::format(
      "{} has ended {} while an answer was awaited; its standard error may say why", who(),
      how.si_code == CLD_EXITED ? fmt::format("with exit code {}", how.si_status)
                                : fmt::format("by a signal ({})", strsignal(how.si_status))));
}

/// What it has started ends with it: it would keep the streams of this process open.
void PolicyProgram::end() {
  socket_.close();
  if (process_ < 0) return;
  const double deadline = now() + kTimeToEnd;
  for (siginfo_t how; !has_ended(how) && now() <= deadline && !late_ && !stopping();)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  kill(-process_, SIGKILL);
  waitpid(process_, nullptr, 0);
  process_ = -1;
}

}  // namespace tangere::apps
