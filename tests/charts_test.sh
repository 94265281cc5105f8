#!/usr/bin/env bash
# A small run of `isowave bench solvers`, and tools/charts of it and of what is no such file.
#   charts_test.sh PROGRAM
set -euo pipefail
program=$1
top=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() {
  echo "charts_test: $1" >&2
  exit 1
}

"$program" bench solvers "$top/tests/data/fuel_64x33x32_uint8.raw.gz:40" --size 96x64 --rounds 2 \
  --json "$work/small.json" --pictures "$work"
"$top/tools/charts" "$work/small.json" -o "$work"
for file in small_cells.png small_cells.svg small_frames.png small_frames.svg fuel_bernstein.png fuel_linear.png; do
  [ -s "$work/$file" ] || fail "$file is missing"
done
/usr/bin/python3 - "$work/small.json" <<'EOF'
import json, sys
document = json.load(open(sys.argv[1]))
for entries in [document["cells"]["entries"]] + [frame["entries"] for frame in document["frames"]]:
    default = [e for e in entries if e["solver"] == "bernstein" and e["steps"] == 32]
    assert len(default) == 1 and default[0]["missed"] == default[0]["false"] == 0, default
    assert any(e["missed"] + e["false"] > 0 for e in entries), "no solver fails: nothing is compared"
EOF

echo '{"benchmark": "solvers", "schema": 0}' >"$work/old.json"
echo '{' >"$work/broken.json"
for bad in old.json broken.json none.json; do
  if "$top/tools/charts" "$work/$bad" -o "$work" 2>"$work/error"; then fail "$bad was accepted"; fi
  [ "$(wc -l <"$work/error")" -eq 1 ] || fail "$bad: $(cat "$work/error")"
done
for bad in "$work/none.raw:1" "$top/tests/data/fuel_64x33x32_uint8.raw.gz" "$work/none.raw:x"; do
  if "$program" bench solvers "$bad" 2>"$work/error" >/dev/null; then fail "$bad was accepted"; fi
  [ "$(wc -l <"$work/error")" -eq 1 ] || fail "$bad: $(cat "$work/error")"
done
