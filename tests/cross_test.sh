#!/usr/bin/env bash
# cross_test.sh SYSTEM <source folder> <build folder> <program>: what tools/cross builds for another
# system reads, compresses, draws and extracts with the bits of this system's library and program.
# Each volume is drawn from ten sides. Ends with 77 if a tool is missing.
#
# ISOWAVE_VOLUMES names a folder with further volumes, those of tools/test-volumes.
set -euo pipefail
system=$1 source=$2 build=$2/build/$1 native_build=$3 program=$4
# Wine hands this machine's devices on; QEMU does not.
unset ISOWAVE_DEVICE
export OCL_ICD_VENDORS=/nonexistent
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

missing=$("$source/tools/cross" --missing "$system")
if [ -n "$missing" ]; then
  echo "not tested: $missing is missing, which tools/setup --long installs"
  exit 77
fi
# Only what has changed since the last run is built.
quietly "$source/tools/cross" "$system" "$build"

compile_user() { # compile_user FOLDER OPTION...: tests/host_only
  quietly cmake -G Ninja -S "$source/tests/host_only" -B "$1" -DCMAKE_BUILD_TYPE=Release "${@:2}"
  quietly cmake --build "$1"
}
compile_user "$work/user" -DCMAKE_TOOLCHAIN_FILE="$build/toolchain.cmake"
ending=
[ "$system" != windows ] || ending=.exe
there=$build/install/bin/isowave$ending
user=$work/user/host_only$ending
kind=$(od -An -tx1 -N4 "$user" | tr -d ' ')
case $system in
  aarch64) [ "$kind" = 7f454c46 ] || fail "host_only is no ELF file: $kind" ;;
  windows) [ "${kind:0:4}" = 4d5a ] || fail "host_only is no file of Windows: $kind" ;;
  macos)
    [ "$kind" = cffaedfe ] || fail "host_only is no Mach-O file: $kind"
    exit 0 # nothing here runs it
    ;;
esac

quietly cmake --install "$native_build" --prefix "$work/prefix"
compile_user "$work/native_user" -DCMAKE_PREFIX_PATH="$work/prefix"

# both NAME FILE ISOVALUE: runs library and program of one system in the current folder
both() {
  local run=() user_here=$work/native_user/host_only program_here=$program
  if [ "$1" = there ]; then run=("$build/run") user_here=$user program_here=$there; fi
  quietly "${run[@]}" "$user_here" "$2" "$3" . 10
  quietly "${run[@]}" "$program_here" convert "$2" --rate 6 --levels all -o lossy.zfp
  quietly "${run[@]}" "$program_here" render lossy.zfp -i "$3" --size 160x90 --device host \
    --voxel-pixels 2 --samples 2 --ambient 2 --normals cell --depth lossy.npy -o lossy.png
}

same_bits "$system" 17 "$source/tests/data/fuel_64x33x32_uint8.raw.gz" 10
same_bits "$system" 17 "$source/tests/data/head_41x41x41_uint8.raw.gz" 90
volumes=$(real_volumes) || fail "$volumes"
while read -r file isovalue; do
  [ -z "$file" ] || same_bits "$system" 17 "$file" "$isovalue"
done <<< "$volumes"

cd "$work"
one_line() { # one_line ARGUMENT...: both programs fail, and say so in the same line
  if "$build/run" "$there" "$@" > out 2> error; then fail "no error: $*"; fi
  if "$program" "$@" > out 2> expected; then fail "no error: $*"; fi
  [ "$(wc -l < error)" = 1 ] || { cat error; fail "an error of $(wc -l < error) lines: $*"; }
  diff expected error || fail "another error: $*"
}
fuel=$source/tests/data/fuel_64x33x32_uint8.raw.gz
head -c 1000 "$work/here/volume.zfp" > cut.zfp
one_line info missing.nrrd
one_line info cut.zfp
one_line info .
one_line render "$fuel" --isovalue high
one_line render "$fuel" -i 10 --device cpu -o none.png
one_line render "$fuel" -i 10 -o missing/picture.png
[ ! -e none.png ] || fail 'a picture without a device'

# Names of files.
folder='with blanks, ä, 漢 and 🫖'
mkdir "$folder"
cp "$fuel" "$folder/a b_64x33x32_uint8.raw.gz"
quietly "$build/run" "$there" convert "$folder/a b_64x33x32_uint8.raw.gz" -o "$folder/c d.zfp"
quietly "$program" convert "$fuel" -o native.zfp
cmp native.zfp "$folder/c d.zfp" || fail 'a file whose name has blanks and other letters is another'
one_line info "$folder/e f.zfp"
[ "$(find "$folder" -name '.isowave*')" = '' ] || fail 'a temporary file is left'
echo "$system: $num_volumes volumes"
