#!/usr/bin/env bash
# paraview_test.sh <source folder> <build folder>: the package's reader in Debian's ParaView.
#
# Its packages cannot be installed beside the libvtk9-dev of `tools/setup --peer`. So they are
# unpacked into the build folder, with what they need beyond what is installed, and pvpython finds
# them by its environment. Runs after python_test.sh, whose virtual environment has the package.
# Exits with 77, and says why, if there is no ParaView for this machine.
set -euo pipefail
source=$1 build=$2
work=$build/paraview_test
python=$build/python_test/venv/bin/python

fail() {
  echo "paraview_test: $*" >&2
  exit 1
}
skip() {
  echo "paraview_test: not tested: $*"
  exit 77
}

[ -x "$python" ] || fail "there is no $python: run the test 'python' before"
command -v apt-get > /dev/null || skip 'there is no apt-get that would bring ParaView'
if [ ! -e "$work/complete" ]; then
  rm -rf "$work"
  mkdir -p "$work/packages" "$work/root"
  cd "$work/packages"
  # What an installation would bring; nothing is installed, and nothing removed.
  names=$(apt-get -s --no-install-recommends install python3-paraview python3-numpy \
    2> "$work/log" | sed -n 's/^Inst \([^ ]*\).*/\1/p')
  [ -n "$names" ] || skip "apt-get knows no python3-paraview: $(head -1 "$work/log")"
  # shellcheck disable=SC2086  # one word each
  apt-get download -qq $names > "$work/log" 2>&1 ||
    skip "python3-paraview cannot be downloaded: $(head -1 "$work/log")"
  for package in *.deb; do dpkg-deb -x "$package" "$work/root"; done
  rm -rf "$work/packages"
  touch "$work/complete"
fi

usr=$work/root/usr
libraries=$(find "$usr/lib" -name '*.so*' -printf '%h\n' | sort -u | tr '\n' ':')
cat > "$work/pvpython" << END
#!/bin/sh
export LD_LIBRARY_PATH="${libraries%:}"
export PYTHONPATH="$usr/lib/python3/dist-packages"
[ ! -d "$usr/lib/x86_64-linux-gnu/openmpi" ] || export OPAL_PREFIX="$usr"
exec "$usr/bin/pvpython" "\$@"
END
chmod +x "$work/pvpython"
"$work/pvpython" --version > "$work/log" 2>&1 || fail "pvpython does not start: $(cat "$work/log")"

cd "$work"
ISOWAVE_PVPYTHON=$work/pvpython "$python" -m pytest -q -rs -p no:cacheprovider \
  "$source/tools/python/tests/test_paraview.py" 2>&1 | tee "$work/log"
grep -q ' passed' "$work/log" || fail 'no test ran'
! grep -q ' skipped' "$work/log" || fail 'ParaView is there, and tests were skipped'
