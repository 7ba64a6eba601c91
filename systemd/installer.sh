#!/bin/sh
# Installs grabberd, or removes it but for its captures and configuration.
#
#   installer.sh install [SOURCE CONSTRAINTS]    from a checkout or a wheel; a bundle brings all it needs, and no
#                                                internet is needed
#   installer.sh uninstall
#
# DESTDIR: a root to install into, in place of this machine's.   PYTHON: in place of /usr/bin/python3.
# A release is complete before it takes the place of the one before, so what fails changes nothing.
set -eu

PREFIX=/opt/grabberd
LIB=/usr/local/lib
LINK=/usr/local/bin/grabberd
CONFIG=/etc/grabberd/grabberd.yaml
STATE=/var/lib/grabberd
CACHE=/var/cache/grabberd
UNITS="grabberd.socket grabberd.service"
DESTDIR=${DESTDIR:-}
PYTHON=${PYTHON:-/usr/bin/python3}
here=$(cd "$(dirname "$0")" && pwd)

say() { echo "grabberd: $*"; }
fail() { echo "grabberd: $*" >&2; exit 1; }
is_live() { [ -z "$DESTDIR" ] && [ -d /run/systemd/system ]; }
check_root() { [ -n "$DESTDIR" ] || [ "$(id -u)" = 0 ] || fail "only root can do this: sudo make install"; }

# Every file of the system that is ours: where it goes, and where in the release it comes from.
system_files() {
    cat <<-END
	$LIB/systemd/system/grabberd.service share/grabberd/systemd/grabberd.service
	$LIB/systemd/system/grabberd.socket share/grabberd/systemd/grabberd.socket
	$LIB/sysusers.d/grabberd.conf share/grabberd/systemd/sysusers.conf
	$LIB/tmpfiles.d/grabberd.conf share/grabberd/systemd/tmpfiles.conf
	$LIB/udev/rules.d/72-grabberd.rules driver/udev/72-grabberd.rules
	$LIB/modprobe.d/grabberd.conf driver/modprobe/grabberd.conf
	END
}

check_python() {
    command -v "$PYTHON" >/dev/null || fail "$PYTHON is missing: apt-get install python3 python3-venv"
    "$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || fail "$PYTHON is older than 3.11"
    "$PYTHON" -c 'import venv, ensurepip' 2>/dev/null || fail "the venv module is missing: apt-get install python3-venv"
    case $("$PYTHON" -c 'import os, sys; print(os.path.realpath(sys.executable))') in
        /home/* | /root/* | /run/user/*)
            fail "the daemon cannot see $PYTHON, which is in somebody's home: PYTHON=/usr/bin/python3" ;;
    esac
    [ ! -f "$here/made-for" ] || [ "$(cat "$here/made-for")" = "$(python_kind)" ] ||
        fail "this bundle is for $(cat "$here/made-for"); $PYTHON is $(python_kind)"
}

python_kind() { "$PYTHON" -c 'import sys, platform as p; print("Python %d.%d on" % sys.version_info[:2], p.machine())'; }

install_packages() { # into $release
    "$PYTHON" -m venv "$release"
    if [ -d "$here/wheels" ]; then
        set -- "$here"/wheels/grabberd-*.whl "$here/constraints.txt" --no-index --find-links "$here/wheels"
    fi
    [ $# -ge 2 ] || fail "name what to install, or take the installer of a bundle: make bundle"
    source=$1 constraints=$2
    shift 2
    "$release/bin/python" -m pip install --quiet --disable-pip-version-check "$@" \
        --constraint "$constraints" "$source[report,mqtt]"
    ln -s "$("$release/bin/python" -c 'import grabberd_v4l2 as d; print(d.__path__[0])' |
        sed "s|^$release/||")" "$release/driver"
    [ -z "$DESTDIR" ] || grep -rIl "$DESTDIR" "$release/bin" "$release/pyvenv.cfg" | xargs -r sed -i "s|$DESTDIR||g"
}

install_files() {
    system_files | while read -r to from; do
        install -D -m 644 "$release/$from" "$DESTDIR$to"
    done
    install -d "$DESTDIR$(dirname "$LINK")"
    ln -sfn "$PREFIX/current/bin/grabberd" "$DESTDIR$LINK"
    if [ -e "$DESTDIR$CONFIG" ]; then
        say "$CONFIG is kept as it is"
    else
        install -D -m 644 "$release/share/grabberd/configs/v4l2.yaml" "$DESTDIR$CONFIG"
    fi
}

do_install() {
    check_root
    check_python
    releases="$DESTDIR$PREFIX/releases"
    mkdir -p "$releases"
    release=$(mktemp -d "$releases/$(date -u +%Y%m%dT%H%M%SZ)-XXXX")
    chmod 755 "$release"
    trap 'rm -rf "$release"' EXIT
    install_packages "$@"
    trap - EXIT
    ! is_live || stop_units
    ln -s "releases/$(basename "$release")" "$DESTDIR$PREFIX/current.new"
    mv -T "$DESTDIR$PREFIX/current.new" "$DESTDIR$PREFIX/current"
    install_files
    find "$releases" -mindepth 1 -maxdepth 1 ! -path "$release" -exec rm -rf {} +
    say "$("$release/bin/python" -c 'import grabberd; print(grabberd.__version__)') is installed in $PREFIX"
    ! is_live || start_units
    say "configuration: $CONFIG   captures: $STATE/captures   removal: sh $PREFIX/current/share/grabberd/systemd/installer.sh uninstall"
}

start_units() {
    systemd-sysusers
    systemd-tmpfiles --create grabberd.conf
    reload
    # shellcheck disable=SC2086
    systemctl enable --quiet $UNITS
    # shellcheck disable=SC2086
    systemctl start $UNITS || say "the daemon does not run yet: journalctl -u grabberd says why"
}

stop_units() {
    # shellcheck disable=SC2086
    systemctl stop $UNITS 2>/dev/null || true
}

reload() {
    systemctl daemon-reload
    if command -v udevadm >/dev/null; then
        udevadm control --reload
        udevadm trigger --subsystem-match=video4linux --subsystem-match=usb
    fi
}

do_uninstall() {
    check_root
    if is_live; then
        stop_units
        # shellcheck disable=SC2086
        systemctl disable --quiet $UNITS 2>/dev/null || true
    fi
    system_files | while read -r to from; do
        rm -f "$DESTDIR$to"
    done
    rm -rf "$DESTDIR$PREFIX" "$DESTDIR$LINK" "$DESTDIR$CACHE"
    ! is_live || reload
    say "removed; kept are the captures in $STATE, the configuration in /etc/grabberd, the user grabberd"
    say "to part with them, too: rm -r $STATE /etc/grabberd; userdel grabberd"
}

[ -z "$DESTDIR" ] || DESTDIR=$(mkdir -p "$DESTDIR" && cd "$DESTDIR" && pwd)
case ${1:-install} in
    install) [ $# = 0 ] || shift; do_install "$@" ;;
    uninstall) do_uninstall ;;
    *) fail "install or uninstall, not $1" ;;
esac
