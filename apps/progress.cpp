// SPDX-License-Identifier: Apache-2.0
// Uses only carriage return and "erase to the end of the line", which every terminal understands.
#include "apps/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

namespace tangere::apps {
namespace {

constexpr auto kTerminalPause = std::chrono::milliseconds(100);
constexpr auto kLogPause = std::chrono::seconds(10);

}  // namespace

Progress::Progress(const Console& console, std::string unit, std::int64_t steps, int environments)
    : unit_(std::move(unit)),
      steps_(steps),
      environments_(environments),
      terminal_(isatty(STDERR_FILENO) != 0),
      silent_(console.quiet || !(terminal_ || console.verbose)),
      start_(Clock::now()),
      last_(start_) {}

Progress::~Progress() {
  if (line_open_) std::fputs("\r\x1b[K", stderr);
}

void Progress::update(std::int64_t done) {
  if (silent_) return;
  const auto now = Clock::now();
  if (now - last_ < (terminal_ ? Clock::duration(kTerminalPause) : Clock::duration(kLogPause)))
    return;
  last_ = now;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  const auto steps_done = static_cast<double>(done);
  const std::string text = fmt::format("{} {} of {}, {:.0f} env-steps/s, {:.0f} s left", unit_,
                                       done, steps_, steps_done * environments_ / seconds,
                                       seconds / steps_done * static_cast<double>(steps_ - done));
  std::fputs(terminal_ ? ("\r" + text + "\x1b[K").c_str() : (text + "\n").c_str(), stderr);
  line_open_ = terminal_;
}

}  // namespace tangere::apps
