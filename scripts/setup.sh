#!/usr/bin/env bash
# Installs what a Debian or Ubuntu machine with Rust lacks to build, train and view: a C compiler (to link, and for the
# allocator mimalloc), a Vulkan driver, the libraries that the viewer's window loads, and ffmpeg for videos. Changes
# nothing where all is there.
set -euo pipefail

say() { echo "setup: $*"; }
fail() {
    echo "setup: $*" >&2
    exit 1
}

if ! command -v cargo >/dev/null; then
    if [ -x "${CARGO_HOME:-$HOME/.cargo}/bin/cargo" ]; then
        fail "cargo is installed but not on the PATH; run \`. \"${CARGO_HOME:-$HOME/.cargo}/env\"\` and try again."
    fi
    fail "cargo was not found; install Rust with rustup (https://rustup.rs) and try again."
fi

links_programs() {
    local folder works=1
    folder=$(mktemp -d)
    echo 'int main(void) { return 0; }' >"$folder/a.c"
    cc "$folder/a.c" -o "$folder/a" 2>/dev/null || works=0
    rm -rf "$folder"
    [ "$works" = 1 ]
}

case "$(uname -s)" in
Linux) ;;
Darwin)
    links_programs || fail "no C compiler; install the command line tools with \`xcode-select --install\`."
    say "nothing to do: macOS brings Metal."
    exit 0
    ;;
MINGW* | MSYS* | CYGWIN*)
    say "nothing to do: Windows brings Direct3D 12; Rust's MSVC toolchain needs the Visual Studio C++ build tools."
    exit 0
    ;;
*)
    fail "$(uname -s) is not known; install a C compiler and a Vulkan driver by hand, then call cargo directly."
    ;;
esac

# ldconfig lies in /sbin, which is not on every user's PATH. The output is read whole: a reader that stops early would
# break the pipe, which pipefail reports.
libraries=$(PATH="$PATH:/usr/sbin:/sbin" ldconfig -p 2>/dev/null || true)
has_library() { [[ "$libraries" == *"$1 "* ]]; }

has_vulkan_driver() {
    [ -z "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] || return 0
    local manifest
    for manifest in /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json; do
        [ ! -e "$manifest" ] || return 0
    done
    return 1
}

# Without these nothing builds or runs.
needed=()
if ! links_programs; then
    say "a C compiler is missing."
    needed+=(gcc libc6-dev)
fi
if ! has_library libvulkan.so.1; then
    say "the Vulkan loader is missing."
    needed+=(libvulkan1)
fi
if ! has_vulkan_driver; then
    say "a Vulkan driver is missing; Mesa's runs on any GPU it knows and, as lavapipe, on the CPU."
    needed+=(mesa-vulkan-drivers)
fi

# These the viewer loads when it opens a window; training and `--screenshot` do without.
optional=()
while read -r library package; do
    has_library "$library" || optional+=("$package")
done <<'LIBRARIES'
libxkbcommon.so.0 libxkbcommon0
libxkbcommon-x11.so.0 libxkbcommon-x11-0
libwayland-client.so.0 libwayland-client0
libX11.so.6 libx11-6
libX11-xcb.so.1 libx11-xcb1
libXcursor.so.1 libxcursor1
libXi.so.6 libxi6
LIBRARIES
[ ${#optional[@]} = 0 ] || say "libraries for the viewer's window are missing."
# This reads and writes videos.
if ! command -v ffmpeg >/dev/null; then
    say "ffmpeg is missing."
    optional+=(ffmpeg)
fi

packages=("${needed[@]}" "${optional[@]}")
if [ ${#packages[@]} = 0 ]; then
    say "nothing to do."
    exit 0
fi

# What cannot be installed is an error only if something needs it.
give_up() {
    [ ${#needed[@]} = 0 ] || fail "$*"
    say "$* Everything but the viewer's window and videos works without."
    exit 0
}

if ! command -v apt-get >/dev/null; then
    give_up "this is not Debian or Ubuntu; install by hand what these packages hold there: ${packages[*]}" \
        "(Fedora: gcc mesa-vulkan-drivers vulkan-loader libxkbcommon-x11 libXcursor libXi, ffmpeg-free)."
fi
as_root=()
if [ "$(id -u)" != 0 ]; then
    command -v sudo >/dev/null ||
        give_up "neither root nor sudo; ask an administrator to run \`apt-get install ${packages[*]}\`."
    as_root=(sudo)
fi
install_packages() {
    "${as_root[@]}" apt-get update -qq &&
        "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
            apt-get install -y -qq --no-install-recommends "${packages[@]}"
}
say "installing ${packages[*]}${as_root[0]:+ (with sudo)}."
install_packages || give_up "apt-get could not install ${packages[*]}; its messages above say why."
say "done."
