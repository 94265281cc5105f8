#!/usr/bin/env bash
# Some runs of tools/fuzz, and one of a program that does not draw the twin's bits, which it must
# find.
#   fuzz_test.sh PROGRAM
set -euo pipefail
program=$1
fuzz=$(cd "$(dirname "$0")/.." && pwd)/tools/fuzz
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

ISOWAVE=$program "$fuzz" --runs 60

cat >other <<EOF
#!/bin/sh
case "\$*" in
  verify*) exit 0 ;;
  *--reference*) exec "$program" "\$@" --solver linear ;;
  *) exec "$program" "\$@" ;;
esac
EOF
chmod +x other
if ISOWAVE=$work/other "$fuzz" --runs 12 >out; then
  echo "fuzz_test: another solver's bits were taken for the twin's: $(cat out)" >&2
  exit 1
fi
grep -q "not the twin's bits" out
command=$(sed -n 's/^seed [0-9]*: isowave //p' out | head -1)
# shellcheck disable=SC2086
"$program" $command -o again.png >again  # what it prints can be run
