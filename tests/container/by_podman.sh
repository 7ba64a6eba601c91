# Runs the image by podman: what it says, and a daemon that is started, asked, and stopped.
#
# Sourced by build_and_run.sh, which has `podman`, `work` and the image `grabberd`.
# shellcheck shell=bash disable=SC2154
runtime=${RUNTIME:-$(command -v runc || true)}

prepare() { podman volume create captures >/dev/null; }

contained() { # OPTIONS, IMAGE AND COMMAND
    # Limits that nobody has to raise, and no timer of systemd's for the health: neither can be had everywhere.
    podman ${runtime:+--runtime "$runtime"} run --ulimit nofile=1024:1024 --ulimit nproc=1000:1000 --health-interval disable \
        --read-only --cap-drop=all --security-opt=no-new-privileges --network none \
        --tmpfs /tmp --volume captures:/var/lib/grabberd "$@"
}
run() { contained --rm grabberd "$@"; }
start() { contained --detach --name grabberd grabberd "$@" >/dev/null; }
is_healthy() { podman healthcheck run grabberd >/dev/null; }
beside_it() { podman exec grabberd "$@"; }
said() { podman logs grabberd; }
stop() {
    podman stop --time 20 grabberd >/dev/null
    podman rm grabberd >/dev/null
}
