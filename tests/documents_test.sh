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

device=${ISOWAVE_DEVICE:-cpu}
"$programs/bench/isowave_bench" --device "$device" --benchmark_list_tests > "$work/cases"
PYTHONPATH=$top/tools /usr/bin/python3 -B - "$work/cases" << 'EOF' ||
import re, sys
from measuring.speed import KERNELS
cases = [line.strip() for line in open(sys.argv[1]) if "/" in line or line.strip() == "speculation"]
stems = {case.split("/")[0] for case in cases} - {"ocl_launch", "voxel_region"}  # no stages
assert len(stems) > 20, stems
left_out = [
    stem for stem in stems
    if not any(re.search("|".join(KERNELS), case) for case in cases if case.split("/")[0] == stem)
]
assert not left_out, left_out
EOF
  fail 'tools/measure leaves stages out'
measure() { "$top/tools/measure" --device "$device" --programs "$programs" --quick "$@"; }
mkdir -p "$work/top/results"
results=$work/top/results/a.json
measured() { # OPTION...: into the results
  measure -o "$results" "$@" > "$work/out" || fail "$(cat "$work/out")"
}
measured --only frames,normals,error,time,pareto_large,stability,sweep,paper,devices,cpus
measured --only storage,sizes,detail,solvers,pareto,topology --volumes "$top/tests/data"
tables=(frames normals error time cpus stability leaks storage sizes detail solvers
  solver_frames pareto pareto_ways pareto_spans
  pareto_large pareto_large_ways pareto_large_spans topology
  paper_claims paper_stand_ins paper_passes paper_times
  paper_published_passes paper_published_memory paper_progress paper_utilisation paper_scanned
  paper_limits paper_working_set paper_memory paper_blocks paper_scaling by_device)
brick_charts=()
if [ -x "$programs/bench/peer_bench" ]; then
  measured --only peer
  tables+=(peer)
fi
if [ -x "$programs/bench/gpu_peer" ]; then
  measured --only gpu_peer
  tables+=(gpu_peers)
fi
if [ -x "$programs/bench/brick_bench" ]; then
  export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
  measured --only bricks,bricks_alone
  tables+=(weak_scaling strong_scaling exact_scaling large_bricks bricks_by_themselves)
  brick_charts=(a_weak a_strong)
fi
for table in "${tables[@]}"; do
  printf '<!-- table: %s results/a.json -->\n<!-- end -->\n' "$table"
done > "$work/top/page.md"
/usr/bin/python3 - "$results" << 'EOF'
import json, sys
sections = json.load(open(sys.argv[1]))["sections"]
cases = [row for row in sections["stability"]["rows"] if "case" in row]
assert len(cases) > 20 and all(case["resumed_differently"] == 0 for case in cases), cases
def wrong(name):
    return sum(case["missed"][name] + case["false"][name] for case in cases)
assert wrong("bernstein") == 0 < wrong("linear"), "the default alone is right"
detail = {(row["rays"], row["voxel_pixels"]): row for row in sections["detail"]["rows"]}
assert detail[4, 0]["rms"] < detail[1, 0]["rms"], "more rays, less error"
coarse, one, four = [detail[key]["decoded_blocks"] for key in ((4, 1), (1, 0), (4, 0))]
assert coarse < one < four, detail
EOF
if grep -qF "$top/tests/data" "$results"; then fail 'the folder of the volumes is named'; fi
"$top/tools/charts" "$results" -o "$work" > "$work/out"
for chart in a_{cells,frames,pareto,pareto_{new,wrong,bytes},stability,topology,budgets} \
  a_{time,memory,speculation} "${brick_charts[@]}"; do
  [ -s "$work/$chart.png" ] || fail "$chart.png is missing"
done

tables() { "$top/tools/tables" --top "$work/top" "$@"; }
if tables --check 2> /dev/null; then fail 'empty tables are no difference'; fi
tables || fail 'tables cannot be made'
tables --check || fail 'tables differ from what they were made of'
made=$(grep -c '^|---' "$work/top/page.md")
[ "$made" -eq "${#tables[@]}" ] || fail "$(cat "$work/top/page.md")"
PYTHONPATH=$top/tools /usr/bin/python3 -B - << 'EOF'
from measuring.paper import ARTICLE, STAND_INS, in_collection, rate_of
assert set(STAND_INS.values()) == {"", *ARTICLE}, "each set of the article has a stand-in"
assert in_collection("richtmyer") == "Richtmyer-Meshkov" and in_collection("bonsai") is None
assert [rate_of(name) for name in ("Richtmyer-Meshkov", "Skull", "", None)] == [1, 4, 4, 4]
EOF
PYTHONPATH=$top/tools /usr/bin/python3 -B - << 'EOF'
import json, types
from measuring import bricks
def a_run(device, there):
    names = {"device": "GPU 1", "platform": "P"}
    listed = [{"name": "GPU 1", "platform": "P"}] * there + [{"name": "GPU 2", "platform": "P"}]
    options = types.SimpleNamespace(quick=False, on_cpu=False, device=device)
    say = lambda *_, **__: json.dumps(listed)
    return types.SimpleNamespace(options=options, machine=names, run=say)
assert [bricks.num_devices(a_run("GPU", n)) for n in (1, 4)] == [1, 4]
assert bricks.num_devices(a_run("0,1", 4)) == 2
def row(devices, cold, name="mixing_layer_8x8x8"):
    frames = {kind: {"picture_ms": {"median": cold}} for kind in bricks.KINDS}
    return {"volume": name, "storage": "rate 4", "size": [8, 8], "frames": frames,
            "ranks": [{}] * devices}
rows = [row(4, 4.0), row(1, 3.0), row(2, 2.0, "shell_8x8x8")]
(found,) = [found for key, found in bricks.series_of(rows).items() if key[0] == "mixing_layer"]
assert [len(one["ranks"]) for one in found] == [1, 4]
assert bricks.efficiency(found[1], found[0], "cold", False) == 0.75
assert bricks.efficiency(found[1], found[0], "cold", True) == 0.1875
bricks.measure = lambda run, field, dims, size, ranks, **storage: (field, dims, ranks)
assert bricks.bricks_large(a_run("GPU", 4)) == [("mixing_layer", "4096x4096x8192", 4)]
assert len(bricks.bricks_weak(a_run("GPU", 8))) == 12
EOF
PYTHONPATH=$top/tools /usr/bin/python3 -B - << 'EOF'
from measuring.gpu_peers import SIDES, gpu_peers
def row(name, device_bytes, **medians):
    spreads = {kind: {"median": ms, "min": 0, "max": 9} for kind, ms in medians.items()}
    others = {"missed": 0, "false": 1234, "distance_p99": 6e-5}
    return {"volume": "shell_8x8x8", "name": name, "ms": spreads, "device_bytes": device_bytes,
            "build_ms": 250, "max_voxel_error": 0.47, **others}
pictures = {"cold_picture": 5, "next_picture": 4, "warm_picture": 30}
ours = row("isowave_exact", 2**20, new=1.2, cold=1, next=0.8123, warm=0.6, **pictures)
peer = row("nanovdb_fpn_bits", 2**21, kernel=0.5441, hits=0.6, picture=0.7, new=1.1)
_, first, second = gpu_peers([ours, peer])
end = ("0.25", "0.47", "0, 1,234", "6.0e-05")
times = ("1.00 / 0.812 / 0.600", "5.00 / 4.00 / 30", "1.20")
assert first == ("shell 8^3", SIDES["isowave_exact"], *times, "1 MiB", *end), first
assert second[2:6] == ("0.544", "0.700", "1.10", "2 MiB"), second
EOF
for set in Skull 'TACC Turbulence' Kingsnake DNS Richtmyer-Meshkov; do
  [ "$(grep -c "^| $set |" "$work/top/page.md")" -eq 2 ] || fail "the article's $set is missing"
done

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
other_commit='s/"commit": "[^"]*"/"commit": "other"/'
sed "$other_commit" "$work/right/results/a.json" > "$work/top/results/b.json"
sed -i '$!b;s/$/\n<!-- table: frames results\/b.json -->\n<!-- end -->/' "$work/top/page.md"
must_fail 'another commit on the same page' 'commit other'
again
sed -i 's/table: time/table: tides/' "$work/top/page.md"
must_fail 'a table that there is not' 'no table tides'
again
sed -i 's/"residual_p99"/"residual"/' "$work/top/results/a.json"
must_fail 'rows that lack a number' 'section stability'
again
sed -i 's/"stability": {/"tides": {/' "$work/top/results/a.json"
must_fail 'a missing section' 'no section stability'

# refused NAME OPTION...: one line, and nothing is written.
refused() {
  if measure -o "$work/new.json" "${@:2}" > /dev/null 2> "$work/error"; then
    fail "$1 was accepted"
  fi
  [ "$(wc -l < "$work/error")" -eq 1 ] || fail "$1: $(cat "$work/error")"
  [ ! -e "$work/new.json" ] || fail "$1: something was written"
}
refused 'an unknown section' --only frames,tides
refused 'a missing folder' --only sizes --volumes "$work/none"
for section in bits oracles certified sizes detail solvers pareto topology vtk; do
  refused "$section without volumes" --only "$section"
done
refused 'VTK without its Python' --only vtk --volumes "$top/tests/data"
mkdir -p "$work/others/bench"
for program in isowave bench/frame_bench bench/isowave_bench; do
  ln -s "$programs/$program" "$work/others/$program"
done
refused 'a comparison without its program' --only peer --programs "$work/others"
refused 'programs that are not there' --only frames --programs "$work"
refused 'an unknown device' --only frames --device no_such_device
sed "$other_commit" "$work/right/results/a.json" > "$work/other.json"
if measure -o "$work/other.json" --only frames 2> "$work/error"; then fail 'commits were mixed'; fi
grep -q 'give another -o' "$work/error" || fail "$(cat "$work/error")"
