#!/usr/bin/env bash
# Small runs of `isowave bench solvers`, `pareto` and `topology`, and of `frame_bench --budgets`;
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

"$program" bench pareto generate:sphere_64x64x64_uint8 -i 128 --size 48x32 --views 1 --rounds 1 \
  --pictures "$work/pictures" --json "$work/all.json" >"$work/out"
"$top/tools/charts" "$work/all.json" -o "$work"
for file in all_pareto{,_new,_wrong,_bytes}.{png,svg} pictures/pareto_{truth_0,BCMC}_0.png; do
  [ -s "$work/$file" ] || fail "$file is missing"
done
PYTHONPATH=$top/tools /usr/bin/python3 - "$work/all.json" <<'EOF'
import json, sys
from measuring.fronts import front_of
points = {point["way"]: point for point in json.load(open(sys.argv[1]))["points"]}
one, many = points["default"], points["--samples 8"]
assert 0 < many["flip"] < 0.3 * one["flip"], "more rays come closer to the truth"
assert points["--samples 2"]["wrong_pixels"] <= one["wrong_pixels"]
assert points["1/8 size"]["flip"] > points["1/2 size"]["flip"] > one["flip"]
same = ("flip", "wrong_pixels")
for way in ("--device host", "--pipeline blocks"):
    assert [points[way][name] for name in same] == [one[name] for name in same], way
assert points["--rate 2"]["stored_bytes"] == 64**3 / 4
assert points["--voxel-pixels 1"]["stored_bytes"] > one["stored_bytes"], "levels are stored"
assert all(point["cold_ms"] > 0 < point["next_ms"] for point in points.values())
front = front_of(points.values(), "next_ms", "flip")
for a, b in zip(front, front[1:]):
    assert a["next_ms"] <= 1.1 * b["next_ms"] and a["flip"] > b["flip"]
for point in points.values():
    best = min(p["flip"] for p in front if p["next_ms"] <= 1.1 * point["next_ms"])
    assert 0.95 * best <= point["flip"], point
EOF
# What another program drew: here, the truth itself, and the same of another view.
peers() { # SIZE NAME
  echo "{\"pareto_peers\": [{\"name\": \"peer\", \"ms\": {\"next\": 3}, \"isovalue\": 128,
    \"size\": $1, \"bytes\": 5, \"pictures\": [\"$2\"]}]}" >"$work/peers.json"
}
judge() {
  "$program" bench pareto generate:sphere_64x64x64_uint8 -i 128 --size 48x32 --views 1 --rounds 1 \
    --ways default --peers "$work/peers.json" --json "$work/peer.json"
}
peers '[48, 32]' pictures/pareto_truth_0_0.png
judge >"$work/out"
/usr/bin/python3 - "$work/peer.json" <<'EOF'
import json, sys
peer = [point for point in json.load(open(sys.argv[1]))["points"] if point["is_peer"]]
assert len(peer) == 1 and peer[0]["flip"] == peer[0]["wrong_pixels"] == 0, peer
assert (peer[0]["next_ms"], peer[0]["cold_ms"], peer[0]["memory_bytes"]) == (3, None, 5), peer
EOF
"$top/tools/charts" "$work/peer.json" -o "$work"
peers '[48, 33]' pictures/pareto_truth_0_0.png
if judge 2>"$work/error" >"$work/out"; then fail "a peer's picture of another size was accepted"; fi
[ "$(wc -l <"$work/error")" -eq 1 ] || fail "another size: $(cat "$work/error")"
peers '[48, 32]' none.png
if judge 2>"$work/error" >"$work/out"; then fail "a peer without pictures was accepted"; fi
[ "$(wc -l <"$work/error")" -eq 1 ] || fail "no picture: $(cat "$work/error")"
echo '{}' >"$work/peers.json"
if judge 2>"$work/error" >"$work/out"; then fail "peers that are none were accepted"; fi
[ "$(wc -l <"$work/error")" -eq 1 ] || fail "no peers: $(cat "$work/error")"
fuel=$top/tests/data/fuel_64x33x32_uint8.raw.gz
for bad in "--ways full" "--ways default,,BCMC" "--size 0x3" "--views 0"; do
  # shellcheck disable=SC2086
  if "$program" bench pareto "$fuel" -i 40 $bad 2>"$work/error" >/dev/null; then
    fail "$bad was accepted"
  fi
  [ "$(wc -l <"$work/error")" -eq 1 ] || fail "$bad: $(cat "$work/error")"
done

"$program" bench topology generate:noisy_scan_64x64x64_uint8 -i 128 \
  --json "$work/parts.json" >"$work/out"
"$top/tools/charts" "$work/parts.json" -o "$work"
[ -s "$work/parts_topology.png" ] || fail "parts_topology.png is missing"
/usr/bin/python3 - "$work/parts.json" <<'EOF'
import json, sys
document = json.load(open(sys.argv[1]))
rows = {row["stored"]: row for row in document["rows"]}
assert document["components"] > 0 and len(rows) >= 9, document
coarse, fine = rows["level of detail 1"], rows["--rate 8"]
assert coarse["lost"] > fine["lost"], "coarse levels lose more than many bits"
EOF
if "$program" bench topology "$work/none.raw" -i 40 2>"$work/error"; then fail "no volume"; fi
[ "$(wc -l <"$work/error")" -eq 1 ] || fail "no volume: $(cat "$work/error")"

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
