#!/usr/bin/env bash
# site_test.sh <source folder> <program>: tools/site makes three scenes and all documents. A link
# that leads nowhere, a page that loads what is elsewhere, and a folder of other files end
# in one line, and change nothing. Chromium shows the pages without a complaint.
set -euo pipefail
source=$1 program=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() {
  echo "$*"
  exit 1
}

# has FILE TEXT...: the file has each of the texts.
has() {
  for text in "${@:2}"; do grep -qF -- "$text" "$1" || fail "$1 has no $text"; done
}

site=$work/all/site
"$source/tools/site" "$site" --program "$program" > "$work/said" || fail 'the site is not made'
has "$work/said" "$site/index.html"
[ "$(ls -A "$work/all")" = site ] || fail "beside the site: $(ls -A "$work/all")"
has "$site/index.html" 'isowave draws isosurfaces of volumes' 'href="docs/index.html"'
for scene in head:'A head in the light' cut_head:'A head, cut open' fuel:'An injection of fuel'; do
  name=${scene%%:*}
  has "$site/index.html" "href=\"$name.html\"" "src=\"posters/$name.png\"" "${scene#*:}"
  has "$site/$name.html" "<title>${scene#*:}" 'id="volume"' 'default-src '
  [ "$(head -c 4 "$site/posters/$name.png" | tail -c 3)" = PNG ] || fail "$name has no picture"
done
has "$site/docs/CONTRIBUTING.html" 'href="core/render/index.html#stages"'
has "$site/docs/core/render/index.html" '<h2 id="stages">' 'href="../../bench/scenes.html"'
has "$site/docs/index.html" 'href="LICENSE.txt"' 'src="tools/images/cut_head.png"' \
  '<code>device_renderer.cpp</code>'
has "$site/docs/bench/cpu.html" '<td class="right">'
if grep -rlE 'href="[^":]*\.(md|cpp)|<[a-z]+ style=' "$site/docs"; then
  fail 'pages have links to sources, or styles that their policy forbids'
fi

# complaints FILE: what Chromium says of it
complaints() {
  timeout 60 chromium --headless=new --no-sandbox --disable-gpu --user-data-dir="$work/chromium" \
    --enable-logging=stderr --dump-dom "file://$1" 2> "$work/log" > "$work/dom" ||
    fail "Chromium ends with $?: $(tail -n 3 "$work/log")"
  has "$work/dom" '</html>'
  grep ':CONSOLE' "$work/log" || true
}
if command -v chromium > /dev/null; then
  for page in index.html docs/bench/cpu.html; do
    said=$(complaints "$site/$page")
    [ -z "$said" ] || fail "$page: $said"
  done
  sed 's/<h1/<h1 style="color: red"/' "$site/index.html" > "$site/styled.html"
  [ -n "$(complaints "$site/styled.html")" ] || fail 'complaints of Chromium are not seen'
  rm "$site/styled.html"
fi

# A copy of the sources, for changes, and a program that writes small pages.
mkdir "$work/source"
for part in bench core kernels_cl reference tests tools README.md CONTRIBUTING.md CHANGELOG.md \
  LICENSE CITATION.cff; do
  cp -r "$source/$part" "$work/source"
done
# Without tables, documents are read in half of the time.
find "$work/source/bench" -name '*.md' -exec sed -i '/^|/d' {} +
cat > "$work/program" << 'END'
#!/bin/bash
if [ -e "$0.fails" ]; then echo 'a hint'; echo 'no engine' >&2; exit 1; fi
cp "${0%/*}/page.html" "${@: -1}"
END
chmod +x "$work/program"
policy='<meta http-equiv="Content-Security-Policy" content="default-src '"'none'"'">'
echo "$policy" > "$work/page.html"
copied=$work/copies/site
make_copy() {
  "$work/source/tools/site" "$copied" --program "$work/program" > "$work/said" 2> "$work/error"
}
readme=$work/source/README.md

# refused NAME WORDS: one line that has the words; the site stays as it was.
refused() {
  local before after
  before=$(cd "$work/copies" && find . -type f -exec sha256sum {} +)
  if make_copy; then fail "$1 is not noticed"; else local status=$?; fi
  [ "$status" -eq 1 ] || fail "$1: status $status"
  [ "$(wc -l < "$work/error")" -eq 1 ] || fail "$1: $(cat "$work/error")"
  has "$work/error" "$2"
  after=$(cd "$work/copies" && find . -type f -exec sha256sum {} +)
  [ "$before" = "$after" ] || fail "$1: the folder is another"
}
# with TEXT NAME WORDS: refused with this line in the README
with() {
  cp "$readme" "$work/readme"
  printf '\n%s\n' "$1" >> "$readme"
  refused "$2" "$3"
  cp "$work/readme" "$readme"
}
mkdir "$work/copies"
with '[x](core/none.md)' 'a link to no file' 'link to core/none.md: there is no core/none.md'
[ -z "$(ls -A "$work/copies")" ] || fail 'a site that failed is there'

# Headings have the places that GitHub gives them, twice the same ones, too.
printf '\n## `a`, the & b\n## `a`, the & b\n[x](#a-the--b) [y](#a-the--b-1)\n' >> "$readme"
make_copy || fail "$(cat "$work/error")"
make_copy || fail "a site is not replaced: $(cat "$work/error")"
[ "$(ls -A "$work/copies")" = site ] || fail "beside the site: $(ls -A "$work/copies")"

with '[x](#a-the--b-2)' 'a link to no place' 'docs/index.html has no place #a-the--b-2'
with '[x](core/README.md#none)' 'a link to no place of another page' 'has no place #none'
with '![x](tools/images/none.png)' 'a missing picture' 'there is no tools/images/none.png'
with '<img src="none.png">' 'a missing picture in HTML' 'there is no none.png'
with '[x](../x.md)' 'a link out of the sources' 'there is no ../x.md'
with '![x](https://example.org/x.png)' 'a picture from elsewhere' 'loads https://example.org/x.png'
with '<link rel="stylesheet" href="//example.org/x">' 'a style from elsewhere' 'loads //example.org'
echo '@import "x.css";' >> "$work/source/tools/demo_site/style.css"
refused 'a style that loads' 'style.css loads: @import'
sed -i '$d' "$work/source/tools/demo_site/style.css"
echo > "$work/page.html"
refused 'a page without a policy' 'no Content-Security-Policy'
echo "${policy/\">/; img-src https://example.org\">}" > "$work/page.html"
refused 'a policy with another host' 'a policy that allows https://example.org'
echo "$policy" > "$work/page.html"
touch "$work/program.fails"
refused 'a program that fails' 'program export: no engine'
rm "$work/program.fails"
touch "$copied/CNAME"
refused "a site with another's file" 'has CNAME, which tools/site did not make'
rm -r "$copied"
mkdir "$copied"
touch "$copied/other"
refused 'a folder of other things' 'has other'
rm -r "$copied"
mv "$work/program" "$work/elsewhere"
refused 'a missing program' 'No such file'
