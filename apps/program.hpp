// SPDX-License-Identifier: Apache-2.0
// The whole command as a function, for programs that have tasks of their own (docs/tasks.md).
#pragma once

namespace tangere {

/// Does what `tangere` does with these words, and returns its exit code. Tasks that add_task() made
/// known before are known to every subcommand. Call it once, from main().
int run_program(int argc, char** argv);

}  // namespace tangere
