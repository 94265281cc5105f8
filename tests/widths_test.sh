#!/usr/bin/env bash
# widths_test.sh <source folder>: no line of a text that people write is wider than 100 columns. May
# be wider: rows of tables in Markdown, and lines with a link.
set -euo pipefail
cd "$1"
export LC_ALL=C.UTF-8

# too_wide FILE...: names the lines.
too_wide() {
  grep -HnE '^.{101}' "$@" | grep -vE '^[^:]*\.md:[0-9]+:\||https?://|\]\(' | cut -c1-160
}

wide=$(mktemp)
trap 'rm -f "$wide"' EXIT
printf '%0101d\n' 0 > "$wide"
[ -n "$(too_wide "$wide")" ] || { echo 'widths_test: a line of 101 columns is not found'; exit 1; }
printf '%0100d\n' 0 > "$wide"
[ -z "$(too_wide "$wide")" ] || { echo 'widths_test: a line of 100 columns is found'; exit 1; }

# Data, what programs made, and tables that clang-format is told to leave are left out.
mapfile -t files < <(
  find . -maxdepth 1 -type f ! -name LICENSE
  find .ci bench core kernels_cl reference tests tools -type f \
    ! -name '*.json' ! -name '*.png' ! -name '*.svg' ! -name '*.pyc' ! -name '*.gz' \
    ! -path 'tests/fuzz/seeds/*' ! -path 'tests/fuzz/found/*' ! -path '*/.mypy_cache/*' \
    ! -path kernels_cl/portable/shared_types_fields.h
)
[ "${#files[@]}" -gt 100 ] || { echo 'widths_test: no files'; exit 1; }
found=$(too_wide "${files[@]}" || true)
[ -z "$found" ] || { printf '%s\n' "$found"; exit 1; }
