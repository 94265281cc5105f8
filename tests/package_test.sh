#!/usr/bin/env bash
# package_test.sh <build folder> <source folder> <program>: the installed package serves a project
# outside of the tree, and the source folder can be within another project. Neither needs what only
# the program and the tests do.
set -euo pipefail
build=$1 source=$2 program=$3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() {
  echo "$*"
  exit 1
}

volume=$source/tests/data/fuel_64x33x32_uint8.raw.gz
user_flags='-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Werror'
not_needed=(embree GMP ITK CLI11 Boost GTest benchmark)

# needs_little PROGRAM: it links nothing that a renderer does not need.
needs_little() {
  if ldd "$1" | grep -iE 'embree|gmp|itk|boost|gtest'; then
    fail "$1 links what a renderer does not need"
  fi
}

# draws_as_program EXAMPLE: the picture that the program draws, bit for bit.
draws_as_program() {
  "$1" "$volume" 10 "$work/example.png"
  "$program" render "$volume" -i 10 -o "$work/program.png" > /dev/null
  cmp "$work/example.png" "$work/program.png" || fail "$1 and $program draw different pictures"
  if "$1" "$work/missing.nrrd" 10 "$work/none.png" 2> "$work/error"; then
    fail "a missing file is no error"
  fi
  [ "$(wc -l < "$work/error")" = 1 ] || fail "an error of $(wc -l < "$work/error") lines"
}

cmake --install "$build" --prefix "$work/prefix" > /dev/null
headers=$(find "$work/prefix" -name '*.hpp')
[ -n "$headers" ] || fail 'no headers are installed'
if grep -nE '#include [<"](CL/|glm/|fmt/|core/|kernels_cl/)' $headers; then
  fail 'a public header includes a private one'
fi
for header in $headers; do
  echo "#include \"$header\"" > "$work/alone.cpp"
  # shellcheck disable=SC2086
  g++ -std=c++20 $user_flags -fsyntax-only -I"$work/prefix/include" "$work/alone.cpp" ||
    fail "$header does not stand alone"
done

configure() { # configure SOURCE BUILD OPTION...
  local disabled=()
  for package in "${not_needed[@]}"; do disabled+=("-DCMAKE_DISABLE_FIND_PACKAGE_$package=ON"); done
  cmake -G Ninja -S "$1" -B "$2" "${disabled[@]}" "${@:3}" > "$work/log" 2>&1 || {
    cat "$work/log"
    fail "$1 cannot be configured"
  }
}
compile() {
  cmake --build "$1" > "$work/log" 2>&1 || { cat "$work/log"; fail "$1 does not build"; }
}

configure "$source/tools/example" "$work/installed" \
  -DCMAKE_PREFIX_PATH="$work/prefix" -DCMAKE_CXX_FLAGS="$user_flags"
compile "$work/installed"
needs_little "$work/installed/example"
draws_as_program "$work/installed/example"

mkdir "$work/parent"
cat > "$work/parent/CMakeLists.txt" << END
cmake_minimum_required(VERSION 3.25)
project(parent LANGUAGES CXX)
add_subdirectory($source isowave)
add_executable(example $source/tools/example/main.cpp)
target_link_libraries(example PRIVATE isowave::isowave)
END
# It is compiled and used within another project by the Python package (python_test.sh); here, what
# would be compiled.
configure "$work/parent" "$work/within"
ninja -C "$work/within" -t commands all > "$work/steps"
grep -q "isowave_library" "$work/steps" || fail 'the library is not built within another project'
if grep -E 'isowave_(commands|reference|tests|bench)' "$work/steps"; then
  fail 'more than the library is built within another project'
fi
