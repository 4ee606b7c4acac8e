#!/usr/bin/env bash
# Builds the Python package in a virtual environment beside cargo's target and runs its tests. Without Python, or with
# GHAND_PYTHON=none, it says so and passes.
set -euo pipefail
cd "$(dirname "$0")/.."

python="${GHAND_PYTHON:-python3}"
if ! "$python" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 10))' 2>/dev/null; then
    echo "python tests: skipped, they need Python 3.10 or later with venv (Debian: apt-get install python3-venv)"
    exit 0
fi
export CARGO_TARGET_DIR="$(realpath -m "${CARGO_TARGET_DIR:-target}")"
environment="$CARGO_TARGET_DIR/python"
"$python" -m venv "$environment"
"$environment/bin/pip" install --quiet --disable-pip-version-check './python[test]'
"$environment/bin/python" -m pytest --quiet python
