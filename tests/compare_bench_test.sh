#!/usr/bin/env bash
# tools/compare-bench on files written by hand, and on real ones if the benchmarks are built.
#   compare_bench_test.sh [FRAME_BENCH ISOWAVE_BENCH]
set -euo pipefail
top=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

fail() {
  echo "compare_bench_test: $1" >&2
  exit 1
}

# compare STATUS ARGUMENT...: exit status as expected; output in `out`.
compare() {
  local expected=$1 status=0
  shift
  "$top/tools/compare-bench" "$@" >out 2>error || status=$?
  [ "$status" -eq "$expected" ] ||
    fail "$*: exit status $status, expected $expected: $(cat out error)"
  if [ "$status" -eq 1 ]; then
    [ "$(wc -l <error)" -eq 1 ] || fail "$*: not one line: $(cat error)"
    [ ! -s out ] || fail "$*: output although it fails: $(cat out)"
  else
    [ ! -s error ] || fail "$*: $(cat error)"
  fi
}

# row NAME PATTERN: the table's row of NAME matches.
row() {
  grep -E "^$1 +$2\$" out >/dev/null || fail "no row '$1 $2' in: $(cat out)"
}

# Files of both kinds. google FILE NAME=MS,MS.. [NAME=MS~SPREAD%] [NAME=failed]; frames FILE
# MS,MS,MS (the rounds) GROUP_MS [FLOOR_MS or null]
cat >write.py <<'END'
import json, statistics, sys
kind, path, *rest = sys.argv[1:]
if kind == "google":
    runs = []
    for name, text in (argument.split("=") for argument in rest):
        common = {"name": name, "run_name": name, "run_type": "iteration", "time_unit": "us"}
        common["iterations"] = 100
        if text == "failed":
            runs.append(common | {"error_occurred": True, "error_message": "wrong result"})
        elif "~" in text:
            ms, spread = map(float, text.split("~"))
            runs.append(common | {"real_time": 1000 * ms, "spread_%": spread})
        else:
            runs += [common | {"real_time": 1000 * float(ms)} for ms in text.split(",")]
            if "," in text:
                spread = {"run_type": "aggregate", "aggregate_name": "cv", "real_time": 0.01}
                runs.append(common | spread)
    document = {"context": {"date": "today", "device": path}, "benchmarks": runs}
else:
    rounds, group = [float(ms) for ms in rest[0].split(",")], float(rest[1])
    def view(factor):
        times = [{"total_ms": factor * ms, "hits_ms": factor * ms / 2} for ms in rounds]
        return {"cold": times, "warm": times}
    frames = [view(factor) for factor in (0.5, 1, 2)]
    spread = {"median": statistics.median(rounds), "min": 0.5 * min(rounds), "max": 2 * max(rounds)}
    document = {"program": "frame_bench", "context": {"device": "d"}, "options": {"grouping": path},
                "total_ms": {"cold": spread, "warm": spread}, "frames": frames, "setup_ms": 7.0,
                "hits_ms": {kind: {key: ms / 2 for key, ms in spread.items()}
                            for kind in ("cold", "warm")},
                "stage_ms": {"group": {"median": group, "min": 0.9 * group, "max": 1.1 * group}},
                "median": {"passes": 3, "decoded_blocks": 100}, "memory": {"peak": 1 << 20}}
    if len(rest) > 2:
        floor = json.loads(rest[2])
        views = floor and 3 * [[0.9 * floor, floor, 1.1 * floor]]
        document["resident_floor"] = floor and {"median": floor, "frames": views}
json.dump(document, open(path, "w"))
END
write() { /usr/bin/python3 write.py "$@"; }

# ---- Google Benchmark
write google old.json slow=10,10.5,11 fast=10,10.5,11 noise=10,10.5,11 quartiles=10~4 once=10 \
  gone=1 breaks=1
write google new.json slow=12,12.1,13 fast=5,5.1,5.2 noise=9,10.9,12 quartiles=10.3~4 once=11 \
  added=1 breaks=failed
compare 0 old.json new.json
grep -q 'device: old.json -> new.json' out || fail "the devices differ: $(cat out)"
row slow '10.5 +12.1 +1.152 +\(1.091..1.300\) +slower'
row fast '10.5 +5.1 +0.486 +\(0.455..0.520\) +faster'
row noise '10.5 +10.9 +1.038 +\(0.818..1.200\)'
row quartiles '10 +10.3 +1.030 +\(0.990..1.072\)'
row once '10 +11 +1.100 +slower\?'
row breaks '1 +failed'
grep -q 'only in old.json: gone$' out || fail "a name of OLD alone: $(cat out)"
grep -q 'only in new.json: added$' out || fail "a name of NEW alone: $(cat out)"
grep -q '1 faster, 2 slower' out || fail "the sum: $(cat out)"
compare 2 old.json new.json --fail
compare 0 old.json old.json --fail # what failed before does not count
row slow '10.5 +10.5 +1.000 +\(0.909..1.100\)'

write google slower.json slow=12,12.1,13
compare 2 old.json slower.json --fail
compare 2 old.json slower.json --fail --threshold 15
compare 0 old.json slower.json --threshold 15
row slow '10.5 +12.1 +1.152 +\(1.091..1.300\) +slower'
compare 0 old.json slower.json --fail --threshold 16
row slow '10.5 +12.1 +1.152 +\(1.091..1.300\)'
write google noisy.json noise=9,12,40 quartiles=10.3~4 fast=1,1,1
compare 0 old.json noisy.json --fail
write google once.json once=11
compare 2 old.json once.json --fail --threshold 5

# ---- frame_bench
write frames radix.json 10,10.2,10.4 0.8
write frames counting.json 9.8,9.9,10.1 0.2
compare 0 radix.json counting.json --fail
grep -q 'grouping: radix.json -> counting.json' out || fail "the options differ: $(cat out)"
row frame/cold '10.2 +9.9 +0.971 +\(0.942..1.010\)'
row stage/group '0.8 +0.2 +0.250 +\(0.205..0.306\) +faster'
row setup '7 +7 +1.000'
row passes '3 +3 +1.000'
compare 2 counting.json radix.json --fail
row stage/group '0.2 +0.8 +4.000 +\(3.273..4.889\) +slower'
write frames slow.json 20,21,22 0.8
compare 2 radix.json slow.json --fail
row frame/warm '10.2 +21 +2.059 +\(1.923..2.200\) +slower'

sed 's/"hits_ms"/"other"/g' slow.json >hits_alone.json
compare 2 radix.json hits_alone.json --fail # 5.1 ms until hits, and 21 ms
row hits/warm '5.1 +21 +4.118 +.* +slower'
! grep -q '^frame/' out || fail "no time until pictures: $(cat out)"

write frames floor.json 20,21,22 0.8 5
write frames floorless.json 20,21,22 0.8 null
compare 0 floor.json floor.json
row 'resident floor' '5 +5 +1.000 +\(0.818..1.222\)'
compare 0 slow.json floor.json # of before the floor
grep -q 'only in floor.json: resident floor$' out || fail "the floor of NEW alone: $(cat out)"
compare 0 floor.json floorless.json --fail
grep -q 'only in floor.json: resident floor$' out || fail "the floor of OLD alone: $(cat out)"

# ---- files that cannot be compared
echo '{' >broken.json
echo '[]' >list.json
echo '{"benchmark": "solvers", "schema": 1}' >charts.json
echo '{"context": {}, "benchmarks": []}' >empty.json
echo '{"context": {}, "benchmarks": [{"name": "slow"}]}' >incomplete.json
echo '{"context": {}, "benchmarks": 5}' >five.json
slow='"name": "slow", "iterations": 9'
echo '{"context": {}, "benchmarks": [{'"$slow"', "real_time": NaN, "time_unit": "ms"}]}' >nan.json
echo '{"context": {}, "benchmarks": [{'"$slow"', "real_time": 1, "time_unit": "y"}]}' >years.json
echo '{"program": "frame_bench"}' >frameless.json
printf '\xff\xfe' >binary.json
write google other.json other=1,2,3
for bad in none.json . broken.json list.json charts.json empty.json incomplete.json five.json \
  nan.json years.json frameless.json binary.json other.json radix.json; do
  compare 1 old.json "$bad"
  compare 1 "$bad" old.json --fail
done
compare 1 old.json
compare 1 old.json new.json --threshold -1
compare 1 old.json new.json --threshold nan
compare 1 old.json new.json --treshold
compare 1 old.json new.json new.json

# ---- real files
if [ $# -eq 2 ]; then
  "$1" generate:gyroid_16x16x16_uint8 --size 32x24 --orbit 2 --json real_frames.json >/dev/null
  compare 0 real_frames.json real_frames.json --fail
  row frame/cold '.* 1.000 .*'
  row stage/march '.* 1.000'
  row 'resident floor' '.* 1.000 .*'
  "$1" generate:gyroid_16x16x16_uint8 --size 32x24 --orbit 2 --no-resident \
    --json no_resident.json >out
  ! grep -q '^resident floor' out || fail "--no-resident: $(cat out)"
  compare 0 real_frames.json no_resident.json
  "$2" --benchmark_filter='scan/exclusive/entries:450' --benchmark_out=real_stages.json \
    >/dev/null 2>&1
  compare 0 real_stages.json real_stages.json --fail
  row 'scan/exclusive/entries:450[^ ]*' '.* 1.000 .*'
fi
