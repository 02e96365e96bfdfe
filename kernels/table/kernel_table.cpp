// SPDX-License-Identifier: Apache-2.0
// Which tables the processor can run. Asked of the compiler's own detection, which also checks the
// operating system.
#include "kernels/table/kernel_table.hpp"

#include <array>
#include <cstdlib>
#include <cstring>

#include "kernels/table/isa.hpp"

namespace tangere::kernels {

extern const KernelTable kTable_scalar;
#if TANGERE_X86
extern const KernelTable kTable_sse2;
extern const KernelTable kTable_avx2;
extern const KernelTable kTable_avx512;
#endif

namespace {

struct Registry {
  std::array<const KernelTable*, 4> tables{};
  std::size_t count = 0;
  const KernelTable* active = nullptr;
  const char* error = "";

  Registry() {
    const auto add = [this](const KernelTable& t) { tables[count++] = &t; };
#if TANGERE_X86
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw"))
      add(kTable_avx512);
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) add(kTable_avx2);
    add(kTable_sse2);
#endif
    add(kTable_scalar);
    active = tables[0];
    const char* wanted = std::getenv("TANGERE_ISA");
    if (wanted == nullptr || *wanted == '\0') return;
    for (std::size_t i = 0; i < count; ++i) {
      if (std::strcmp(wanted, tables[i]->name) == 0) {
        active = tables[i];
        return;
      }
    }
    error =
        "TANGERE_ISA names an instruction set this machine does not run; known names are avx512, "
        "avx2, sse2, scalar";
  }
};

Registry& registry() {
  static Registry r;
  return r;
}

}  // namespace

std::span<const KernelTable* const> available_kernels() {
  return {registry().tables.data(), registry().count};
}
const KernelTable& active_kernels() { return *registry().active; }
const char* active_isa_name() { return active_kernels().name; }
const char* forced_isa_error() { return registry().error; }
void use_kernels(const KernelTable& table) { registry().active = &table; }

}  // namespace tangere::kernels
