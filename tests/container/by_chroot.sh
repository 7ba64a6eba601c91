# Runs the image's program in the image's root, as its user and with its environment, where no runtime can make a container:
# a root that is only read, the volume, an empty /tmp, no capability, and none to be had.
#
# Sourced by build_and_run.sh, which has `podman`, `work` and the image `grabberd`.
# shellcheck shell=bash disable=SC2154
daemon=''

prepare() {
    root=$(podman image mount grabberd)
    mkdir -p "$work/root"
    install -d -o 8050 -g 8050 -m 750 "$work/captures"
    mapfile -t variables < <(podman image inspect --format '{{range .Config.Env}}{{println .}}{{end}}' grabberd | grep .)
    mapfile -t program < <(podman image inspect --format '{{range .Config.Entrypoint}}{{println .}}{{end}}' grabberd | grep .)
    mapfile -t check < <(podman image inspect --format '{{range .HealthCheck.Test}}{{println .}}{{end}}' grabberd | grep . | tail -n +2)
}

# A network of its own, without a way out; whoever is to talk to the daemon joins that.
inside() { # OPTIONS OF setpriv -- COMMAND; the process that is started becomes the command
    local network=(unshare --net sh -c 'ip link set lo up && exec "$@"' sh)
    [ -z "$daemon" ] || network=(nsenter --target "$daemon" --net)
    exec "${network[@]}" unshare --mount bash -euc '
        mount --bind "$1" "$2"
        mount -o remount,bind,ro "$2"
        mount -t tmpfs tmpfs "$2/tmp"
        mount --bind "$3" "$2/var/lib/grabberd"
        mount --rbind /dev "$2/dev"
        mount -t proc proc "$2/proc"
        cd "$2"
        shift 3
        exec chroot . setpriv --no-new-privs "$@"' in "$root" "$work/root" "$work/captures" "$@"
}
as_its_user() { inside --reuid 8050 --regid 8050 --clear-groups --inh-caps=-all --bounding-set=-all -- env -i "${variables[@]}" "$@"; }

run() { (as_its_user "${program[@]}" "$@"); }
start() {
    (as_its_user "${program[@]}" "$@") >"$work/said" 2>&1 &
    daemon=$!
}
is_healthy() { (as_its_user "${check[@]}") >"$work/health" 2>&1; }
beside_it() { (as_its_user "$@"); }
said() { cat "$work/said"; }
stop() { # 143: by the signal that it was sent, after it had ended everything itself
    local pid=$daemon code=0
    daemon=''
    kill -TERM "$pid"
    wait "$pid" || code=$?
    [[ $code = 0 || $code = 143 ]] || fail "it ends with $code when it is told to"
}
