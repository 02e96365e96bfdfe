// SPDX-License-Identifier: Apache-2.0
// Headers that most sources of the libraries include anyway, parsed once for all of them. Every
// source still includes what it uses.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>
