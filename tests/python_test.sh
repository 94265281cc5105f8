#!/usr/bin/env bash
# python_test.sh <source folder> <build folder> <program> <test>...: the Python package as users
# install it, without the tests that are named.
# Makes a wheel and installs it into a virtual environment, with what its tests need from PyPI;
# types, stubs, the package's tests; and where nothing of OpenCL is installed.
set -euo pipefail
source=$1 build=$2 program=$3
shift 3
long=("${@/#/--ignore=}")
work=$build/python_test
tests=$source/tools/python/tests

fail() {
  echo "python_test: $*" >&2
  exit 1
}
quietly() {
  "$@" > "$work/log" 2>&1 || { cat "$work/log" >&2; fail "failed: $*"; }
}

mkdir -p "$work"
rm -rf "$work/dist"
# The test wasm has made it.
export ISOWAVE_PAGE=$build/wasm/install/share/isowave/page.html.gz
quietly "$source/tools/wheel" -o "$work/dist" /usr/bin/python3
wheel=$(echo "$work"/dist/isowave-*.whl)
tag=$(/usr/bin/python3 -c 'import sys; v = "cp%d%d" % sys.version_info[:2]
print("cp312-abi3" if sys.version_info >= (3, 12) else f"{v}-{v}")')
[[ $wheel == *-$tag-manylinux_* ]] || fail "$wheel is not for $tag"
unzip -l "$wheel" isowave/page.html.gz > /dev/null || fail 'the wheel has no engine for pages'
unset ISOWAVE_PAGE
[ "$(stat -c %s "$wheel")" -lt 2900000 ] || fail "the wheel has $(stat -c %s "$wheel") bytes"
unzip -l "$wheel" | grep -iE 'embree|gmp|itk|gomp' &&
  fail 'the wheel has what a renderer does not need'

[ -x "$work/venv/bin/python" ] || /usr/bin/python3 -m venv "$work/venv"
python=$work/venv/bin/python
quietly "$python" -m pip install --quiet --upgrade pip
# Most of what is in these packages is never imported: compiling it takes half a minute.
quietly "$python" -m pip install --quiet --no-compile -r "$tests/requirements.txt" \
  -r "$tests/requirements-viewer.txt"
quietly "$python" -m pip install --quiet --force-reinstall --no-deps "$wheel"

"$python" -m mypy --config-file "$source/pyproject.toml" --cache-dir "$work/mypy" \
  "$source/tools/python/isowave"
cd "$work"  # not among the sources, whose folder has no compiled part
ISOWAVE_PROGRAM=$program "$python" -m pytest -q -p no:cacheprovider --durations 40 \
  "${long[@]}" "$tests"

# On a machine without any OpenCL: PoCL comes from PyPI, the loader with the wheel.
if ! unshare --mount true 2> /dev/null; then
  echo 'python_test: not tested where no OpenCL is installed: hiding it needs a mount namespace'
  exit 0
fi
rm -rf "$work/fresh"
/usr/bin/python3 -m venv --without-pip "$work/fresh"
quietly "$python" -m pip --python "$work/fresh/bin/python" install --quiet --no-compile \
  "$wheel[cpu]"
loader=$(ldconfig -p | sed -n '0,/libOpenCL.so.1 /s/.*libOpenCL.so.1 .*=> //p')
cat > "$work/picture.py" << 'END'
import sys

import isowave

volume = isowave.open(sys.argv[1], exact=True)
try:
    image = volume.render(10, size=(320, 240), device="cpu")
except isowave.Error as error:  # PyPI's PoCL is of 2022
    if "this driver is older than the processor" not in str(error):
        raise
    image = volume.render(10, size=(320, 240), device="host")
    print(error)
image.save(sys.argv[2])
print(isowave.Report())
END
cat > "$work/hidden.sh" << 'END'
mount -t tmpfs none /etc/OpenCL
mount --bind "$0" "$1"  # no loader
shift
exec "$@"
END
fuel=$source/tests/data/fuel_64x33x32_uint8.raw.gz
unshare --mount bash "$work/hidden.sh" "$loader" env HOME="$work" XDG_CACHE_HOME="$work/cache" \
  "$work/fresh/bin/python" "$work/picture.py" "$fuel" "$work/hidden.png" > "$work/report" 2>&1 ||
  { cat "$work/report"; fail 'no picture where OpenCL is hidden'; }
grep -q 'opencl/libOpenCL.so.1' "$work/report" ||
  fail "not the wheel's loader: $(cat "$work/report")"
"$program" render "$fuel" -i 10 --exact --size 320x240 --device cpu -o "$work/program.png" \
  > /dev/null
cmp "$work/hidden.png" "$work/program.png" || fail "the wheel's picture is not the program's"
