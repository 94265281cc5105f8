#!/usr/bin/env bash
# prose_test.sh <source folder>: names sentences that need a second reading: those that begin with
# "Of", and those that say "whoever" or "nobody" instead of who acts. Documents have none. Sources
# have at most this many lines with one; the number goes down, never up.
most_in_sources=155
set -euo pipefail
cd "$1"
export LC_ALL=C.UTF-8

begin='(^|//+[!<]*|#|"|\*|\||>|- |[.:;!?)]["`*]* )[[:space:]]*'
tell_tale="${begin}Of [^ ]|\\<([Ww]hoever|[Nn]obody)\\>"

# must_be 0|1 TEXT: whether the text has none, or one.
must_be() {
  local found
  found=$(grep -cE "$tell_tale" <<< "$2" || true)
  [ "$found" -eq "$1" ] || { echo "prose_test: found $found, not $1, in: $2"; exit 1; }
}
must_be 1 'float t;  ///< Of the hit'
must_be 1 '# Of the rays, none is left.'
must_be 1 'It ends. Of these, some stay.'
must_be 1 '- **Of a shell** rays see half.'
must_be 1 '| Nobody waits |'
must_be 0 'the field of a hit: one of these'
must_be 0 'IsReadFromOneFileWhoeverTakesItsName'

# Data, what programs made, and this file are not looked at; history keeps its words.
find_files() { # CONDITION...: the texts that people write
  find . -maxdepth 1 -type f ! -name LICENSE ! -name CHANGELOG.md "$@"
  find .ci bench core kernels_cl reference tests tools -type f ! -name prose_test.sh \
    ! -name '*.json' ! -name '*.png' ! -name '*.svg' ! -name '*.pyc' ! -name '*.gz' \
    ! -path 'tests/fuzz/seeds/*' ! -path 'tests/fuzz/found/*' ! -path '*/.mypy_cache/*' "$@"
}
mapfile -t documents < <(find_files -name '*.md')
mapfile -t sources < <(find_files ! -name '*.md')
if [ "${#documents[@]}" -le 20 ] || [ "${#sources[@]}" -le 100 ]; then
  echo "prose_test: no files"
  exit 1
fi

failed=0
# check MOST NAME FILE...: names the lines of the files, and fails if there are more than MOST.
check() {
  local found count
  found=$(grep -HnIE "$tell_tale" "${@:3}" || true)
  count=$(grep -c . <<< "$found" || true)
  [ "$count" -le "$1" ] && return
  printf '%s\n' "$found" | cut -c1-160
  echo "prose_test: $count $2 lines begin with 'Of', or say 'whoever' or 'nobody'; at most $1"
  failed=1
}
check 0 document "${documents[@]}"
check "$most_in_sources" source "${sources[@]}"
exit "$failed"
