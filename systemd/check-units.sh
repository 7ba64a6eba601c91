#!/usr/bin/env bash
# Whether systemd accepts the units with and without every drop-in, and how exposed it finds the daemon.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
command -v systemd-analyze >/dev/null || { echo "check-units: left out, systemd-analyze is missing: apt-get install systemd"; exit 0; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

check() { # NAME OF MOST EXPOSURE (TENTHS) DROP-INS...
    local name=$1 most=$2
    shift 2
    local units="$work/$name"
    mkdir -p "$units"/grabberd.service.d "$units"/grabberd.socket.d
    cp "$here"/grabberd.socket "$units"
    sed 's|^ExecStart=[^ ]*|ExecStart=/bin/true|' "$here/grabberd.service" >"$units/grabberd.service" # installed or not
    for drop_in in "$@"; do
        cp "$here/drop-ins/$drop_in.conf" "$units/grabberd.$(of_unit "$drop_in").d/"
    done
    local complaints
    complaints=$(SYSTEMD_UNIT_PATH="$units:" systemd-analyze verify --man=no "$units"/grabberd.service "$units"/grabberd.socket 2>&1) || true
    test -z "$complaints" || { echo "check-units: $name: $complaints"; return 1; }
    SYSTEMD_UNIT_PATH="$units:" systemd-analyze security --offline=true --no-pager --threshold="$most" "$units/grabberd.service" >"$work/table" ||
        { grep -v ✓ "$work/table"; echo "check-units: $name: more exposed than $most tenths"; return 1; }
    echo "check-units: $name:$(tail -1 "$work/table" | sed 's/.*:\(.*[0-9]\).*/\1/') of at most ${most%?}.${most: -1}"
}

of_unit() { case $1 in network) echo socket ;; *) echo service ;; esac; }

check default 10
check usb-reset 10 usb-reset
check loggers 10 loggers
check light 10 light
check network 10 network tls
check egress 15 egress
check everything 15 egress usb-reset network tls loggers light
