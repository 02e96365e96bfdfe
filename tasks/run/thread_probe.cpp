// SPDX-License-Identifier: Apache-2.0
// The threads block until the last has started, because limits are on concurrent threads.
#include "tasks/run/thread_probe.hpp"

#include <fmt/format.h>

#include <future>
#include <system_error>
#include <thread>
#include <vector>

#include "engine/base/error.hpp"

namespace tangere {

void require_threads(int threads) {
  if (threads < 2) return;
  std::promise<void> all;
  const std::shared_future<void> started = all.get_future().share();
  std::vector<std::thread> others;
  others.reserve(static_cast<std::size_t>(threads) - 1);
  std::string refused;
  try {
    for (int k = 1; k < threads; ++k) others.emplace_back([started] { started.wait(); });
  } catch (const std::system_error& error) {
    refused = error.code().message();
  }
  all.set_value();
  for (std::thread& other : others) other.join();
  if (!refused.empty())
    throw InputError(
        fmt::format("cannot start {} threads: the system refused number {}: {}; "
                    "expected fewer threads",
                    threads, others.size() + 2, refused));
}

}  // namespace tangere
