// SPDX-License-Identifier: Apache-2.0
// A program for `generate --program`, as docs/policies.md describes it. It answers with zeros, and
// goes wrong as its first argument says at the question whose number is the second one.
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

namespace {

/// Reads all of them or ends the program.
void read_all(void* to, std::size_t size) {
  auto* at = static_cast<char*>(to);
  while (size > 0) {
    const ssize_t got = read(STDIN_FILENO, at, size);
    if (got <= 0) _exit(got == 0 ? 0 : 4);
    at += got;
    size -= static_cast<std::size_t>(got);
  }
}

void write_all(const void* from, std::size_t size) {
  const auto* at = static_cast<const char*>(from);
  while (size > 0) {
    const ssize_t put = write(STDOUT_FILENO, at, size);
    if (put <= 0) _exit(5);
    at += put;
    size -= static_cast<std::size_t>(put);
  }
}

/// Numbers of a tensor that the first line describes.
std::size_t size_of(const nlohmann::json& tensor) {
  std::size_t size = 1;
  for (const std::size_t n : tensor.at("shape")) size *= n;
  return size;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string wrong = argc > 1 ? argv[1] : "";
  const long when = argc > 2 ? std::stol(argv[2]) : 0;
  std::string said;
  for (char c = 0; c != '\n'; said += c) read_all(&c, 1);
  const nlohmann::json task = nlohmann::json::parse(said);
  std::size_t width = 0;
  for (const nlohmann::json& tensor : task.at("observations")) width += size_of(tensor);
  const std::size_t actions = size_of(task.at("action"));
  const std::string hello = "{\"protocol\": \"tangere policy 1\", \"name\": \"zeros\"}\n";
  write_all(hello.data(), hello.size());
  std::mt19937_64 random(1);
  for (long question = 0;; ++question) {
    std::int64_t n = 0;
    read_all(&n, sizeof n);
    std::vector<char> rest(static_cast<std::size_t>(n) * (16 + 4 * width));
    read_all(rest.data(), rest.size());
    std::vector<double> answer(static_cast<std::size_t>(n) * actions, 0.0);
    auto count = static_cast<std::int64_t>(answer.size());
    if (question == when) {
      if (wrong == "dies") _exit(7);
      if (wrong == "crashes") raise(SIGKILL);
      if (wrong == "hangs") pause();
      if (wrong == "leaves_child" && fork() > 0) _exit(7);
      if (wrong == "leaves_child") pause();
      if (wrong == "stops_parent") kill(getppid(), SIGTERM);
      if (wrong == "nan") answer.back() = std::numeric_limits<double>::quiet_NaN();
      if (wrong == "negative") count = -1;
      if (wrong == "endless") count = std::numeric_limits<std::int64_t>::max();
      if (wrong == "garbage")
        for (double& x : answer) {
          const std::uint64_t bits = random() | 0x7FF0000000000001;  // not a number, every one
          std::memcpy(&x, &bits, sizeof x);
        }
      if (wrong == "closes") {
        for (const int end : {STDIN_FILENO, STDOUT_FILENO}) close(end);
        pause();
      }
    }
    write_all(&count, sizeof count);
    if (question == when && wrong == "half") {
      write_all(answer.data(), sizeof(double));
      _exit(0);
    }
    if (question == when && wrong == "floods")
      for (;;) write_all(answer.data(), answer.size() * sizeof(double));
    write_all(answer.data(), answer.size() * sizeof(double));
  }
}
