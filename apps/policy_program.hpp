// SPDX-License-Identifier: Apache-2.0
// External policy program (`generate --program CMD`). It is started once and exchanges messages
// through its standard input and output; docs/policies.md defines the protocol.
#pragma once

#include <signal.h>
#include <sys/types.h>

#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "tasks/run/policy.hpp"

namespace tangere::apps {

class PolicyProgram {
 public:
  /// Starts `command` with the shell, sends the task and reads the policy's name. `timeout` [s]
  /// applies to this and to every answer. After `stop` no answer is awaited: the name may then be
  /// missing, and actions are zeros. Throws IoError if the program cannot be started, ends, or does
  /// not answer in time, InputError if it does not send a name.
  PolicyProgram(const Task& task, std::uint64_t seed, const std::string& version,
                const std::string& command, double timeout, std::function<bool()> stop);
  /// Closes its input. A program that does not end by itself within some seconds is killed, and in
  /// any case what it has started in its process group.
  ~PolicyProgram();
  PolicyProgram(const PolicyProgram&) = delete;
  PolicyProgram& operator=(const PolicyProgram&) = delete;

  /// What it calls itself.
  [[nodiscard]] const std::string& name() const { return name_; }
  /// Sends a question and reads the answer; calls of threads are serialised. Throws IoError if the
  /// program has ended or is late, InputError if its answer has another size or a number that is
  /// not finite.
  void answer(const PolicyInputs& inputs, std::span<double> actions);

 private:
  class Socket {
   public:
    Socket() = default;
    ~Socket() { close(); }
    Socket(const Socket&) = delete;
    Socket& operator=(const Socket&) = delete;
    void open(int descriptor) { descriptor_ = descriptor; }
    void close();
    [[nodiscard]] int get() const { return descriptor_; }

   private:
    int descriptor_ = -1;
  };

  void start();
  void exchange(const PolicyInputs& inputs, std::span<double> actions);
  void introduce(std::uint64_t seed, const std::string& version);
  [[nodiscard]] bool write(const char* bytes, std::size_t count, double deadline);
  [[nodiscard]] bool read(char* bytes, std::size_t count, double deadline);
  [[nodiscard]] std::string read_line(double deadline);
  void wait_for(short events, double deadline);
  [[nodiscard]] bool stopping() const { return stopped_ || stop_(); }
  [[nodiscard]] bool has_ended(siginfo_t& how) const;
  [[noreturn]] void fail_ended();
  [[nodiscard]] std::string who() const;
  void end();

  const Task& task_;
  std::string command_, name_;
  double timeout_;
  bool normalise_ = true;
  pid_t process_ = -1;
  Socket socket_;
  std::function<bool()> stop_;
  bool stopped_ = false, late_ = false;
  std::mutex mutex_;             // of the conversation
  std::exception_ptr failure_;   // what ended it
  std::vector<double> factors_;  // (observation) that an observation is multiplied by
  std::vector<char> bytes_;      // of a question
};

}  // namespace tangere::apps
