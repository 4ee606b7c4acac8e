#!/usr/bin/env bash
# Whether every crate below training, and the player, compiles for browsers (wasm32-unknown-unknown).
#
# Takes the toolchain's own target if it is there or can be added. Else, on Debian, the compiler and the sources of the
# standard library from its packages, unpacked into the cache and not installed. Without either it says so and passes.
set -euo pipefail
cd "$(dirname "$0")/.."

target=wasm32-unknown-unknown
# Apart from what the other commands build: another compiler may run.
CARGO_TARGET_DIR=$(realpath -m "${CARGO_TARGET_DIR:-target}/browser")
export CARGO_TARGET_DIR
crates=(core files hand-model capture render motion avatar pictures synthetic measure fit tracker web)
cargo=(cargo check --target "$target" "${crates[@]/#/--package=ghand-}")

has_target() { [ -d "$(rustc --print target-libdir --target "$target")" ]; }
if ! has_target && command -v rustup >/dev/null; then
    timeout 60 rustup --quiet target add "$target" >/dev/null 2>&1 || true
fi
if has_target; then
    exec "${cargo[@]}"
fi

cache="${XDG_CACHE_HOME:-$HOME/.cache}/ghand-wasm"
packages=(rustc-web libstd-rust-web-dev libstd-rust-web-1.96 rust-web-src rust-web-llvm libllvm22 lld-22)
if [ ! -e "$cache/complete" ]; then
    if ! command -v dpkg-deb >/dev/null; then
        echo "check_wasm: skipped: no standard library for $target; rustup target add $target installs it"
        exit 0
    fi
    rm -rf "$cache"
    mkdir -p "$cache"
    if ! (cd "$cache" && apt-get download "${packages[@]}" >/dev/null 2>&1); then
        echo "check_wasm: skipped: neither rustup nor apt-get gives a standard library for $target"
        exit 0
    fi
    for package in "$cache"/*.deb; do dpkg-deb -x "$package" "$cache"; done
    rm "$cache"/*.deb
    touch "$cache/complete"
fi
export LD_LIBRARY_PATH="$cache/usr/lib/x86_64-linux-gnu:$cache/usr/lib/llvm-22/lib"
export PATH="$cache/usr/bin:$cache/usr/lib/llvm-22/bin:$PATH"
export RUSTC="$cache/usr/bin/rustc" RUSTDOC="$cache/usr/bin/rustdoc" RUSTC_BOOTSTRAP=1
exec "$(rustup which cargo 2>/dev/null || command -v cargo)" "${cargo[@]:1}" -Zbuild-std=std,panic_abort
