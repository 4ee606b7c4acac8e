#!/usr/bin/env bash
# Makes figures of docs/results.md and lab/2026-11-results.md again, one entry after the other, and prints them as a
# Markdown table. An entry whose folder out/results/ENTRY already has figures is not made again.
#
#     scripts/results.sh              all entries whose captures are there
#     scripts/results.sh ENTRY...     only these
#     scripts/results.sh --list       the names of all entries
#     scripts/results.sh --table      only the table of what is there
#
# The captures blender-a and blender-d are looked for in GHAND_CAPTURES, default ../shared/captures,
# relative to the checkout.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

captures=${GHAND_CAPTURES:-../shared/captures}
results=out/results

say() { echo "results: $*" >&2; }

# Entry, capture (`-` for the demo's own), options of `train`. All entries of a capture share its settings.
blender="--set iterations=1500"
entries=$(
    cat <<ENTRIES
demo - --set iterations=660
blender-a-given blender-a $blender --set align=off
blender-a-paper blender-a $blender --set align=paper
blender-a-aligned blender-a $blender
blender-a-true blender-a $blender --poses truth
blender-a-train5 blender-a $blender --split train5
blender-d-given blender-d $blender --set align=off
blender-d-paper blender-d $blender --set align=paper
blender-d-aligned blender-d $blender
blender-d-true blender-d $blender --poses truth
ENTRIES
    # What light and surface bring, one after the other, with true poses.
    for capture in demo blender-a blender-d; do
        from=$([ $capture = demo ] && echo - || echo $capture)
        settings="--set iterations=300 --poses truth --set antialias=off"
        [ $capture = demo ] || settings="$settings --set uv_resolution=192"
        plain="--set gaussians=round --set color_roughness=0 --set unseen=off"
        while read -r rung options; do
            echo "ladder-$rung-$capture $from $settings $options"
        done <<RUNGS
none $plain --set light=off
transfer $plain --set light=transfer --set gloss=off
gloss $plain --set light=transfer --set gloss=always
surface --set unseen=off --set light=transfer --set gloss=always
unseen --set light=transfer --set gloss=always
RUNGS
    done
)
names=$(awk '{ print $1 }' <<<"$entries")

# A run that was stopped early has figures, but not those of the entry.
is_there() {
    [ -e "$1/metrics.json" ] && ! grep -q '"stopped_early": true' "$1/metrics.json"
}

# Trains an entry and evaluates it in test poses that are aligned, and that are fitted to masks. The exit code is that of the
# first program that fails.
make_entry() {
    local name=$1 capture=$2 folder=$results/$1
    shift 2
    local at=() made=$folder/capture
    if [ "$capture" != - ]; then
        at=(--capture "$captures/$capture")
        made=$captures/$capture
        if [ ! -e "$made/capture.json" ]; then
            say "$name: skipped, $made is not there"
            return 0
        fi
    fi
    if is_there "$folder"; then
        say "$name: already in $folder"
    else
        say "$name: training"
        rm -f "$folder"/protocol-*/metrics.json
        # Output goes to stderr: stdout is for the table alone.
        cargo run --quiet --bin train -- "${at[@]}" --out "$folder" --force "$@" >&2 || return
    fi
    local protocol
    for protocol in aligned masks; do
        if is_there "$folder/protocol-$protocol"; then continue; fi
        say "$name: protocol $protocol"
        cargo run --quiet --bin ghand -- evaluate "$folder/avatar.ghand" --capture "$made" --protocol $protocol \
            --out "$folder/protocol-$protocol" --force >&2 || return
    done
}

# One row from a metrics.json, which has one field per line; those of the floor are indented once more.
print_row() {
    awk -v entry="$1" '
        { key = $1; value = $2; gsub(/[":,]/, "", key); gsub(/[",]/, "", value) }
        /^  "floor"/ || /^  "squared_error"/ || /^  "pose_error_deg"/ { group = key; next }
        /^  [^ ]/ { top[key] = value; group = "" }
        /^    "/ { inner[group "." key] = value }
        function number(value, format) { return value == "" || value == "null" ? "" : sprintf(format, value) }
        function both(floor, avatar, format) { return number(floor, format) ", " number(avatar, format) }
        END {
            error = "pose_error_deg."
            print "| " entry " | " top["protocol"] " | " top["poses"] " | " top["frames"] " | " top["iterations"] \
                " | " both(inner["floor.psnr"], top["psnr"], "%.2f") \
                " | " both(inner["floor.psnr_hand"], top["psnr_hand"], "%.2f") \
                " | " both(inner["floor.ssim"], top["ssim"], "%.4f") \
                " | " both(inner[error "before"], inner[error "after"], "%.2f") \
                " | " number(top["seconds"], "%.0f") " |"
        }' "$2"
}

print_table() {
    echo "| entry | protocol | poses | images | iterations | PSNR: floor, avatar | on the hand | SSIM | pose error: before, refined | seconds |"
    echo "|---|---|---|---|---|---|---|---|---|---|"
    local name folder
    for name in $names; do
        for folder in "$results/$name" "$results/$name"/protocol-{aligned,masks}; do
            if is_there "$folder"; then print_row "$name" "$folder/metrics.json"; fi
        done
    done
}

wanted=$names
case "${1:-}" in
--list)
    echo "$names"
    exit 0
    ;;
--table)
    print_table
    exit 0
    ;;
"") ;;
*)
    wanted=$(printf '%s\n' "$@")
    for name in "$@"; do
        if ! grep -qxF -- "$name" <<<"$names"; then
            say "there is no entry $name; --list names all"
            exit 1
        fi
    done
    ;;
esac

failed=()
while read -r name capture options; do
    if ! grep -qxF -- "$name" <<<"$wanted"; then continue; fi
    # The options hold no spaces but those between them.
    read -ra options <<<"$options"
    status=0
    make_entry "$name" "$capture" "${options[@]}" </dev/null || status=$?
    if [ "$status" = 130 ]; then exit 130; fi
    if [ "$status" != 0 ]; then failed+=("$name"); fi
done <<<"$entries"

print_table
if [ ${#failed[@]} != 0 ]; then
    say "failed: ${failed[*]}"
    exit 1
fi
