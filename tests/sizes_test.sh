#!/usr/bin/env bash
# sizes_test.sh <source folder>: no line of a text that people write is wider than 100 columns, no
# source has more than 600 lines, and no function of a kernel or of Python has more than 80
# beside its docstring (.clang-tidy says the same of functions in C++). May be wider: rows of tables
# in Markdown, and lines with a link.
set -euo pipefail
cd "$1"
export LC_ALL=C.UTF-8

# too_wide FILE...: names the lines.
too_wide() {
  grep -HnE '^.{101}' "$@" | grep -vE '^[^:]*\.md:[0-9]+:\||https?://|\]\(' | cut -c1-160
}
# too_long FILE...: names the files.
too_long() {
  awk 'FNR == 601 { print FILENAME ": has more than 600 lines" }' "$@"
}
# long_kernels FILE...: names the functions, which end with the next } at the beginning of a line.
long_kernels() {
  awk 'FNR == 1 { begin = 0 }
       /\{$/ && !begin { begin = FNR }
       /^\}/ { if (FNR - begin >= 80) print FILENAME ":" begin ": has more than 80 lines"
               begin = 0 }' "$@"
}
# long_functions FILE...: names those of Python.
long_functions() {
  /usr/bin/python3 - "$@" << 'EOF'
import ast, sys

for path in sys.argv[1:]:
    for node in ast.walk(ast.parse(open(path, encoding="utf-8").read())):
        is_function = isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
        if not is_function:
            continue
        is_documented = ast.get_docstring(node) is not None
        doc_lines = node.body[0].end_lineno - node.body[0].lineno + 1 if is_documented else 0
        if node.end_lineno - node.lineno - doc_lines >= 80:
            print(f"{path}:{node.lineno}: {node.name} has more than 80 lines")
EOF
}

# must_find 0|1 CHECK TEXT: whether a check finds a file of that text.
sample=$(mktemp)
trap 'rm -f "$sample"' EXIT
must_find() {
  printf '%s\n' "$3" > "$sample"
  [ "$("$2" "$sample" | wc -l)" -eq "$1" ] ||
    { echo "sizes_test: $2 does not find $1 in: ${3:0:100}"; exit 1; }
}
lines() { # COUNT TEXT
  for ((i = 0; i < $1; ++i)); do echo "$2"; done
}
must_find 1 too_wide "$(printf '%0101d' 0)"
must_find 0 too_wide "$(printf '%0100d' 0)"
must_find 1 too_long "$(lines 601 x)"
must_find 0 too_long "$(lines 600 x)"
must_find 1 long_kernels "kernel void f(
    uint x) {
$(lines 79 '  x;')
}"
must_find 0 long_kernels "kernel void f(uint x) {
$(lines 78 '  x;')
}
kernel void g(uint x) {
}"
must_find 1 long_functions "def f():
$(lines 80 '    x = 0')"
must_find 0 long_functions "def f():
$(lines 79 '    x = 0')
def g(): pass"
must_find 0 long_functions "def f():
    '''text
$(lines 80 text)
    '''
$(lines 79 '    x = 0')"

# Data, what programs made, and tables that clang-format is told to leave are left out.
find_sources() { # CONDITION...
  find .ci bench core kernels_cl reference tests tools -type f \
    ! -name '*.json' ! -name '*.png' ! -name '*.svg' ! -name '*.pyc' ! -name '*.gz' \
    ! -path 'tests/fuzz/seeds/*' ! -path 'tests/fuzz/found/*' ! -path '*/.mypy_cache/*' \
    ! -path kernels_cl/portable/shared_types_fields.h "$@"
}
mapfile -t texts < <(find . -maxdepth 1 -type f ! -name LICENSE; find_sources)
mapfile -t sources < <(find_sources ! -path 'tests/data/*' ! -name '*.md')
mapfile -t kernels < <(find kernels_cl -name '*.cl' -o -name '*.h')
mapfile -t scripts < <(
  grep -rlIE --include='*.py' . bench tests tools
  grep -rlIE --exclude='*.*' '^#!.*python' tests tools
)
for count in "${#texts[@]}" "${#sources[@]}" "${#kernels[@]}" "${#scripts[@]}"; do
  [ "$count" -gt 40 ] || { echo 'sizes_test: no files'; exit 1; }
done
found=$(
  too_wide "${texts[@]}" || true
  too_long "${sources[@]}"
  long_kernels "${kernels[@]}"
  long_functions "${scripts[@]}"
)
[ -z "$found" ] || { printf '%s\n' "$found"; exit 1; }
