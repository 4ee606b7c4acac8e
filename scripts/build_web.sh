#!/usr/bin/env bash
# Builds the player for web pages into web/dist: ghand-avatar.js, ghand.wasm, and sources.sha256, the hash of what they
# were built from.
#
# Needs the target wasm32-unknown-unknown, wasm-bindgen of the version in Cargo.lock (cargo install wasm-bindgen-cli
# --version VERSION) and npx (Node.js), which runs esbuild.
set -euo pipefail
cd "$(dirname "$0")/.."

esbuild=esbuild@0.28.2
target=wasm32-unknown-unknown
version=$(grep -A1 '^name = "wasm-bindgen"$' Cargo.lock | sed -n 's/^version = "\(.*\)"$/\1/p')
need() { command -v "$1" >/dev/null || { echo "build_web: $1 is missing; $2" >&2; exit 1; }; }
need wasm-bindgen "cargo install wasm-bindgen-cli --version $version"
need npx "install Node.js"
found=$(wasm-bindgen --version | cut -d' ' -f2)
if [ "$found" != "$version" ]; then
    echo "build_web: wasm-bindgen is $found; cargo install wasm-bindgen-cli --version $version" >&2
    exit 1
fi

build=$(realpath -m "${CARGO_TARGET_DIR:-target}/browser")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# No paths of this computer in what is committed.
export RUSTFLAGS="-C target-feature=+simd128 --remap-path-prefix=$PWD=. --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo"
CARGO_TARGET_DIR="$build" cargo build --profile web --target "$target" -p ghand-web
wasm-bindgen --target web --no-typescript --out-dir "$work" "$build/$target/web/ghand_web.wasm"
mkdir -p web/dist
cp web/*.js "$work/"
npx --yes "$esbuild" "$work/ghand-avatar.js" --bundle --format=esm --minify --target=es2022 --charset=utf8 \
    --outfile="$work/bundle.js" --log-level=warning
mv "$work/bundle.js" web/dist/ghand-avatar.js
mv "$work/ghand_web_bg.wasm" web/dist/ghand.wasm
cp web/ghand-avatar.d.ts web/dist/
unset RUSTFLAGS
GHAND_PLAYER_IS_NEW=1 cargo test --quiet -p ghand-web --test sources
ls -l web/dist
