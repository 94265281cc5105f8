#!/usr/bin/env bash
# peer_pictures_test.sh ISOWAVE PROGRAM...: with --pictures, peer_bench and gpu_peer (the PROGRAMs,
# gpu_peer with --host-check) write the pictures of all their sides. Ours are those of `isowave
# render`, the peers' are close to them, and bad folders are one line.
set -euo pipefail
isowave=$1
device=${ISOWAVE_DEVICE:-cpu}
top=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() {
  echo "peer_pictures_test: $*" >&2
  exit 1
}

# The program, with what is its own.
draw() { # PROGRAM VOLUME OPTION...
  case "$1" in
    *gpu_peer) "$1" "$2" --host-check "${@:3}" ;;
    *) "$1" --volume "$2" "${@:3}" ;;
  esac
}

# refused NAME WORDS PROGRAM OPTION...: one line that has the words, and nothing is written.
refused() {
  if draw "$3" "${@:4}" --json "$work/new.json" > /dev/null 2> "$work/error"; then
    fail "$1 was accepted"
  fi
  [ "$(wc -l < "$work/error")" -eq 1 ] || fail "$1: $(cat "$work/error")"
  grep -qF -- "$2" "$work/error" || fail "$1: $(cat "$work/error")"
  [ ! -e "$work/new.json" ] || fail "$1: something was written"
}

# check_pictures PROGRAM NAME VOLUME ISOVALUE: all sides' pictures of two views.
check_pictures() {
  local pictures=$work/$2
  mkdir "$pictures"
  draw "$1" "$3" --isovalue "$4" --size 160x90 --views 2 --rounds 1 --device "$device" \
    --pictures "$pictures" --json "$pictures.json" > "$work/out" || fail "$(cat "$work/out")"
  for normals in smooth cell; do
    "$isowave" render "$3" --isovalue "$4" --size 160x90 --orbit 2 --device "$device" \
      --normals "$normals" -o "$work/$normals.png" > "$work/out" || fail "$(cat "$work/out")"
  done
  /usr/bin/python3 - "$isowave" "$pictures" "$work" "$3" "$4" << 'END'
import json, os, subprocess, sys

isowave, folder, work, volume, isovalue = sys.argv[1:]
peers = json.load(open(folder + ".json"))["pareto_peers"]
of_sides = {name for peer in peers for name in peer["pictures"]}
assert of_sides == set(os.listdir(folder)), (of_sides, os.listdir(folder))


def compared(true, picture):
    command = [isowave, "compare", "--json", true, picture]
    return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)


smooth, cells = (
    [f"{work}/{normals}_iso{isovalue}_view{view}.png" for view in (0, 1)]
    for normals in ("smooth", "cell")
)
assert compared(*smooth)["flip"] > 0.05, "the views are alike"
for peer in peers:
    assert peer["volume"] == volume and peer["isovalue"] == float(isovalue), peer
    assert (peer["size"], peer["views"], len(peer["pictures"])) == ([160, 90], 2, 2), peer
    assert peer["bytes"] > 0 and min(peer["ms"].values()) > 0, peer
    side = peer["side"]
    is_resident = side.startswith(("texture", "nanovdb"))
    kinds = {"new" if is_resident else "cold", "next", "warm"}
    assert set(peer["ms"]) == kinds, peer
    for true, cell, name in zip(smooth, cells, peer["pictures"]):
        difference = compared(true, f"{folder}/{name}")
        print(side, difference["differing"], difference["flip"])
        if side in ("host", "rays", "blocks", "isowave_exact"):
            assert difference["differing"] == 0, (name, difference)
        else:
            # Textures differ by single rays. Triangles and quantized voxels are the surface of
            # another field, but nearer than a picture without smooth normals.
            most = 0.001 if side.startswith("texture") else compared(true, cell)["flip"]
            assert difference["flip"] < most, (name, difference)
            assert not side.startswith("mesh") or difference["differing"] > 0, f"{name}: no mesh"
END
}

fuel=$top/tests/data/fuel_64x33x32_uint8.raw.gz
turned=$work/turned.nhdr # the fuel, of other spacing, turned about z
cat > "$turned" << END
NRRD0004
type: uint8
dimension: 3
space dimension: 3
sizes: 64 33 32
space directions: (0.8,0.6,0) (-0.9,1.2,0) (0,0,2)
space origin: (5,6,7)
encoding: gzip
data file: $fuel
END
for program in "${@:2}"; do
  name=$(basename "$program")
  check_pictures "$program" "${name}_turned" "$turned" 40
  check_pictures "$program" "${name}_noise" generate:mixing_layer_40x48x36_uint8 128
  refused 'a missing folder' "$work/none is no folder" "$program" "$fuel" --isovalue 40 \
    --pictures "$work/none"
  refused 'a file' "$work/$name.json is no folder" "$program" "$fuel" --isovalue 40 \
    --pictures "$work/$name.json"
  refused 'no isovalue' --isovalue "$program" "$fuel" --pictures "$work"
done
if [[ " $* " == *gpu_peer* ]]; then
  refused 'a side of other volumes' 'only of volumes of uint8' "${@: -1}" \
    generate:mixing_layer_16x16x16_float32 --isovalue 128 --peers texture_uint8
fi
if [[ " $* " == *peer_bench* ]]; then
  refused 'no views' '--views 0' "$2" "$fuel" --isovalue 40 --pictures "$work" --views 0
fi
