// SPDX-License-Identifier: Apache-2.0
// A handler may do little more than set a flag. Code that works in steps checks the flag.
#include "apps/stop_signals.hpp"

#include <atomic>

namespace tangere::apps {
namespace {

constexpr std::array kSignals{SIGINT, SIGTERM, SIGXFSZ};

std::atomic<int> first_signal{0};
static_assert(std::atomic<int>::is_always_lock_free, "the handler may not wait");

void remember(int signal) {
  int none = 0;
  first_signal.compare_exchange_strong(none, signal);
}

}  // namespace

StopSignals::StopSignals() {
  first_signal = 0;
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    struct sigaction action {};
    action.sa_handler = kSignals[i] == SIGXFSZ ? SIG_IGN : remember;
    action.sa_flags = SA_RESTART;
    sigaction(kSignals[i], nullptr, &previous_[i]);
    if (previous_[i].sa_handler != SIG_IGN) sigaction(kSignals[i], &action, nullptr);
  }
}

StopSignals::~StopSignals() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &previous_[i], nullptr);
}

int StopSignals::received() const { return first_signal; }

}  // namespace tangere::apps
