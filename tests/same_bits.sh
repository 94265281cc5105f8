# shellcheck shell=bash
# same_bits.sh: what cross_test.sh and wasm_test.sh share. They set source, work and fail() before.

# real_volumes: a line for each of the volumes that ISOWAVE_VOLUMES has, file and isovalue
real_volumes() {
  local file isovalue
  [ -n "${ISOWAVE_VOLUMES-}" ] || return 0
  [ -d "$ISOWAVE_VOLUMES" ] || fail "ISOWAVE_VOLUMES is no folder: $ISOWAVE_VOLUMES"
  while read -r file isovalue; do
    [ ! -e "$ISOWAVE_VOLUMES/$file" ] || echo "$ISOWAVE_VOLUMES/$file" "$isovalue"
  done << 'END'
nucleon_41x41x41_uint8.raw.gz 100
nucleon.nrrd 50
vessel_tree_noisy_101x101x101_uint8.raw.gz 120
isabel_velmag_t33_125x125x25_float32.raw.gz 25
LIDC2.mha 120
ch2_181x217x181_uint8.raw.gz 30
ch2.nii.gz 90
cthead_256x256x113_uint16.raw.gz 800
engine_256x256x128_uint8.raw.gz 100
aneurism_256x256x256_uint8.raw.gz 80
bonsai_256x256x256_uint8.raw.gz 40
END
}

num_volumes=0
# same_bits SYSTEM COUNT FILE ISOVALUE: `both here` and `both there` write the same COUNT files,
# among them the hits of ten views
same_bits() {
  local system=$1 expected=$2 file count=0
  rm -rf "$work/here" "$work/there"
  mkdir "$work/here" "$work/there"
  (cd "$work/here" && both here "${@:3}")
  (cd "$work/there" && both there "${@:3}")
  for file in "$work"/here/*; do
    cmp "$file" "$work/there/$(basename "$file")" ||
      fail "$3: $(basename "$file") of $system is another"
    count=$((count + 1))
  done
  [ "$count" -eq "$expected" ] || fail "$3: $count files, not $expected"
  [ "$(stat -c %s "$work/here/hits")" -eq $((10 * 320 * 180 * 49)) ] || fail "$3: not ten views"
  num_volumes=$((num_volumes + 1))
  echo "same bits: $(basename "$3")"
}
