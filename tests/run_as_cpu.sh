#!/usr/bin/env bash
# run_as_cpu.sh LIBRARY CPU FOLDER PROGRAM ARGUMENT...: runs a GoogleTest program on PoCL, which
# compiles kernels for that CPU (pocl_as_cpu.cpp) and keeps them in the folder. Cases fail where the
# device is not called so. Status 77: this PoCL cannot be told.
set -euo pipefail

library=$1
cpu=$2
folder=$3
shift 3
libraries=$(ldconfig -p)
pocl=$(sed -n '/libpocl\.so/{s/.* => //p;q}' <<< "$libraries")
if ! needed=$(ldd "$pocl") || [[ $needed != *libLLVM* ]]; then
  echo "run_as_cpu: PoCL ('$pocl') has no libLLVM.so to ask for the CPU" >&2
  exit 77
fi
exec env LD_PRELOAD="$library" POCL_AS_CPU="$cpu" POCL_CACHE_DIR="$folder" \
  OCL_ICD_VENDORS=pocl.icd ISOWAVE_DEVICE="pthread-$cpu" "$@"
