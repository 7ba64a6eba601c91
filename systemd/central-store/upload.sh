#!/bin/sh
# Copies sealed captures to a central store; with KEEP_DAYS, removes here what is older and proven to be there.
# Its settings are upload.env's. Any flag of rclone is a variable: --bwlimit is RCLONE_BWLIMIT.
set -eu
: "${STORE:?name the store, e.g. STORE=store:herd/barn-12}"
captures=${CAPTURES:-/var/lib/grabberd/captures}
url=${URL:-http://127.0.0.1:8050}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# A capture is given this name when it is whole. What is there already is passed over; every copy is checked as it is made.
rclone copy "$captures" "$STORE" --include '/*.grab'

test -n "${KEEP_DAYS:-}" || exit 0

# Every byte of what may go is compared again, by its hash, or by reading the copy where the store has none.
differ=0
# shellcheck disable=SC2086
rclone check "$captures" "$STORE" --one-way --include '/*.grab' --min-age "${KEEP_DAYS}d" \
    --match "$work/proven" ${CHECK_BY:-} || differ=$?

: >"$work/header"
token=${CREDENTIALS_DIRECTORY:-/nowhere}/token
test ! -r "$token" || printf 'Authorization: Bearer %s\n' "$(cat "$token")" >"$work/header"

# The daemon removes them: it knows which are pinned, or worked on.
while read -r name; do
    answer=$(curl --silent --show-error --output "$work/answer" --write-out '%{http_code}' --request DELETE \
        --header "@$work/header" "$url/api/v1/captures/${name%.grab}")
    case $answer in
    20?) echo "$name: removed here, $STORE has it" ;;
    404) echo "$name: the daemon does not know it; it stays" ;;
    409) echo "$name: pinned, or worked on; it stays" ;;
    *) echo "$name: the daemon answers $answer: $(cat "$work/answer")" >&2; exit 1 ;;
    esac
done <"$work/proven"
test "$differ" = 0 || { echo "some captures are not as they are in $STORE; none of these was removed" >&2; exit "$differ"; }
