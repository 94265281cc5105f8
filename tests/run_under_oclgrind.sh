#!/usr/bin/env bash
# run_under_oclgrind.sh PROGRAM ARGUMENT...: runs a GoogleTest program on the Oclgrind simulator
# with its race and uninitialised-memory checks on, and fails when it reports anything. Reports are
# read from its standard error: the file of its --log is begun anew by every OpenCL context, and so
# by every test.
set -euo pipefail

log=$(mktemp)
trap 'rm -f "$log"' EXIT
# Oclgrind's library takes the loader's place: it is the only device.
unset ISOWAVE_DEVICE RUSTICL_ENABLE

status=0
oclgrind --build-options '-cl-opt-disable -DISO_CHECK_RACES=1' --data-races --uninitialized \
  --max-errors 100000 "$@" 2> "$log" || status=$?
cat "$log" >&2
if grep -q '^[[:space:]]*Kernel: ' "$log"; then
  echo 'run_under_oclgrind: Oclgrind reports the above' >&2
  status=1
fi
exit "$status"
