#!/usr/bin/env bash
# run_clang_tidy.sh BUILD FILE...: checks FILEs, or all that is in a folder, against the root
# .clang-tidy, as many at once as there are processors. BUILD holds compile_commands.json, made for
# g++: its precompiled header (which clang cannot read) and its warning flags (the compiler's job)
# are taken out of a copy first.
set -euo pipefail

build=$1
shift
export CLANG_TIDY_DATABASE=$build/clang_tidy
mkdir -p "$CLANG_TIDY_DATABASE"
sed -E 's/ -include [^ "]*cmake_pch\.hxx//g; s/ (-W[A-Za-z]|--param=)[^ "]*//g' \
  "$build/compile_commands.json" > "$CLANG_TIDY_DATABASE/compile_commands.json"

check() {
  local output status=0
  output=$(clang-tidy --quiet -p "$CLANG_TIDY_DATABASE" --extra-arg=-w "$1" 2>&1) || status=$?
  # Not a finding: how many warnings it hides in headers that are not ours.
  grep -Ev '^[0-9]+ warnings? (and [0-9]+ errors? )?generated\.$' <<< "$output" || true
  return "$status"
}
export -f check
# shellcheck disable=SC2016 # $0 is the inner shell's
find "$@" -type f -regex '.*\.c[px][px]' -print0 | xargs -0 -n 1 -P "$(nproc)" bash -c 'check "$0"'
