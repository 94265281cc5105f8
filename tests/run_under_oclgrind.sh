#!/usr/bin/env bash
# run_under_oclgrind.sh PROGRAM ARGUMENT...: runs a GoogleTest program on the Oclgrind simulator with its race and
# uninitialised-memory checks on. Oclgrind exits 0 whatever it found, so its log must be empty.
set -euo pipefail

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
unset ISOWAVE_DEVICE RUSTICL_ENABLE # Oclgrind's library takes the loader's place: it is the only device

status=0
oclgrind --build-options -cl-opt-disable --data-races --uninitialized --max-errors 20 --log "$folder/oclgrind.log" "$@" || status=$?
if [ -s "$folder/oclgrind.log" ]; then
  echo 'run_under_oclgrind: Oclgrind reports:' >&2
  cat "$folder/oclgrind.log" >&2
  status=1
fi
exit "$status"
