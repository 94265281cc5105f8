#!/usr/bin/env bash
# sanitized_oracles_test.sh <source folder> <filter>: builds the oracles, too, with AddressSanitizer
# and UndefinedBehaviorSanitizer, and runs the cases that match.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake -G Ninja -S "$1" -B "$work" -DCMAKE_BUILD_TYPE=Release -DISOWAVE_BUILD_BENCHMARKS=OFF \
  -DCMAKE_CXX_FLAGS='-fsanitize=address,undefined -fno-sanitize-recover=all -O1 -g1' \
  > "$work/log" || {
  cat "$work/log"
  exit 1
}
cmake --build "$work" --target isowave_tests
"$work/tests/isowave_tests" --gtest_brief=1 --gtest_filter="$2"
