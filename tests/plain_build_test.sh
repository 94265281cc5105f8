#!/usr/bin/env bash
# plain_build_test.sh <source folder>: every file compiles by itself, without precompiled headers,
# so each includes what it uses.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake -G Ninja -S "$1" -B "$work" -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS=-O0 \
  -DISOWAVE_UNITY=OFF -DISOWAVE_BUILD_TESTS=OFF -DISOWAVE_BUILD_BENCHMARKS=OFF > "$work/log" || {
  cat "$work/log"
  exit 1
}
cmake --build "$work"
