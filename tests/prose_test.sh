#!/usr/bin/env bash
# prose_test.sh <source folder>: names sentences that need a second reading: those that begin with
# "Of", and those that say "whoever" or "nobody" instead of who acts. There are none. The READMEs
# and CONTRIBUTING.md together are short: their number of words goes down, never up.
most_readme_words=20000
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

# words_of FILE...: their words, together.
words_of() {
  cat "$@" | wc -w
}
two_files=$(words_of <(echo 'One, two  three.') <(echo '| four | 5 |'))
[ "$two_files" -eq 8 ] || { echo "prose_test: $two_files words, not 8"; exit 1; }

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
found=$(grep -HnIE "$tell_tale" "${documents[@]}" "${sources[@]}" || true)
if [ -n "$found" ]; then
  printf '%s\n' "$found" | cut -c1-160
  echo "prose_test: these lines begin with 'Of', or say 'whoever' or 'nobody'"
  failed=1
fi
mapfile -t readmes < <(printf '%s\n' "${documents[@]}" | grep -E '/(README|CONTRIBUTING)\.md$')
words=$(words_of "${readmes[@]}")
if [ "${#readmes[@]}" -le 15 ] || [ "$words" -gt "$most_readme_words" ]; then
  echo "prose_test: ${#readmes[@]} READMEs have $words words; at most $most_readme_words"
  failed=1
fi
exit "$failed"
