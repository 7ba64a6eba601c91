#!/bin/sh
# Installs grabberd, upgrades it, goes back to the release before, or removes it but for its captures and configuration.
#
#   installer.sh install [SOURCE CONSTRAINTS]    from a checkout or a wheel; a bundle brings all it needs, and no
#                                                internet is needed
#   installer.sh rollback                        to the release before, with the state of then if it cannot read today's
#   installer.sh uninstall
#   installer.sh steps install|rollback          names their steps, in order
#
# A release is complete and checked beside the one that runs before it takes its place; the switch is the renaming of
# one link. Where a step fails, whatever came before it is undone, and the release of before runs on.
#
# DESTDIR: a root to install into, in place of this machine's.   PYTHON: in place of /usr/bin/python3.
# LIVE=yes: services run in DESTDIR, and systemctl of PATH manages them.   FAIL_AT=STEP: rehearses that this step fails.
# HEALTH_S: how long a daemon that was started may take to answer.
set -eu

CHECKS="imports version configuration state"
SWITCH="files stop backup switch units start health"
INSTALL_STEPS="space packages $CHECKS $SWITCH"
ROLLBACK_STEPS="$CHECKS $SWITCH"
FIRST_RELEASE_KB=800000
PREFIX=/opt/grabberd
LIB=/usr/local/lib
LINK=/usr/local/bin/grabberd
here=$(cd "$(dirname "$0")" && pwd)
# Which of the changes that can be undone have been made; release.sh has more.
is_stopped='' is_switched='' made=''
# shellcheck source=release.sh
. "$here/release.sh"

check_root() { [ -n "$DESTDIR" ] || [ "$(id -u)" = 0 ] || fail "only root can do this: sudo make install"; }

# ---- what a link of $PREFIX names

release_of() { # current or previous: its release; nothing, if there is none
    target=$(readlink "$root/$1") || return 0
    [ ! -d "$root/$target" ] || echo "$root/$target"
}

# ---- the checks, while the release of before runs

step_space() {
    need_kb=$FIRST_RELEASE_KB
    [ ! -d "$here/wheels" ] || need_kb=$(($(du -sk "$here/wheels" | cut -f1) * 4))
    [ -z "$old" ] || need_kb=$(($(du -sk "$old/" | cut -f1) * 6 / 5))
    free_kb=$(df -Pk "$root" | tail -1 | tr -s ' ' | cut -d' ' -f4)
    [ "$free_kb" -ge "$need_kb" ] ||
        fail "$PREFIX has $((free_kb / 1000)) MB free, a release needs $((need_kb / 1000)) MB: make room there"
}

# A configuration that the release of before refuses as well is not this one's fault.
step_configuration() {
    [ -e "$DESTDIR$CONFIG" ] || return 0
    ! grabberd "$new" check-config "$DESTDIR$CONFIG" >/dev/null || return 0
    [ -n "$old" ] && ! grabberd "$old" check-config "$DESTDIR$CONFIG" >/dev/null 2>&1 ||
        fail "$new_version does not accept $CONFIG; what it says stands above"
    say "$CONFIG is refused by $new_version, but also by $old_version"
}

# ---- the switch

# All that takes room is written here, so that switching and undoing are nothing but renaming.
step_files() {
    ln -sfn "releases/$(basename "$new")" "$root/current.new"
    if [ -n "$old" ]; then
        ln -sfn "releases/$(basename "$old")" "$root/current.old"
        ln -sfn "releases/$(basename "$old")" "$root/previous.new"
    fi
    system_files | while read -r to from; do
        install -D -m 644 "$new/$from" "$DESTDIR$to.new"
        [ ! -e "$DESTDIR$to" ] || ln -f "$DESTDIR$to" "$DESTDIR$to.old"
    done
    if [ -e "$DESTDIR$CONFIG" ]; then
        say "$CONFIG is kept as it is"
    else
        made=$CONFIG
        install -D -m 644 "$new/share/grabberd/configs/v4l2.yaml" "$DESTDIR$CONFIG"
    fi
    install -d "$DESTDIR$(dirname "$LINK")"
    ln -sfn "$PREFIX/current/bin/grabberd" "$DESTDIR$LINK"
}

step_stop() {
    is_stopped=yes
    # shellcheck disable=SC2086
    ! is_live || [ -z "$old" ] || systemctl stop $UNITS
}

step_switch() {
    [ -z "$is_restored" ] || as_owner cp -p "$saved/state.sqlite" "$state/state.sqlite.new"
    is_switched=yes
    mv -T "$root/current.new" "$root/current"
    system_files | while read -r to _; do
        mv -f "$DESTDIR$to.new" "$DESTDIR$to"
    done
    [ -z "$is_restored" ] || put_state "$state/state.sqlite.new"
}

# ---- all steps, or none

run_steps() {
    trap undo EXIT
    trap 'exit 1' INT TERM HUP
    for step in $1; do
        "step_$step"
        [ "$step" != "${FAIL_AT:-}" ] || fail "told to fail at $step"
    done
    trap - EXIT
    trap '' INT TERM HUP
    settle || say "some files of the upgrade could not be removed; the next one does it"
}

# The release of before, its files and its state are as they were: by renaming alone, which a full disk allows.
undo() {
    trap - EXIT
    trap '' INT TERM HUP
    set +e
    if [ -n "$is_switched" ]; then
        ! is_live || leave_new
        switch_back
        ! is_live || reload >&2
    fi
    if [ -n "$is_saved" ]; then
        put_state "$saved.new/state.sqlite"
        [ ! -f "$saved.new/state.sqlite-journal" ] || as_owner mv -f "$saved.new/state.sqlite-journal" "$state"
    fi
    [ -n "$is_rollback" ] || rm -rf "$new"
    [ -n "$old" ] || rm -f "$DESTDIR$LINK" ${made:+"$DESTDIR$made"}
    forget_staged
    say "failed at the step '$step'; why stands above" >&2
    [ -z "$old" ] || say "$(run_again)" >&2
    exit 1
}

leave_new() { # as long as its units are there
    # shellcheck disable=SC2086
    systemctl stop $UNITS
    # shellcheck disable=SC2086
    [ -n "$old" ] || systemctl disable --quiet $UNITS
}

switch_back() {
    if [ -n "$old" ]; then mv -T "$root/current.old" "$root/current"; else rm -f "$root/current"; fi
    system_files | while read -r to _; do
        if [ -e "$DESTDIR$to.old" ]; then mv -f "$DESTDIR$to.old" "$DESTDIR$to"; else rm -f "$DESTDIR$to"; fi
    done
}

run_again() { # the old release, if it was stopped; how that went, in words
    if ! is_live || [ -z "$is_stopped" ]; then
        echo "$old_version is still the installed version, and was not disturbed"
        return
    fi
    if is_masked; then
        echo "$old_version is the installed version again; grabberd.service is masked, so it does not run"
    # shellcheck disable=SC2086
    elif systemctl start $UNITS >&2 && answers "$old_version" >&2; then
        echo "$old_version runs again, with its state as it was"
    else
        echo "$old_version is the installed version again, with its state as it was, but does not answer: journalctl -u grabberd says why"
    fi
}

# The release of before is kept, with the state that it left; older ones go.
settle() {
    [ -z "$old" ] || mv -T "$root/previous.new" "$root/previous"
    find "$root/releases" -mindepth 1 -maxdepth 1 ! -path "$new" ! -path "${old:-$new}" -exec rm -rf {} +
    keep_saved
    forget_staged
}

forget_staged() { # also what an installer left that was killed
    rm -f "$root/current.new" "$root/current.old" "$root/previous.new"
    system_files | while read -r to _; do
        rm -f "$DESTDIR$to.new" "$DESTDIR$to.old"
    done
    [ -n "$saved" ] && [ -d "$state" ] || return 0
    as_owner rm -rf "$saved.new" "$state/state.sqlite.new"
}

begin() {
    check_root
    check_python
    root=$DESTDIR$PREFIX
    mkdir -p "$root/releases"
    exec 9>"$root/lock"
    flock -n 9 || fail "another installation is running"
    forget_staged
    old=$(release_of current)
    [ -z "$old" ] || old_version=$(version_of "$old" 2>/dev/null) || old_version=''
}

do_install() {
    begin
    source=${1:-} constraints=${2:-}
    new=$(mktemp -d "$root/releases/$(date -u +%Y%m%dT%H%M%SZ)-XXXX")
    chmod 755 "$new"
    run_steps "$INSTALL_STEPS"
    say "$new_version is installed in $PREFIX"
    say "configuration: $CONFIG   captures: $STATE/captures   removal: sh $PREFIX/current/share/grabberd/systemd/installer.sh uninstall"
    [ -z "$old" ] || say "back to the release before: sh $PREFIX/current/share/grabberd/systemd/installer.sh rollback"
}

do_rollback() {
    begin
    is_rollback=yes
    new=$(release_of previous)
    [ -n "$old" ] && [ -n "$new" ] || fail "there is no release before; only the latest one is kept"
    run_steps "$ROLLBACK_STEPS"
    say "$new_version is installed again in $PREFIX, in place of $old_version"
    [ -z "$is_restored" ] ||
        say "settings, tokens, pins and notes are those from before the upgrade: it cannot read later ones, which are kept in $saved"
}

do_uninstall() {
    check_root
    if is_live; then
        # shellcheck disable=SC2086
        systemctl stop $UNITS 2>/dev/null || true
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
    rollback) do_rollback ;;
    uninstall) do_uninstall ;;
    steps) case ${2:-} in install) echo "$INSTALL_STEPS" ;; rollback) echo "$ROLLBACK_STEPS" ;; *) fail "steps install|rollback" ;; esac ;;
    *) fail "install, rollback or uninstall, not $1" ;;
esac
