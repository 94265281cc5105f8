#!/usr/bin/env bash
# cross_wheel_test.sh <source folder> <program>: the wheel for ARM64 that tools/wheel makes draws
# with this machine's bits, in Debian's Python for ARM64, under QEMU. Ends with 77 if a tool is
# missing.
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

missing=$("$source/tools/cross" --missing aarch64)
if [ -n "$missing" ]; then
  echo "not tested: $missing is missing, which tools/setup --long installs"
  exit 77
fi
quietly "$source/tools/wheel" -o "$work/dist" --arch aarch64
wheel=$(echo "$work"/dist/isowave-*.whl)
[[ $wheel == *-manylinux_2_*_aarch64.whl ]] || fail "$wheel is not for manylinux on ARM64"
unzip -q "$wheel" -d "$work/package"
for file in "$work"/package/isowave/*.so "$work"/package/isowave.libs/*.so*; do
  [ "$(od -An -tx1 -j18 -N2 "$file")" = ' b7 00' ] || fail "$file is not for ARM64"
done
cat > "$work/draw.py" << 'END'
import sys

import isowave

volume = isowave.open(sys.argv[1], exact=True)
image = volume.render(10, size=(320, 180), device="host")
image.save(sys.argv[2])
volume.save(sys.argv[3])
print(isowave.Report())
END
fuel=$source/tests/data/fuel_64x33x32_uint8.raw.gz
aarch64=$source/build/aarch64
# The package has its libraries, but for those of every Linux, OpenCL's loader and numpy. Debian's
# numpy finds these by links that its packages would make when they are installed.
libraries=/usr/lib/aarch64-linux-gnu
export QEMU_SET_ENV=LD_LIBRARY_PATH=$libraries/blas:$libraries/lapack
PYTHONPATH=$work/package quietly "$aarch64/run" "$aarch64"/root/usr/bin/python3 "$work/draw.py" \
  "$fuel" "$work/there.png" "$work/there.zfp"
grep -q aarch64 "$work/log" || { cat "$work/log"; fail 'the report names another processor'; }
quietly "$program" render "$fuel" -i 10 --exact --size 320x180 --device host -o "$work/here.png"
quietly "$program" convert "$fuel" --exact -o "$work/here.zfp"
for file in png zfp; do
  cmp "$work/here.$file" "$work/there.$file" || fail "the wheel's .$file is another"
done
echo "$(basename "$wheel"): $(stat -c %s "$wheel") bytes"
