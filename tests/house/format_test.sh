#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# clang-format with the project's file changes nothing. Other releases of it wrap lines elsewhere, so that this one
# alone counts; where it is not to be had, the test is skipped. Usage: format_test.sh PROJECT_ROOT
set -euo pipefail
cd "$1"
# shellcheck source=../../cmake/shell.sh
. cmake/shell.sh
formatter=$(clang_format) || {
  echo "skipped: there is no clang-format $clang_format_version here; ./dev tools installs it"
  exit 77
}
status=0
sources | xargs -0 "$formatter" --dry-run --Werror || status=1
[ "$status" -eq 0 ] || echo "./dev format puts this right"
exit "$status"
