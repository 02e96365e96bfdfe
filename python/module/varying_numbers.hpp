// SPDX-License-Identifier: Apache-2.0
// Numbers of a scene that differ between environments, by their names.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "engine/step/batch.hpp"
#include "python/module/arrays.hpp"

namespace tangere::python {

/// Returns the scene with these numbers free to differ between environments. Throws InputError for
/// a name that no such number has.
Scene with_varying(Scene scene, const std::vector<std::string>& names);

/// Returns the names of what varies.
std::vector<std::string> varying_names(const Scene& scene);
/// Returns name → (E): the values of what varies.
nb::dict randomized_arrays(const Batch& batch);

/// Values (n) of the environments `list`, or one for all of them, by the name of a number.
using NamedValues = std::map<std::string, Argument<double>>;
/// Sets them in SI units. Throws InputError, and sets none, for a name that does not vary, for
/// another shape and for a value that the scene could not have.
void set_randomized(Batch& batch, const NamedValues& values, const std::vector<int>& list);

// Signatures and docstrings.
inline constexpr const char* kRandomizedSignature =
    "def randomized(self) -> dict[str, numpy.typing.NDArray[numpy.float64]]";
inline constexpr const char* kRandomizedText =
    "Name → (E): what <randomize> or Scene.vary() lets vary, such as 'tactile pad kt', in SI\n"
    "units. Numbers of the starting state are those that the episode drew.";
inline constexpr const char* kSetRandomizedSignature =
    "def set_randomized(self, values: collections.abc.Mapping[str, numpy.typing.ArrayLike], "
    "envs: object | None = None) -> None";
inline constexpr const char* kSetRandomizedText =
    "Sets numbers that vary, by name and in SI units: name → one value, or (n), of the\n"
    "environments listed in `envs` (indices, or a mask (E)), or of all. The next reading and the\n"
    "next step use them. q, v, the state one step before and the shear state stay; a failed\n"
    "environment stays failed. reset() draws the numbers again; those of Scene.vary() are the\n"
    "scene's again. The bits are those of an environment that drew these values. A `tie` of\n"
    "<randomize> holds for draws alone: give every number of it that is to change. InputError,\n"
    "and none is set: another name or shape, a number of the starting state, or a value that\n"
    "the scene could not have.";

}  // namespace tangere::python
