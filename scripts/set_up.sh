#!/usr/bin/env bash
# A virtual environment with casysid and its tools. Usage: set_up.sh PYTHON VENV
set -euo pipefail
python=$1
venv=$2

apt_install() {
    if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
        apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "$@" >/dev/null
    else
        echo "Please install with your package manager, then run this again: $*" >&2
        exit 2
    fi
}

"$python" - <<'PY' || { echo "casysid needs Python 3.11 to 3.14: set PYTHON=/path/to/it" >&2; exit 2; }
import sys
sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))
PY
"$python" -c 'import ensurepip, venv' 2>/dev/null || apt_install python3-venv
"$python" -c 'import ctypes; ctypes.CDLL("libgomp.so.1")' 2>/dev/null || apt_install libgomp1

[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
