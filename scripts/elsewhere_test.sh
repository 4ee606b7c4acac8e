#!/usr/bin/env bash
# Opens ghand's exports in programs of others: glTF's validator, three.js, PlayCanvas, Spark, splat-transform, Blender.
# They are installed beside cargo's target, where elsewhere/out keeps ghand's pictures, theirs, and four times the
# difference. Says what it skips: all of it without Node.js or npm's packages, or with GHAND_NODE=none; pages without
# Chromium.
#
# Blender is GPL: it is run as a program of its own, if it is installed. GHAND_BLENDER=1 downloads it (bpy, 0.4 GB).
set -euo pipefail
cd "$(dirname "$0")/.."

node="${GHAND_NODE:-node}"
is_new='process.exit(Number(parseInt(process.versions.node) < 20))'
if ! "$node" -e "$is_new" 2>/dev/null || ! command -v npm >/dev/null; then
    echo "elsewhere tests: skipped, they need Node.js 20 or later with npm (Debian: apt-get install nodejs npm)"
    exit 0
fi
CARGO_TARGET_DIR="$(realpath -m "${CARGO_TARGET_DIR:-target}")"
export CARGO_TARGET_DIR
place="$CARGO_TARGET_DIR/elsewhere"
mkdir -p "$place"

# A change of versions installs all anew; the lock file is copied last, as the sign that all are there.
if ! cmp -s tests/elsewhere/package-lock.json "$place/installed.json"; then
    cp tests/elsewhere/package.json tests/elsewhere/package-lock.json "$place/"
    if ! (cd "$place" && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error); then
        echo "elsewhere tests: skipped, npm could not install the programs"
        exit 0
    fi
    cp tests/elsewhere/package-lock.json "$place/installed.json"
fi

# Node.js finds packages in the folders above a file.
rm -rf "$place/suite"
cp -r tests/elsewhere "$place/suite"

# bpy is a module for one version of Python, and has the same interface as a script in Blender.
bpy=5.0.1 bpy_python=python3.11
if command -v blender >/dev/null; then
    blender=blender
elif [ -x "$place/blender/bin/python" ]; then
    blender="$place/blender/bin/python"
elif [ "${GHAND_BLENDER:-}" = 1 ]; then
    if "$bpy_python" -m venv --clear "$place/blender.new" &&
        "$place/blender.new/bin/pip" install --quiet --disable-pip-version-check "bpy==$bpy"; then
        mv "$place/blender.new" "$place/blender"
        blender="$place/blender/bin/python"
    else
        blender=
        echo "elsewhere tests: without Blender: bpy $bpy could not be installed with $bpy_python"
    fi
else
    blender=
    echo "elsewhere tests: without Blender, which is not installed; GHAND_BLENDER=1 downloads it"
fi
# Its libraries of windows and graphics may be missing.
if [[ "$blender" == *python ]] && ! "$blender" -c "import bpy"; then
    blender=
    echo "elsewhere tests: without Blender: bpy cannot be imported"
fi
export GHAND_BLENDER_PROGRAM="$blender"

cargo build --quiet -p ghand-app --no-default-features --bin ghand
export GHAND_PROGRAM="$CARGO_TARGET_DIR/debug/ghand"
export GHAND_DEMO_AVATAR="$PWD/assets/demo-avatar/right.ghand"
cd "$place/suite"
"$node" --test --test-reporter=spec
