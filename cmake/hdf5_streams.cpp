// SPDX-License-Identifier: Apache-2.0
// The standard streams under the names that cmake/dependencies.cmake gives them in HDF5's archive.
// Its code is that of a program: it reads variables of other libraries in place, which a shared
// library must not. So these are its own.
#include <cstdio>

extern "C" {
[[gnu::visibility("hidden")]] extern std::FILE *tangere_stdin, *tangere_stdout, *tangere_stderr;
std::FILE *tangere_stdin = stdin, *tangere_stdout = stdout, *tangere_stderr = stderr;
}
