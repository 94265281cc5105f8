#!/usr/bin/env bash
# documents_test.sh <source folder> <folder with the programs>: every table of the documents is what
# its JSON says (tools/tables --check), and tools/tables notices what is not; tools/measure measures
# tiny volumes, refuses what it cannot, and tools/tables makes tables of all its sections.
set -euo pipefail

top=$1
programs=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
  echo "documents_test: $*" >&2
  exit 1
}

"$top/tools/tables" --check || fail 'a document is not what was measured: run tools/tables'

measure() { "$top/tools/measure" --device "${ISOWAVE_DEVICE:-cpu}" --programs "$programs" --quick "$@"; }
mkdir -p "$work/top/results"
measure -o "$work/top/results/a.json" --only frames,error,time > "$work/out" || fail "$(cat "$work/out")"
measure -o "$work/top/results/a.json" --volumes "$top/tests/data" --only sizes,storage > "$work/out"
{
  for table in front frames error time sizes storage; do
    printf '<!-- table: %s results/a.json -->\n<!-- end -->\n' "$table"
  done
} > "$work/top/page.md"
tables() { "$top/tools/tables" --top "$work/top" "$@"; }
if tables --check 2> /dev/null; then fail 'empty tables are no difference'; fi
tables || fail 'tables cannot be made'
tables --check || fail 'tables differ from what they were made of'
[ "$(grep -c '^|---' "$work/top/page.md")" -eq 6 ] || fail "$(cat "$work/top/page.md")"

# must_fail NAME WORDS: --check fails in one line that has the words.
must_fail() {
  if tables --check 2> "$work/error"; then fail "$1 is not noticed"; fi
  [ "$(wc -l < "$work/error")" -eq 1 ] || fail "$1: $(cat "$work/error")"
  grep -qF "$2" "$work/error" || fail "$1: $(cat "$work/error")"
}
cp -r "$work/top" "$work/right"
again() {
  rm -rf "$work/top"
  cp -r "$work/right" "$work/top"
}
sed -i '0,/[0-9]\.[0-9][0-9] |/s//9.99 |/' "$work/top/page.md"
must_fail 'another number' 'line 1: not what results/a.json says'
again
sed -i 's/"median": [0-9.]*/"median": 123/' "$work/top/results/a.json"
must_fail 'another JSON' 'not what results/a.json says'
again
rm "$work/top/results/a.json"
must_fail 'a missing JSON' 'a.json'
again
echo '{"schema": 1}' > "$work/top/results/a.json"
must_fail 'a JSON of something else' 'a.json'
again
sed -i 's/<!-- end -->//' "$work/top/page.md"
must_fail 'a table without an end' 'without its line'
again
sed 's/"commit": "[^"]*"/"commit": "other"/' "$work/right/results/a.json" > "$work/top/results/b.json"
sed -i '$!b;s/$/\n<!-- table: frames results\/b.json -->\n<!-- end -->/' "$work/top/page.md"
must_fail 'another commit on the same page' 'commit other'
again
sed -i 's/table: time/table: tides/' "$work/top/page.md"
must_fail 'a table that there is not' 'no table tides'

# refused NAME OPTION...: one line, and nothing is written.
refused() {
  if measure -o "$work/new.json" "${@:2}" > /dev/null 2> "$work/error"; then fail "$1 was accepted"; fi
  [ "$(wc -l < "$work/error")" -eq 1 ] || fail "$1: $(cat "$work/error")"
  [ ! -e "$work/new.json" ] || fail "$1: something was written"
}
refused 'an unknown section' --only frames,tides
refused 'a missing folder' --only sizes --volumes "$work/none"
refused 'volumes that are not named' --only sizes
refused 'programs that are not there' --only frames --programs "$work"
refused 'an unknown device' --only frames --device no_such_device
sed 's/"commit": "[^"]*"/"commit": "other"/' "$work/right/results/a.json" > "$work/other.json"
if measure -o "$work/other.json" --only frames 2> "$work/error"; then fail 'commits were mixed'; fi
grep -q 'give another -o' "$work/error" || fail "$(cat "$work/error")"
