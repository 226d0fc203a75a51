#!/usr/bin/env bash
# The tests once for every number of threads and every kind of processor that this one can be.
#
# Usage: test_environments.sh [PYTHON [TEST ...]]
#
# OMP_NUM_THREADS unset, 1 and 2; then OPENBLAS_CORETYPE Haswell, SkylakeX and Zen, each a set of BLAS kernels that sums
# in another order. A kind whose instructions this processor lacks is left out, with a word. Ends with 1 if a test fails.
set -euo pipefail

if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
    sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//p}' "$0"
    exit 0
fi
python=${1:-python}
shift || true
unset OMP_NUM_THREADS OPENBLAS_NUM_THREADS OPENBLAS_CORETYPE
failed=()

run() {
    echo "== ${1:-OMP_NUM_THREADS unset}"
    env ${1:+"$1"} "$python" -m pytest -n 2 "${@:2}" || failed+=("${1:-OMP_NUM_THREADS unset}")
}

has() { # whether the processor, asked by NumPy, has these instructions
    "$python" - "$@" <<'PY'
import sys

from numpy._core._multiarray_umath import __cpu_features__ as features

sys.exit(not all(features.get(name, False) for name in sys.argv[1:]))
PY
}

run "" "$@"
run OMP_NUM_THREADS=1 "$@"
run OMP_NUM_THREADS=2 "$@"
for kind in "Haswell AVX2 FMA3" "SkylakeX AVX512_SKX" "Zen AVX2 FMA3"; do
    read -r name instructions <<<"$kind"
    # shellcheck disable=SC2086  # several words are meant
    if has $instructions; then
        run "OPENBLAS_CORETYPE=$name" "$@"
    else
        echo "== OPENBLAS_CORETYPE=$name left out: this processor has no $instructions"
    fi
done
if [ ${#failed[@]} -gt 0 ]; then
    printf 'failed under: %s\n' "${failed[@]}"
    exit 1
fi
