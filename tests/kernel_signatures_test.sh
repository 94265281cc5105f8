#!/usr/bin/env bash
# kernel_signatures_test.sh <source folder> <build folder>: the C++ types that
# tools/cmake/kernel_signatures.cmake makes of small kernel files, and what it refuses.
set -euo pipefail
script=$1/tools/cmake/embed_kernels_script.cmake
folder=$2/kernel_signatures_test
rm -rf "$folder"
mkdir -p "$folder/headers"

failed=0
fail() {
  echo "$*"
  failed=1
}

# embed <text>: embeds stage.cl with this text. Prints what CMake says.
embed() {
  echo "$1" > "$folder/stage.cl"
  cmake -D "output=$folder/kernels.cpp" -D "folder=$folder" -D "files=$folder/stage.cl" \
    -D "headers=$folder/headers" -P "$script" 2>&1
}

# gives <text of parameters> <C++ types>
gives() {
  embed "kernel void made($1) {}" || fail "refused: $1"
  local types
  types=$(sed 's|/\*[^/]*\*/||g' "$folder/headers/stage.hpp" | tr -d ' \n' |
    sed 's|.*usingParams=ocl::Params<\(.*\)>;};}//.*|\1|')
  [ "$types" = "$2" ] || fail "$1 gives $types"
}
gives "void" ""
gives "global const uint *a, constant Table *b, global float *c, volatile global ulong *d" \
  "ocl::In<uint>,ocl::In<Table>,ocl::Out<float>,ocl::Out<ulong>"
gives "const FrameParams a, uint
  b, local uchar *c" "FrameParams,uint,ocl::Local<uchar>"
gives "global ISO_WORDS(PassCounts) *a, global const ISO_WORDS(HitRecord) *b, global void *c" \
  "ocl::Out<PassCounts>,ocl::In<HitRecord>,ocl::Out<std::byte>"
gives "uint a /* b, global uint *c */, int d" "uint,int"

# refuses <text> <what the message says>
refuses() {
  local said
  if said=$(embed "$1"); then fail "accepted: $1"; fi
  grep -qF "  stage.cl: $2" <<< "$said" || fail "$1: $said"
}
for param in "uint *a" "global uint a" "global uint const *a" "global float3 *a" "float4 a" \
  "bool a" "size_t a" "global ISO_VOXEL *a" "ISO_WORDS(PassCounts) a" "global uint *restrict a" \
  "uint" "local void *a" "image2d_t a" "global uint **a" "uint a[4]"; do
  refuses "kernel void made(uint first, $param) {}" \
    "kernel made: no C++ type for the parameter '$param'; "
done
refuses "kernel void made(uint a) {} kernel void made(int a) {}" \
  "kernel made: another kernel has this name"
for text in "void kernel made(uint a) {}" \
  "kernel void made(uint a);" "kernel int made(uint a) {}"; do
  refuses "$text" "a kernel is declared as \`kernel void name(...) {\`, with attributes before"
done

# An edit that keeps the signature keeps the header's time.
embed "kernel void made(uint a) {}"
touch -d 2001-01-01 "$folder/headers/stage.hpp"
embed "/// Words. kernel
kernel void made(uint a) { a = 1; }"
[ "$(date -r "$folder/headers/stage.hpp" +%Y)" = 2001 ] || fail "the same header was written again"
embed "kernel void made(uint b, uint a) { a = 1; }"
[ "$(date -r "$folder/headers/stage.hpp" +%Y)" != 2001 ] || fail "another signature changed nothing"
exit "$failed"
