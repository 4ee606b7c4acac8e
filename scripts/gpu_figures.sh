#!/usr/bin/env bash
# Figures of this machine's graphics device in one run: whether it computes rightly on every tier, how fast it splats,
# plays and trains. Writes DIR/figures.json and DIR/figures.md.
#
#     scripts/gpu_figures.sh [--out DIR] [--minutes N] [--small] [--bin DIR]
#
# --out      default out/gpu_figures
# --minutes  the longest time without the build, default 10; what is left at the end trains `--preset paper`
# --small    few cases and Gaussians: to try the script on a processor
# --bin      programs that were built elsewhere: ghand-lab, train, render-tests, avatar-tests
#
# GHAND_ADAPTER chooses the device. Exit code 1 if a test has failed. The table needs python3.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

out=out/gpu_figures minutes=10 small=0 bin=
while [ $# -gt 0 ]; do
    case "$1" in
        --out) out="$2"; shift ;;
        --minutes) minutes="$2"; shift ;;
        --bin) bin="$2"; shift ;;
        --small) small=1 ;;
        *) echo "gpu_figures: $1 is unknown; see the head of the script" >&2; exit 2 ;;
    esac
    shift
done

say() { echo "gpu_figures: $*" >&2; }
if [ -z "${XDG_RUNTIME_DIR:-}" ]; then
    XDG_RUNTIME_DIR=$(mktemp -d)
    export XDG_RUNTIME_DIR
fi

# The test programs are found by the messages of cargo.
if [ -z "$bin" ]; then
    target="${CARGO_TARGET_DIR:-target}"
    cargo build -p ghand-app -p ghand-lab --no-default-features --features ghand-app/gpu-networks \
        --bin train --bin ghand-lab
    bin="$target/gpu_figures"
    mkdir -p "$bin"
    cp "$target"/debug/{train,ghand-lab} "$bin/"
    for crate in render avatar; do
        program=$(cargo test -p "ghand-$crate" --test it --no-run 2>&1 | sed -n 's/.*Executable .*(\(.*\))$/\1/p')
        cp "$program" "$bin/$crate-tests"
    done
fi
bin=$(realpath "$bin")
rm -rf "$out"
mkdir -p "$out/parts"
parts="$out/parts"

begin=$SECONDS
left() { echo $((60 * minutes - (SECONDS - begin))); }
failed=()

# part NAME SECONDS COMMAND: runs a command for at most these seconds and keeps its result as one value of JSON: what it
# prints, if that is JSON, else whether it succeeded, with its last line.
part() {
    local name=$1 limit=$2
    shift 2
    [ "$(left)" -lt "$limit" ] && limit=$(left)
    if [ "$limit" -lt 5 ]; then
        say "$name: not reached"
        echo '{"ended": "not reached"}' >"$parts/$name.json"
        return
    fi
    local start=$SECONDS code=0
    timeout -k 5 "$limit" "$@" >"$parts/$name.out" 2>"$parts/$name.err" || code=$?
    local ended=passed
    if [ $code = 124 ] || [ $code = 137 ]; then
        ended="not finished in $limit s"
    elif [ $code != 0 ]; then
        ended=failed
        failed+=("$name")
    fi
    if [ $code = 0 ] && [[ $(head -c1 "$parts/$name.out") == [\{\[] ]]; then
        cp "$parts/$name.out" "$parts/$name.json"
    else
        local last
        last=$(cat "$parts/$name.out" "$parts/$name.err" | grep -v '^ *$' | tail -1 | tr -d '\000-\037' | sed 's/\\/\\\\/g; s/"/\\"/g')
        echo "{\"ended\": \"$ended\", \"seconds\": $((SECONDS - start)), \"last_line\": \"$last\"}" >"$parts/$name.json"
    fi
    say "$name: $ended, $((SECONDS - start)) s"
}

avatar=assets/demo-avatar/right.ghand
tiers="cpu cpu-subgroups gpu gpu-subgroups"
cases=300 counts="22000 87779 1000000" frames=30
render_tests=() avatar_tests=()
if [ $small = 1 ]; then
    cases=10 counts="3000" frames=4
    render_tests=(image_loss) avatar_tests=(gloss)
fi

# Correctness. The tests of the crates go through all tiers themselves; GHAND_TIER chooses that of `stress`.
for crate in render avatar; do
    tests="${crate}_tests[@]"
    part "tests-$crate" 150 env -C "crates/ghand-$crate" CARGO_MANIFEST_DIR="$PWD/crates/ghand-$crate" "$bin/$crate-tests" "${!tests}"
done
for tier in $tiers; do
    part "stress-$tier" 60 env GHAND_TIER="$tier" "$bin/ghand-lab" stress --cases $cases --seed 1
done

# Speed.
for tier in $tiers; do
    for count in $counts; do
        part "splat-$count-$tier" 40 env GHAND_TIER="$tier" "$bin/ghand-lab" bench splat --n "$count" --frames $frames --json
    done
done
part play 30 "$bin/ghand-lab" bench play "$avatar" --frames $frames --json
# The demo avatar is baked.
part pose 30 "$bin/ghand-lab" bench pose "$avatar" --frames $frames --json
part train-direct 60 "$bin/ghand-lab" bench train --iterations $frames --json

# The paper's networks, for as long as is left; ninety seconds are for the capture, the evaluation and the end.
rest=$(($(left) - 90))
if [ $small = 1 ]; then rest=10; fi
if [ "$rest" -ge 10 ]; then
    options=(--preset paper --max-time "${rest}s" --out "$out/paper")
    if [ $small = 1 ]; then
        options=(--preset quick --model network --set iterations=4 --set uv_resolution=32 --set align=off --set light=off --out "$out/paper")
    fi
    # That an avatar of so short a training is no better than its floor is no failure here.
    part paper $((rest + (small ? 200 : 90))) bash -c '"$@" || test -e "'"$out"'/paper/metrics.json"' train "$bin/train" "${options[@]}"
    [ -e "$out/paper/metrics.json" ] && cp "$out/paper/metrics.json" "$parts/paper.json"
fi

{
    echo "{\"commit\": \"$(git rev-parse --short HEAD 2>/dev/null || echo unknown)\", \"date\": \"$(date -u +%F)\", \"seconds\": $((SECONDS - begin)), \"parts\": {"
    comma=
    for file in "$parts"/*.json; do
        printf '%s"%s": ' "$comma" "$(basename "$file" .json)"
        cat "$file"
        comma=,
    done
    echo "}}"
} >"$out/figures.json"

if command -v python3 >/dev/null; then
    python3 - "$out/figures.json" >"$out/figures.md" <<'TABLE'
import json
import sys

figures = json.load(open(sys.argv[1]))
parts = figures["parts"]
adapter = next((part["adapter"] for part in parts.values() if isinstance(part, dict) and "adapter" in part), "unknown")
print(f"# {adapter}\n\nCommit {figures['commit']}, {figures['date']}; {figures['seconds']} s. Times are medians in ms.\n")
print("| | |\n|---|---|")
for name, part in parts.items():
    if isinstance(part, dict) and "ended" in part:
        said = " ".join(part.get("last_line", "").replace("|", " ").split())
        print(f"| {name} | {part['ended']}{': ' + said if said else ''} |")
play, pose, train, paper = (parts.get(name) for name in ["play", "pose", "train-direct", "paper"])
if play and "lit_ms" in play:
    lit, unlit = play["lit_ms"]["median"], play["unlit_ms"]["median"]
    print(f"| a frame of the demo avatar in its light, without light | {lit:.2f}, {unlit:.2f} |")
for avatar in pose if isinstance(pose, list) else []:
    print(f"| the demo avatar, which is baked: posing, a frame | {avatar['pose_ms']['median']:.2f}, {avatar['frame_ms']['median']:.2f} |")
if train and "ms" in train:
    print(f"| a training step of `direct`, {train['gaussians']} Gaussians | {dict(train['ms'])['step']['median']:.1f} |")
if paper and "iterations" in paper:
    step = 1000 * paper["seconds"] / max(paper["iterations"], 1)
    print(f"| `{paper['preset']}`: iterations, ms each with all else, PSNR | {paper['iterations']}, {step:.0f}, {paper['psnr']:.2f} dB |")
print("\n| Gaussians | tier | forward | backward |\n|---|---|---|---|")
for name, part in parts.items():
    if name.startswith("splat-") and "forward_ms" in part:
        forward, backward = part["forward_ms"]["median"], part["backward_ms"]["median"]
        print(f"| {part['gaussians']} | {part['tier']} | {forward:.2f} | {backward:.2f} |")
TABLE
    cat "$out/figures.md"
fi
if [ ${#failed[@]} != 0 ]; then
    say "failed: ${failed[*]}; $parts has what they printed"
    exit 1
fi
