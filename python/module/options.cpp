// SPDX-License-Identifier: Apache-2.0
// Threads count as in the rest of the program.
#include "python/module/options.hpp"

#include <fmt/format.h>
#include <tbb/info.h>

#include "engine/base/error.hpp"

namespace tangere::python {

int threads_of(const std::optional<Whole<int>>& requested) {
  if (!requested) return tbb::info::default_concurrency();
  const int threads = requested->value("threads");
  if (threads < 1)
    throw InputError(fmt::format("{} threads; expected at least 1, or None", threads));
  return threads;
}

Precision precision_named(const std::string& name) {
  if (name != "mixed" && name != "double")
    throw InputError(fmt::format("precision '{}'; expected 'mixed' or 'double'", name));
  return name == "mixed" ? Precision::mixed : Precision::f64;
}

}  // namespace tangere::python
