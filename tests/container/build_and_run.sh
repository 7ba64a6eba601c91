#!/usr/bin/env bash
# Builds the image from a bundle, on a Debian made of this machine's own sources, and runs it with a root that is only
# read: it becomes healthy, captures, keeps the capture in its volume over a restart, and says no to who has no token.
# usage: build_and_run.sh BUILDING_PYTHON [BUNDLE]
# $WHEEL, if set, is grabberd's own wheel; otherwise it is built.
# RUNTIME: in place of runc or podman's own; /bin/false: as where none can make a container.
# DRIVER=vfs: where there is no overlay file system (slow: every layer is a copy).
set -euo pipefail
python=$1 here=$(cd "$(dirname "$0")/../.." && pwd)
for program in podman mmdebstrap; do
    command -v $program >/dev/null || { echo "container: NOT tested, $program is missing: sudo apt-get install podman mmdebstrap"; exit 0; }
done
test "$(id -u)" = 0 || { echo "container: NOT tested, the base is made by root"; exit 0; }
work=$(mktemp -d)
# A store of its own: nothing of this machine's images is touched, and nothing stays.
podman() { command podman --root "$work/store" --runroot "$work/run" --storage-driver "${DRIVER:-overlay}" --cgroup-manager cgroupfs --log-level fatal "$@"; }
trap '[ -z "${daemon:-}" ] || kill "$daemon"; podman rm --force --all >/dev/null 2>&1 || true; podman image unmount --all --force >/dev/null 2>&1 || true; podman unmount --all >/dev/null 2>&1 || true; rm -rf "$work"' EXIT
said() { :; }
fail() { echo "container: $*"; said 2>&1 | tail -20; exit 1; }

if [ $# -gt 1 ]; then
    mkdir "$work/context" && cp "$2" "$work/context"
else
    bash "$here/systemd/bundle.sh" "$python" "$work/context" >/dev/null
fi
base="$work/base.tar"
mmdebstrap --quiet --variant=minbase --include=python3,python3-venv,libusb-1.0-0 bookworm "$base" ${BASE_SOURCES:-}
podman import --quiet "$base" localhost/base >/dev/null
rm "$base"
isolation=${ISOLATION:-chroot}
podman build --quiet --layers=false --format docker --isolation "$isolation" --network host --build-arg BASE=localhost/base --tag grabberd \
    --file "$here/systemd/Containerfile" "$work/context" >"$work/built" 2>&1 || { cat "$work/built"; fail "cannot be built"; }
echo "container: built, $(podman image inspect --format '{{.Size}}' grabberd | awk '{printf "%.0f MB", $1 / 1e6}')"
test "$(podman image inspect --format '{{.Config.User}}' grabberd)" = 8050:8050 || fail "it runs as root"

how="by podman"
# shellcheck source=by_podman.sh
. "$here/tests/container/by_podman.sh"
prepare
probe=$(run --version 2>&1 | tr -d '\0') || {
    echo "container: this computer lets no runtime start one: $(tail -1 <<<"$probe")"
    how="in the image's root, without a runtime"
    # shellcheck source=by_chroot.sh
    . "$here/tests/container/by_chroot.sh"
    prepare
    probe=$(run --version 2>&1) || { echo "container: built, but NOT run: $(tail -1 <<<"$probe")"; exit 0; }
}
echo "container: $(tail -1 <<<"$probe"), run $how"

fake="--config /opt/grabberd/current/share/grabberd/configs/fake.yaml"
# shellcheck disable=SC2086
run serve --host 0.0.0.0 $fake >"$work/refused" 2>&1 && fail "it serves the network without a token"
grep -q "token" "$work/refused" || fail "it does not say why it serves nobody: $(cat "$work/refused")"

serve() { # UNTIL: healthz, it answers, or readyz, its fields arrive
    # shellcheck disable=SC2086
    start serve $fake
    for _ in $(seq 600); do
        ! ask "$1" >/dev/null || return 0
        read -rt .1 <> <(:) || true
    done
    fail "it does not say $1"
}
ask() { # ADDRESS [DOCUMENT]; from within: nothing of this computer's network is used
    beside_it /opt/grabberd/current/bin/python -c 'import sys, urllib.request as r; print(r.urlopen(r.Request(sys.argv[1], sys.argv[2].encode() if len(sys.argv) > 2 else None, {"Content-Type": "application/json"}), timeout=30).read().decode())' \
        "http://127.0.0.1:8050/$1" "${@:2}" 2>/dev/null
}
serve readyz
is_healthy || fail "it serves, but is not healthy by its own check"
ask api/v1/captures '{"fields": 25}' >"$work/begun" || fail "it does not capture"
id=$("$python" -c 'import json, sys; print(json.load(open(sys.argv[1]))["id"])' "$work/begun")
beside_it touch /opt/grabberd/written 2>"$work/refused" && fail "its root can be written"
grep -q "Read-only file system" "$work/refused" || fail "its root is not only read: $(cat "$work/refused")"
for _ in $(seq 300); do
    [[ $(ask "api/v1/captures/$id") != *'"complete"'* ]] || break
    read -rt .1 <> <(:) || true
done
stop
serve healthz
[[ $(ask "api/v1/captures/$id") == *'"complete"'* ]] || fail "the capture is not there after a restart"
stop
echo "container: with a root that is only read it captured 25 fields, and had them after a restart"
