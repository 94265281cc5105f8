#!/usr/bin/env bash
# rooms_test.sh <source folder>: the table of core/README.md names every room of core/, and no room
# includes a header of a room below it in the table. kernels_cl/portable includes nothing but
# itself. Only core/platform calls the system. Threads wait by core/base/wait_while.hpp alone, and
# functions of angles are those of core/view/trigonometry.hpp. The tests that core/README.md names
# are there.
set -euo pipefail
cd "$1"

failed=0
fail() {
  echo "$*"
  failed=1
}

mapfile -t rooms < <(sed -n 's/^| `\([a-z]*\)` |.*/\1/p' core/README.md)
declare -A place
for i in "${!rooms[@]}"; do place[${rooms[i]}]=$i; done
[ "${#rooms[@]}" -gt 0 ] || fail "core/README.md has no table of rooms"

for folder in core/*/; do
  room=$(basename "$folder")
  [ -n "${place[$room]:-}" ] || fail "core/README.md does not name the room $room"
done
while IFS=: read -r file include; do
  from=$(cut -d/ -f2 <<<"$file")
  to=$(sed 's|#include "core/\([a-z]*\)/.*|\1|' <<<"$include")
  if [ -z "${place[$to]:-}" ] || [ "${place[$to]}" -gt "${place[$from]}" ]; then
    fail "$file: $include: $to is not above $from in core/README.md"
  fi
done < <(grep -roE '^#include "core/[^"]*"' core)
while IFS=: read -r file include; do
  name=$(sed 's|.*"\(.*\)"|\1|' <<<"$include")
  [ -f "kernels_cl/portable/$name" ] ||
    fail "$file: $include: a portable header includes portable ones alone"
done < <(grep -roE '^#include "[^"]*"' kernels_cl/portable)
while IFS=: read -r file include; do
  fail "$file: $include: the host includes portable headers alone"
done < <(grep -rnoE '^#include "kernels_cl/(device|probes)?/?[a-z_]*\.[a-z]*"' \
  core reference tests tools bench --include=*.?pp |
  grep -v 'kernels_cl/portable/' | sed 's/:[0-9]*:/:/')
# Headers and functions of the system, beside those of the C++ standard. The Python module is
# compiled with the public headers alone.
headers='aio|arpa/.*|dirent|dlfcn|elf|execinfo|fcntl|ftw|grp|link|malloc|mntent|net.*|poll|pthread'
headers+='|pwd|sched|semaphore|signal|spawn|sys/.*|syslog|termios|ucontext|unistd|utime|windows'
functions='fileno|fdopen|fseeko|ftello|mkdtemp|mkstemp|popen|putenv|setenv|unsetenv'
calls="#include <(csignal|($headers)\\.h)>|\\b($functions)\\(|\"/(proc|dev)/"
must_call() { # 0|1 LINE
  [ "$(grep -cE "$calls" <<< "$2")" -eq "$1" ] || fail "rooms_test: not $1 call of the system: $2"
}
must_call 1 '#include <sys/mman.h>'
must_call 1 '#include <csignal>'
must_call 1 '  ::setenv(name, value, 1);'
must_call 0 '#include <string>'
while read -r line; do
  fail "$line: only core/platform calls the system"
done < <(grep -rnE "$calls" core tools --include=*.?pp |
  grep -vE '^(core/platform/|tools/python/[a-z]+\.[ch]pp:)')
while read -r line; do
  fail "$line: std::atomic::wait() may wait for ever; core/base/wait_while.hpp does not"
done < <(grep -rnE '\.notify_(all|one)\(' core --include=*.?pp |
  grep -v '^core/base/wait_while.cpp:')
while read -r line; do
  fail "$line: the last bit differs on other systems; core/view/trigonometry.hpp has the same"
done < <(grep -rnE '\b(std::a?(sin|cos|tan2?)|glm::(angleAxis|rotate))\(' core --include=*.?pp |
  grep -vE '^core/(view/trigonometry|sources/[a-z_]+)\.cpp:')
while IFS=. read -r suite name; do
  grep -qE "^TEST(_F|_P)?\\($suite, $name\\)" tests/*_test.cpp ||
    fail "core/README.md: there is no test $suite.$name"
done < <(grep -oE '`[A-Z][A-Za-z]+\.[A-Z][A-Za-z]+`' core/README.md | tr -d '\`')
while read -r name; do
  grep -qr "^def $name(" tools/python/tests || fail "core/README.md: there is no test $name"
done < <(grep -oE '`test_[a-z_]+`' core/README.md | tr -d '\`')
exit "$failed"
