#!/usr/bin/env bash
# The numeric tests as other processors would compute them: libraries are told to use fewer, or other, instructions.
#
#   tests/every_processor.sh                 every configuration below
#   tests/every_processor.sh oldest avx2     those named
#
# Exit code 1 if any failed. PYTHON names the interpreter (.venv/bin/python).
set -uo pipefail
cd "$(dirname "$0")/.."

TESTS=(tests/models tests/training tests/export tests/inference tests/groundtruth tests/simulation tests/core/test_colours.py)

# OpenVINO's own copy of oneDNN obeys its variable only in part, and fails below AVX2.
OPENVINO="test_openvinos_files_stand_together or test_the_check_is_told or test_a_file_that_answers_differently"

# Every value occurs, and each with different others; a dash leaves the library its own choice.
#          name    ATEN     oneDNN  OpenBLAS  numba    threads
CONFIGURATIONS=(
          "as-is   -        -       -         -        2"
          "oldest  default  SSE41   Haswell   generic  1"
          "avx2    avx2     AVX2    Haswell   -        2"
          "avx512  -        -       SkylakeX  generic  1"
          "torch   default  AVX2    -         -        1"
          "others  avx2     SSE41   SkylakeX  generic  2"
)

for name in "$@"; do
  printf '%s\n' "${CONFIGURATIONS[@]}" | grep -q "^ *$name " || { echo "no configuration '$name'" >&2; exit 2; }
done
python="${PYTHON:-.venv/bin/python}"
caches="$(mktemp -d)"
trap 'rm -rf "$caches"' EXIT
rows=() failed=0
for row in "${CONFIGURATIONS[@]}"; do
  read -r name aten onednn openblas numba threads <<<"$row"
  if [ $# -gt 0 ] && [[ " $* " != *" $name "* ]]; then continue; fi
  if [ "$openblas" = SkylakeX ] && ! grep -qw avx512f /proc/cpuinfo; then
    rows+=("$name|left out: no AVX-512 here")
    continue
  fi
  settings=(OMP_NUM_THREADS="$threads" OPENBLAS_NUM_THREADS="$threads" MKL_NUM_THREADS="$threads")
  settings+=(NUMBA_CACHE_DIR="$caches/$name") # compiled code is kept by source, not by processor
  [ "$aten" = - ] || settings+=(ATEN_CPU_CAPABILITY="$aten")
  [ "$onednn" = - ] || settings+=(ONEDNN_MAX_CPU_ISA="$onednn")
  [ "$openblas" = - ] || settings+=(OPENBLAS_CORETYPE="$openblas")
  [ "$numba" = - ] || settings+=(NUMBA_CPU_NAME="$numba")
  chosen=()
  [ "$onednn" != SSE41 ] || chosen=(-k "not ($OPENVINO)")
  echo "== $name: ${settings[*]}"
  processes=$(($(nproc) / threads))
  began=$SECONDS
  env -u ATEN_CPU_CAPABILITY -u ONEDNN_MAX_CPU_ISA -u OPENBLAS_CORETYPE -u NUMBA_CPU_NAME "${settings[@]}" \
    "$python" -m pytest -n "$((processes > 0 ? processes : 1))" --dist loadfile -p no:cacheprovider \
    -m "not slow and not realdata" "${chosen[@]}" "${TESTS[@]}" && said=passed || { said=FAILED; failed=1; }
  rows+=("$name|$said|ATEN $aten, oneDNN $onednn, OpenBLAS $openblas, numba $numba, threads $threads|$((SECONDS - began)) s")
done
printf '%s\n' "" "${rows[@]}" | column -t -s '|'
exit "$failed"
