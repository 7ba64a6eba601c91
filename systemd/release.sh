# The parts of an installation that installer.sh and the Debian package (package.sh) share: what belongs to it and
# where it goes, how a release is laid out and asked, how the state is saved, how the service is started.
#
# Sourced by both, which set `here`, their own folder, and
#   PREFIX  where releases, or the only one, go     LIB   what units, rules and options of modules lie below
#   LINK    the command
# shellcheck shell=sh disable=SC2034
CONFIG=/etc/grabberd/grabberd.yaml
STATE=/var/lib/grabberd
CACHE=/var/cache/grabberd
UNITS="grabberd.socket grabberd.service"
DESTDIR=${DESTDIR:-}
PYTHON=${PYTHON:-/usr/bin/python3}
HEALTH_S=${HEALTH_S:-60}
# The releases before and after, where the state is and its copy; whether the copy was made, or is to be put back.
old='' new='' old_version='' new_version='' state='' saved='' is_rollback='' is_saved='' is_restored=''

say() { echo "grabberd: $*"; }
fail() { echo "grabberd: $*" >&2; exit 1; }
is_live() { [ "${LIVE:-}" = yes ] || { [ -z "$DESTDIR" ] && [ -d /run/systemd/system ]; }; }

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

# ---- what a release says of itself

# As the daemon runs it: the installed configuration, the state directory of the unit.
program() { # RELEASE ARGUMENTS OF PYTHON
    release=$1
    shift
    STATE_DIRECTORY="$DESTDIR$STATE" "$release/bin/python" "$@"
}

grabberd() { # RELEASE ARGUMENTS OF grabberd
    release=$1
    shift
    program "$release" -c 'from grabberd.cli import main; main()' "$@"
}

version_of() { program "$1" -c 'import grabberd; print(grabberd.__version__)'; }

# ---- a release is laid out, and checked where it lies

step_packages() { # into $new
    "$PYTHON" -m venv "$new"
    if [ -d "$here/wheels" ]; then
        set -- "$here"/wheels/grabberd-*.whl "$here/constraints.txt" --no-index --find-links "$here/wheels"
    else
        [ -n "$source" ] || fail "name what to install, or take the installer of a bundle: make bundle"
        set -- "$source" "$constraints"
    fi
    what=$1 versions=$2
    shift 2
    "$new/bin/python" -m pip install --quiet --disable-pip-version-check "$@" --constraint "$versions" "$what[report,mqtt]"
    ln -s "$("$new/bin/python" -c 'import grabberd_v4l2 as d; print(d.__path__[0])' |
        sed "s|^$new/||")" "$new/driver"
    [ -z "$DESTDIR" ] || grep -rIl "$DESTDIR" "$new/bin" "$new/pyvenv.cfg" | xargs -r sed -i "s|$DESTDIR||g"
}

step_imports() { program "$new" "$here/release_checks.py" imports; }

step_version() {
    grabberd "$new" --version >/dev/null
    new_version=$(version_of "$new")
}

# ---- the state

step_state() {
    state=$(program "$new" "$here/release_checks.py" state-directory "$DESTDIR$CONFIG" 2>/dev/null) || state=$STATE
    case $state in "$DESTDIR"*) ;; *) state=$DESTDIR$state ;; esac
    saved=$state/before-upgrade
    [ -f "$state/state.sqlite" ] || return 0
    ! opens "$state/state.sqlite" || return 0
    [ -n "$is_rollback" ] && [ -f "$saved/state.sqlite" ] && opens "$saved/state.sqlite" ||
        fail "$new_version cannot open $state/state.sqlite; what it says stands above"
    is_restored=yes
}

opens() { program "$new" "$here/release_checks.py" state "$1"; } # whether the new release opens a copy of it

# Nobody writes the state now. With its journal, if a crash left one: together they are what they were.
step_backup() {
    [ -f "$state/state.sqlite" ] || return 0
    as_owner rm -rf "$saved.new"
    as_owner mkdir -m 700 "$saved.new"
    for file in state.sqlite state.sqlite-journal; do
        [ ! -f "$state/$file" ] || as_owner cp -p "$state/$file" "$saved.new/$file"
    done
    sync "$saved.new"/*
    is_saved=yes
}

# In the daemon's own folder root does nothing that its user could not do.
as_owner() {
    owner=$(stat -c %U "$state")
    if [ "$(id -u)" = 0 ] && [ "$owner" != root ]; then runuser -u "$owner" -- "$@"; else "$@"; fi
}

put_state() { # FILE in place of state.sqlite, without the journal that belongs to another
    as_owner rm -f "$state/state.sqlite-journal"
    as_owner mv -f "$1" "$state/state.sqlite"
}

# The copy from before takes the place of the one from before that.
keep_saved() {
    [ -n "$is_saved" ] || return 0
    as_owner rm -rf "$saved"
    as_owner mv -T "$saved.new" "$saved"
}

# ---- the service

step_units() {
    is_live || return 0
    systemd-sysusers
    systemd-tmpfiles --create grabberd.conf
    reload
    # shellcheck disable=SC2086
    is_masked || systemctl enable --quiet $UNITS
}

step_start() {
    is_live || return 0
    if is_masked; then
        say "grabberd.service is masked, so it is not started"
    elif [ -z "$old" ]; then # nothing else could run in its place
        # shellcheck disable=SC2086
        systemctl start $UNITS || say "the daemon does not run yet: journalctl -u grabberd says why"
    else
        # shellcheck disable=SC2086
        systemctl start $UNITS || fail "$new_version does not start: journalctl -u grabberd says why"
    fi
}

step_health() {
    ! is_live || [ -z "$old" ] || is_masked || answers "$new_version" ||
        fail "$new_version does not answer within $HEALTH_S s: journalctl -u grabberd says why"
}

reload() {
    systemctl daemon-reload
    if command -v udevadm >/dev/null; then
        udevadm control --reload
        udevadm trigger --subsystem-match=video4linux --subsystem-match=usb
    fi
}

is_masked() { [ "$(systemctl is-enabled grabberd.service 2>/dev/null)" = masked ]; }

answers() { # VERSION: whether the daemon answers, and as that
    "$PYTHON" "$here/release_checks.py" answers "$(systemctl show grabberd.socket -p Listen --value)" "$1" "$HEALTH_S"
}
