#!/usr/bin/env bash
# Runs the numeric tests as on other processors: the libraries use fewer, or other, instructions.
#
#   tests/every_processor.sh                 every configuration below
#   tests/every_processor.sh oldest avx2     only these
#
# Exit code 1 if any failed. PYTHON names the interpreter (.venv/bin/python).
set -uo pipefail
cd "$(dirname "$0")/.."

TESTS=(tests/models tests/training tests/export tests/inference tests/groundtruth tests/simulation tests/core/test_colours.py)

# Every value occurs in combination with different others; a dash is the library's default.
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
    rows+=("$name|skipped: no AVX-512")
    continue
  fi
  settings=(OMP_NUM_THREADS="$threads" OPENBLAS_NUM_THREADS="$threads" MKL_NUM_THREADS="$threads")
  settings+=(NUMBA_CACHE_DIR="$caches/$name") # the cache of compiled code is keyed by source, not by processor
  [ "$aten" = - ] || settings+=(ATEN_CPU_CAPABILITY="$aten")
  [ "$onednn" = - ] || settings+=(ONEDNN_MAX_CPU_ISA="$onednn")
  [ "$openblas" = - ] || settings+=(OPENBLAS_CORETYPE="$openblas")
  [ "$numba" = - ] || settings+=(NUMBA_CPU_NAME="$numba")
  tests="not slow and not realdata"
  # OpenVINO's own copy of oneDNN ignores part of its variable, and fails below AVX2.
  [ "$onednn" != SSE41 ] || tests="$tests and not openvino"
  echo "== $name: ${settings[*]}"
  processes=$(($(nproc) / threads))
  began=$SECONDS
  env -u ATEN_CPU_CAPABILITY -u ONEDNN_MAX_CPU_ISA -u OPENBLAS_CORETYPE -u NUMBA_CPU_NAME "${settings[@]}" \
    "$python" -m pytest -n "$((processes > 0 ? processes : 1))" --dist loadfile -p no:cacheprovider \
    -m "$tests" "${TESTS[@]}" && result=passed || { result=FAILED; failed=1; }
  rows+=("$name|$result|ATEN $aten, oneDNN $onednn, OpenBLAS $openblas, numba $numba, threads $threads|$((SECONDS - began)) s")
done
printf '%s\n' "" "${rows[@]}" | column -t -s '|'
exit "$failed"
