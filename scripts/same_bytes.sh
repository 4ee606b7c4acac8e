#!/usr/bin/env bash
# Whether two commits write the same bytes: `scripts/same_bytes.sh OLD NEW`, each a commit or `.` for the working tree.
#
# Both run the commands below on a CPU adapter. The SHA-256 of every file must agree; of JSON without times and paths. What
# differs is printed; the exit status is then 1. A commit is built and run once: its hashes stay in the target folder.
set -euo pipefail
cd "$(dirname "$0")/.."
if [ $# != 2 ]; then
    sed -n '2,5s/^# //p' "$0" >&2
    exit 2
fi

target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
export CARGO_TARGET_DIR="$target" GHAND_ADAPTER=cpu RUST_LOG=error
work=$(mktemp -d)
trap 'rm -rf "$work"; git worktree prune' EXIT
if [ -z "${XDG_RUNTIME_DIR:-}" ]; then
    export XDG_RUNTIME_DIR="$work/runtime"
    mkdir -m 700 "$XDG_RUNTIME_DIR"
fi

# Everything that is compared, made in the present folder by the programs in $1.
make_all() {
    local bin=$1
    ghand() { "$bin/ghand" "$@"; }
    train() {
        local out=$1
        shift
        "$bin/train" --out "$out" --set uv_resolution=64 "$@"
    }
    ghand capture --out capture --size 96x144 --views 4 --test-views 2 --train-frames 6 --test-frames 3 --identity 5
    ghand capture --out lit --size 96x144 --views 4 --test-views 1 --train-frames 6 --test-frames 2 --identity 6 --side left \
        --light side --background clutter --forearm --mask-noise 1
    train direct --capture capture --set iterations=60
    train full --capture capture --set iterations=40 --set components=full
    train network --capture capture --preset quick --model network --set iterations=30
    train light --capture lit --set iterations=60 --set light=transfer
    train auto --capture capture --preset quick --model auto --set iterations=60
    train paper --capture capture --preset paper --set iterations=30 --set network=quick
    # Killed as soon as it can be resumed.
    (exec "$bin/train" --out killed --set uv_resolution=64 --capture capture --set iterations=300 --checkpoint-every 100ms) &
    local run=$!
    until compgen -G 'killed/checkpoint*/*' >/dev/null || ! kill -0 $run 2>/dev/null; do sleep 0.05; done
    kill -9 $run 2>/dev/null || true
    wait $run 2>/dev/null || true
    "$bin/train" --out killed --resume
    ghand bake direct/avatar.ghand --out baked.ghand
    ghand bake network/avatar.ghand --out baked-network.ghand
    for avatar in direct full network light baked; do
        local file=$avatar/avatar.ghand
        [ -f "$file" ] || file=$avatar.ghand
        ghand render "$file" --pose fist --turntable 2 --size 128x128 --out "render-$avatar" --format exr
    done
    ghand render light/avatar.ghand --pose fist --turntable 2 --size 128x128 --out lit.gif --light studio
    ghand export direct/avatar.ghand --out scene.ply --pose victory
    ghand splat scene.ply --camera capture/capture.json:cam00 --out splat.exr
    ghand splat scene.ply --camera capture/capture.json:cam00 --out splat.png --weights splat.exr --gradients gradients.safetensors
    ghand pose --pose fist --out fist.glb
    ghand pose --pose count --out count.json
    ghand evaluate direct/avatar.ghand --capture capture --out evaluated
    ghand inspect capture >inspection.txt
}

# Names and hashes of all files of the present folder but logs, checkpoints, and curves with the time of each point.
hashes() {
    find . -type f ! -name '*.log' ! -name '*.html' ! -name '*.csv' ! -path '*checkpoint*' ! -path './runtime/*' | LC_ALL=C sort | while read -r file; do
        case $file in
            *.json) jq -S 'walk(if type == "object" then with_entries(select(.key | test("second|time|_ms$|path|folder|version|adapter|driver|bytes|memory|^capture$") | not)) else . end)' "$file" ;;
            *) cat "$file" ;;
        esac | sha256sum | sed "s|-|$file|"
    done
}

# The file with the hashes of a commit, made if it is not there.
hashes_of() {
    local commit=$1 name tree=.
    name=$(git rev-parse --verify --short=12 "${commit/#./HEAD}^{commit}") || exit 2
    local list="$target/same-bytes/$name-$(sha256sum "$0" | cut -c1-8).txt"
    if [ "$commit" != . ]; then
        if [ -f "$list" ]; then
            echo "$list"
            return
        fi
        tree="$work/$name"
        git worktree add --quiet --detach "$tree" "$commit"
    else
        list="$work/working-tree.txt"
    fi
    local features=()
    grep -q '^networks = ' "$tree/crates/ghand-app/Cargo.toml" && features=(--features networks)
    (cd "$tree" && cargo build --quiet --workspace --bins "${features[@]}") >&2
    mkdir -p "$work/bin-$name" "$work/out-$name" "$(dirname "$list")"
    cp "$target/debug/train" "$target/debug/ghand" "$work/bin-$name/"
    [ "$tree" = . ] || git worktree remove --force "$tree"
    (cd "$work/out-$name" && set -e && make_all "$work/bin-$name" >"$work/$name.log" 2>&1) || {
        tail -20 "$work/$name.log" >&2
        echo "same_bytes: a command of $commit failed" >&2
        exit 2
    }
    (cd "$work/out-$name" && hashes) >"$list"
    rm -rf "$work/out-$name"
    echo "$list"
}

old=$(hashes_of "$1")
new=$(hashes_of "$2")
count=$(wc -l <"$new")
if ! differences=$(diff "$old" "$new"); then
    grep '^[<>]' <<<"$differences"
    echo "same_bytes: $1 and $2 differ" >&2
    exit 1
fi
echo "same_bytes: $count files of $1 and $2 have the same bytes"
