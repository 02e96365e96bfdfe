// SPDX-License-Identifier: Apache-2.0
// The program `tangere`. A program with tasks of its own has the same main, and adds them first.
#include "apps/program.hpp"

int main(int argc, char** argv) { return tangere::run_program(argc, argv); }
