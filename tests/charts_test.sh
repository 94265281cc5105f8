#!/usr/bin/env bash
# Small runs of `isowave bench solvers`, `isowave bench pareto` and `frame_bench --budgets`, and
# tools/charts of them and of what is no such file.
#   charts_test.sh PROGRAM [FRAME_BENCH]
set -euo pipefail
program=$1 frame_bench=${2-}
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
for file in small_{cells,frames}.{png,svg} fuel_{bernstein,linear}.png; do
  [ -s "$work/$file" ] || fail "$file is missing"
done
/usr/bin/python3 - "$work/small.json" <<'EOF'
import json, sys
document = json.load(open(sys.argv[1]))
for entries in [document["cells"]["entries"]] + [frame["entries"] for frame in document["frames"]]:
    default = [e for e in entries if e["solver"] == "bernstein" and e["steps"] == 32]
    assert len(default) == 1 and default[0]["missed"] == default[0]["false"] == 0, default
    wrong = [e["missed"] + e["false"] for e in entries]
    assert any(wrong), "no solver fails: nothing is compared"
EOF

echo '{"benchmark": "solvers", "schema": 0}' >"$work/old.json"
echo '{' >"$work/broken.json"
echo '{"sections": {"solvers": 1}, "machine": {}}' >"$work/other.json"
machine='{"device": "d", "platform": "p", "driver": "v"}'
echo "{\"sections\": {}, \"machine\": $machine}" >"$work/undrawn.json"
for bad in old.json broken.json none.json other.json undrawn.json; do
  if "$top/tools/charts" "$work/$bad" -o "$work" 2>"$work/error"; then fail "$bad was accepted"; fi
  [ "$(wc -l <"$work/error")" -eq 1 ] || fail "$bad: $(cat "$work/error")"
done
for bad in "$work/none.raw:1" "$top/tests/data/fuel_64x33x32_uint8.raw.gz" "$work/none.raw:x"; do
  if "$program" bench solvers "$bad" 2>"$work/error" >/dev/null; then fail "$bad was accepted"; fi
  [ "$(wc -l <"$work/error")" -eq 1 ] || fail "$bad: $(cat "$work/error")"
done

"$program" bench pareto generate:sphere_96x96x96_uint8 -i 128 --size 48x32 --views 1 --rounds 1 \
  --storage rate:2,tolerance:2,exact --pipeline rays --solver bernstein \
  --voxel-pixels 0,2 --voxel-error 0,0.1 --max-surface-error 0.1,20 \
  --json "$work/all.json" >"$work/out"
"$top/tools/charts" "$work/all.json" -o "$work"
for file in all_pareto.png all_pareto.svg; do
  [ -s "$work/$file" ] || fail "$file is missing"
done
/usr/bin/python3 - "$work/all.json" <<'EOF'
import json, sys
points = json.load(open(sys.argv[1]))["points"]
chosen = [p for p in points if p["max_surface_error"] is not None]
points = [p for p in points if p["max_surface_error"] is None]
assert len(points) == 12, len(points)
assert len(chosen) == 6, "two errors of three ways to store it"
assert all(p["over_front"] is None or p["over_front"] > 0 for p in chosen), chosen
exact = [p for p in chosen if p["storage"] == "exact"]
assert any(p["over_front"] for p in exact), "the best point is among the swept"
def left_out(error):
    points = [p for p in chosen if p["max_surface_error"] == error]
    return sum(c["voxel_pixels"] for p in points for c in p["chosen"])
small, large = left_out(0.1), left_out(20)
assert small < large, "more may be left out where more error is allowed"
exact = [p for p in points if p["storage"] == "exact"]
best = [p for p in exact if p["voxel_pixels"] == p["voxel_error"] == 0]
assert len(best) == 1, best
best = best[0]
assert best["wrong_pixels"] == best["depth_p99"] == best["flip"] == 0, best
assert best["psnr_db"] is None, best
others = [p for p in points if p is not best]
assert all(p["psnr_db"] is not None and p["flip"] > 0 for p in others), "they have errors"
assert len({p["bytes"] for p in points}) == 6, "three ways to store it, without and with levels"
assert min(p["decoded_blocks"] for p in exact if p["voxel_pixels"]) < best["decoded_blocks"]
EOF
fuel=$top/tests/data/fuel_64x33x32_uint8.raw.gz
for bad in "--storage rate" "--storage full:3" "--voxel-pixels -1" "--max-surface-error -1"; do
  # shellcheck disable=SC2086
  if "$program" bench pareto "$fuel" -i 40 $bad 2>"$work/error" >/dev/null; then
    fail "$bad was accepted"
  fi
  [ "$(wc -l <"$work/error")" -eq 1 ] || fail "$bad: $(cat "$work/error")"
done

[ -n "$frame_bench" ] || exit 0
# sweep ARGUMENT...: a small volume at several budgets, to sweep.json.
volume=generate:gyroid_32x32x32_uint8
sweep() {
  "$frame_bench" "$volume" --size 160x120 --orbit 2 --rounds 2 --json "$work/sweep.json" "$@" \
    >"$work/out"
}
sweep --budgets auto:4
"$top/tools/charts" "$work/sweep.json" -o "$work"
for file in sweep_budgets.png sweep_budgets.svg; do
  [ -s "$work/$file" ] || fail "$file is missing"
done
/usr/bin/python3 - "$work/sweep.json" <<'EOF'
import json, sys
document = json.load(open(sys.argv[1]))
budgets = document["budgets"]
slots = [b["cache_slots"] for b in budgets]
assert len(slots) == 4 and slots[0] == 512 and slots == sorted(slots, reverse=True), budgets
for budget in budgets:
    assert budget["peak_bytes"] <= budget["bytes"], budget
    for kind in ("cold_ms", "warm_ms", "next_ms"):
        assert 0 < budget[kind]["min"] <= budget[kind]["median"] <= budget[kind]["max"], budget
assert budgets[0]["passes"] < budgets[-1]["passes"], "the smallest cache takes more passes"
assert document["resident_floor"]["median"] > 0
EOF
sweep --budgets auto:3 --max-passes 8 --no-resident
/usr/bin/python3 - "$work/sweep.json" <<'EOF'
import json, sys
document = json.load(open(sys.argv[1]))
budgets = document["budgets"]
assert budgets[-1]["cold_ms"] is None and budgets[0]["cold_ms"] is not None, document
assert document["resident_floor"] is None
EOF
grep -q 'more than 8 passes' "$work/out" || fail "a budget without times: $(cat "$work/out")"
"$top/tools/charts" "$work/sweep.json" -o "$work"
sweep --budgets 3MiB,1200KB
[ "$(grep -c '^ *[0-9]* ' "$work/out")" -ge 2 ] || fail "a list of budgets: $(cat "$work/out")"
"$frame_bench" "$volume" --size 40x30 --samples 2 --orbit 1 --rounds 1 --no-resident \
  --json "$work/four.json" >"$work/out"
grep -q "40 x 30, 4 rays a pixel" "$work/out" || fail "--samples: $(cat "$work/out")"
grep -q '"samples": 2' "$work/four.json" || fail "--samples: $(cat "$work/four.json")"
for bad in auto:1 auto:x auto: 1MB,x 0 1KB; do
  if sweep --budgets "$bad" 2>"$work/error"; then fail "--budgets $bad was accepted"; fi
  [ "$(wc -l <"$work/error")" -eq 1 ] || fail "--budgets $bad: $(cat "$work/error")"
done
if sweep --budgets auto:2 --cache-slots 8 2>"$work/error"; then
  fail "--budgets with --cache-slots was accepted"
fi
