#!/usr/bin/env bash
# wasm_test.sh <source folder> <build folder> <program>: the library that tools/wasm builds reads,
# compresses, draws and extracts under node with the bits of the program, which does so on a device.
# A page's engine draws rows and pictures with them.
#
# ISOWAVE_VOLUMES names a folder with further volumes (tools/test-volumes). This system's library
# draws them, too, from ten sides.
set -euo pipefail
source=$1 build=$2 program=$3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() {
  echo "$*"
  exit 1
}

quietly() { # quietly COMMAND...
  "$@" > "$work/log" 2>&1 || { cat "$work/log"; fail "$1 fails"; }
}

# shellcheck source=tests/same_bits.sh
. "$source/tests/same_bits.sh"

# Only what has changed since the last run is built.
export NODE_PATH=/usr/share/nodejs
quietly "$source/tools/wasm" "$build"
quietly emcmake cmake -G Ninja -S "$source/tests/host_only" -B "$work/user" \
  -DCMAKE_BUILD_TYPE=Release -DCMAKE_FIND_ROOT_PATH="$build/install;$build/prefix" \
  -DCMAKE_CXX_FLAGS="$(cat "$build/flags")"
quietly cmake --build "$work/user"

# Debian's emscripten writes for a node without fetch(). Node 22 has relaxed vectors without a flag.
node=(node --no-experimental-fetch)
host_only=("${node[@]}" "$work/user/host_only.js")
relaxed=--experimental-wasm-relaxed-simd
[[ $(node --v8-options) != *$relaxed* ]] || node+=("$relaxed")

same_as_device() { # same_as_device VOLUME ISOVALUE
  local volume=$source/tests/data/$1 isovalue=$2
  rm -rf "$work/wasm" "$work/native"
  mkdir "$work/wasm" "$work/native"
  quietly "${host_only[@]}" "$volume" "$isovalue" "$work/wasm"
  (
    cd "$work/native"
    quietly "$program" convert "$volume" -o volume.zfp
    quietly "$program" render "$volume" -i "$isovalue" --size 320x180 \
      -o picture.png --depth depth.npy
    quietly "$program" extract "$volume" -i "$isovalue" -o mesh.ply
    tail -c $((320 * 180 * 4)) depth.npy > depth
  )
  for file in volume.zfp picture.png depth mesh.ply; do
    cmp "$work/wasm/$file" "$work/native/$file" || fail "$1: $file of WebAssembly is another"
  done
}
# A page's worker draws the picture, too: whole, and in bands of rows; with the browser's own
# multiply-add, and with what takes its place.
same_picture() { # same_picture [--field FIELD.zfp] VOLUME OPTION...
  local field=()
  if [ "$1" = --field ]; then field=("$2") && shift 2; fi
  local volume=$source/tests/data/$1
  quietly "$program" render "$volume" "${@:2}" --size 96x54 --ambient 2 -o "$work/native.png" \
    --save-scene "$work/scene.json"
  for plain in '' plain; do
    quietly "${node[@]}" "$source/tests/page_engine.cjs" "$build/library/tools/page/engine.js" \
      "$source/tools/page/worker.js" "$volume" "$work/scene.json" "$work/native.png" \
      "${field[@]}" $plain
  done
}
fuel=fuel_64x33x32_uint8.raw.gz
same_picture $fuel -i 10
same_picture $fuel --surface 10,skin,0.4 --surface 90,blood
same_picture $fuel -i 10 --parallel
quietly "$program" convert "$source/tests/data/head_41x41x41_uint8.raw.gz" -o "$work/head.zfp"
same_picture --field "$work/head.zfp" $fuel -i 10 --color-by "$work/head.zfp,20,200"

same_as_device fuel_64x33x32_uint8.raw.gz 10
same_as_device head_41x41x41_uint8.raw.gz 90

if "${host_only[@]}" missing.nrrd 10 "$work" 2> "$work/error"; then
  fail 'a missing file is no error'
fi
[ "$(wc -l < "$work/error")" = 1 ] || fail "an error of $(wc -l < "$work/error") lines"

# both here|there FILE ISOVALUE: draws with one system's library in the current folder
both() {
  local user=("$work/native_user/host_only")
  [ "$1" = here ] || user=("${host_only[@]}")
  quietly "${user[@]}" "$2" "$3" . 10
}
volumes=$(real_volumes) || fail "$volumes"
if [ -n "$volumes" ]; then
  quietly cmake --install "$(dirname "$build")" --prefix "$work/prefix"
  quietly cmake -G Ninja -S "$source/tests/host_only" -B "$work/native_user" \
    -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$work/prefix"
  quietly cmake --build "$work/native_user"
  while read -r file isovalue; do
    same_bits WebAssembly 14 "$file" "$isovalue"
  done << END
$source/tests/data/fuel_64x33x32_uint8.raw.gz 10
$source/tests/data/head_41x41x41_uint8.raw.gz 90
$volumes
END
  echo "WebAssembly: $num_volumes volumes"
fi
