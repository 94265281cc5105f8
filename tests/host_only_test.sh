#!/usr/bin/env bash
# host_only_test.sh <source folder> <program>: a library without OpenCL and oneTBB builds where
# neither is installed, has no symbol of either, and reads, compresses, draws and extracts with the
# bits of the program, which does so on a device.
set -euo pipefail
source=$1 program=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() {
  echo "$*"
  exit 1
}

quietly() { # quietly COMMAND...
  "$@" > "$work/log" 2>&1 || { cat "$work/log"; fail "$1 fails"; }
}

configure() { # configure SOURCE BUILD OPTION...
  quietly cmake -G Ninja -S "$1" -B "$2" -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS='-O1 -g0' \
    -DCMAKE_DISABLE_FIND_PACKAGE_OpenCL=ON -DCMAKE_DISABLE_FIND_PACKAGE_TBB=ON "${@:3}"
}

# has_none FILE: it names no function of OpenCL or oneTBB.
foreign=' (cl[A-Z][A-Za-z]*|[^ ]*3tbb[^ ]*)$'
has_none() {
  nm "$1" > "$work/symbols" 2> "$work/log"
  grep -q isowave "$work/symbols" || fail "nm finds nothing in $1"
  if grep -E "$foreign" "$work/symbols"; then fail "$1 needs OpenCL or oneTBB"; fi
}
for line in '                 U clGetPlatformIDs' '    U _ZN3tbb6detail2r18allocateERPNS0_2d0E'; do
  grep -qE "$foreign" <<< "$line" || fail "a foreign symbol is not found: $line"
done

configure "$source" "$work/build" -DISOWAVE_OPENCL=OFF -DISOWAVE_TBB=OFF
quietly cmake --build "$work/build"
has_none "$work/build/libisowave.a"
quietly cmake --install "$work/build" --prefix "$work/prefix"
for header in bricks device extract isowave make_renderer quick_renderer; do
  [ ! -e "$work/prefix/include/isowave/$header.hpp" ] ||
    fail "$header.hpp, which needs a device, is installed"
done
configure "$source/tests/host_only" "$work/user" -DCMAKE_PREFIX_PATH="$work/prefix"
quietly cmake --build "$work/user"
has_none "$work/user/host_only"
if ldd "$work/user/host_only" | grep -E 'OpenCL|tbb'; then fail 'it links OpenCL or oneTBB'; fi

mkdir "$work/host" "$work/device"
volume=$source/tests/data/fuel_64x33x32_uint8.raw.gz
quietly "$work/user/host_only" "$volume" 10 "$work/host"
cd "$work/device"
quietly "$program" convert "$volume" -o volume.zfp
quietly "$program" render "$volume" -i 10 --size 320x180 -o picture.png --depth depth.npy
quietly "$program" extract "$volume" -i 10 -o mesh.ply
tail -c $((320 * 180 * 4)) depth.npy > depth
for file in volume.zfp picture.png depth mesh.ply; do
  cmp "$work/host/$file" "$file" || fail "the host's $file is not the device's"
done
if "$work/user/host_only" missing.nrrd 10 . 2> error; then fail 'a missing file is no error'; fi
[ "$(wc -l < error)" = 1 ] || fail "an error of $(wc -l < error) lines"
