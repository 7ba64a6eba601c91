#!/bin/sh
# The Debian package's half of an installation: lays out its files, and does what its maintainer scripts ask for.
#
#   package.sh tree                        a release and what belongs to it, into DESTDIR, from the wheels beside this
#   package.sh configure VERSION [BEFORE]  after unpacking: the state is checked and saved, the daemon started and asked;
#                                          BEFORE is the version that was configured here, both by dpkg's numbering
#   package.sh stop | remove               before the files are replaced, before they go
#
# What is done is release.sh's, as in installer.sh; what dpkg does by itself (files in their places, undoing that) is not.
# DESTDIR, LIVE, HEALTH_S: see installer.sh.
set -eu

PREFIX=/usr/lib/grabberd
LIB=/usr/lib
LINK=/usr/bin/grabberd
here=$(cd "$(dirname "$0")" && pwd)
# shellcheck source=release.sh
. "$here/release.sh"

# ---- when the package is made

do_tree() {
    [ -n "$DESTDIR" ] || fail "DESTDIR names no folder to lay the package out in"
    check_python
    new=$DESTDIR$PREFIX
    export PIP_NO_COMPILE=1 PYTHONDONTWRITEBYTECODE=1
    step_packages
    strip_release
    step_imports
    compile_release
    # The same program as installer.sh's, at another place.
    grep -rIl /opt/grabberd/current "$new/share" | grep -v '\.sh$' | xargs -r sed -i "s|/opt/grabberd/current|$PREFIX|g"
    system_files | while read -r to from; do
        install -D -m 644 "$new/$from" "$DESTDIR$to"
    done
    install -D -m 644 "$new/share/grabberd/configs/v4l2.yaml" "$DESTDIR$CONFIG"
    mkdir -p "$DESTDIR$(dirname "$LINK")"
    ln -sfn "..${PREFIX#/usr}/bin/grabberd" "$DESTDIR$LINK"
}

# dpkg manages these files, so what pip would need to do it goes; and the tests of other people's packages.
strip_release() {
    site=$(echo "$new"/lib/python3*/site-packages)
    rm -rf "$site"/pip "$site"/pip-*.dist-info "$site"/setuptools "$site"/setuptools-*.dist-info "$site"/pkg_resources \
        "$site"/_distutils_hack "$site"/distutils-precedence.pth "$new"/include
    find "$new/bin" ! -name 'python*' ! -name grabberd ! -type d -delete
    # Where and when it was installed, and digests of what was changed since.
    rm -f "$site"/*.dist-info/direct_url.json "$site"/*.dist-info/RECORD "$site"/*.dist-info/REQUESTED
    find "$site" -mindepth 2 -type d -name tests ! -path "$site/grabberd*" -prune -exec rm -rf {} +
    find "$new" -type d -name __pycache__ -prune -exec rm -rf {} +
    find "$site" -name '*.so*' -type f -exec chmod 644 {} +
    # What makes packages, and the other way to install.
    cd "$new/share/grabberd/systemd"
    rm -rf bundle.sh deb.sh check-units.sh installer.sh debian Containerfile
    find . -name '*.sh' ! -name release.sh -exec chmod 755 {} +
    cd - >/dev/null
}

# By one process in one order, with digests in place of times: the same bytes every time.
compile_release() {
    PYTHONHASHSEED=0 "$new/bin/python" -m compileall -q --invalidation-mode unchecked-hash -s "$DESTDIR" \
        "$new"/lib/python3*/site-packages
}

# ---- when it is installed

do_configure() {
    new=$DESTDIR$PREFIX version=$1 old=${2:-} old_version=${2:-}
    # What is older, or was here before an upgrade that failed, goes back to the state that it knew, if it cannot
    # read today's.
    if [ -n "$old" ] && dpkg --compare-versions "$old" ge "$version"; then is_rollback=yes; fi
    step_version
    step_users
    grabberd "$new" check-config "$DESTDIR$CONFIG" >/dev/null || say "$CONFIG has to be fixed before the daemon can run"
    step_state
    step_backup
    [ -z "$is_restored" ] || restore_state
    keep_saved
    step_units
    step_start
    step_health
    [ -n "$old" ] || say_where
}

# What who has just installed it looks for.
say_where() {
    say "configuration: $CONFIG   captures: $STATE/captures"
    ! is_live || is_masked || say "page: http://$(systemctl show grabberd.socket -p Listen --value | sed 's/ .*//')"
}

# Also where no systemd runs: in the image of a machine that boots later.
step_users() {
    [ -z "$DESTDIR" ] || return 0
    systemd-sysusers
    systemd-tmpfiles --create grabberd.conf
}

restore_state() {
    as_owner cp -p "$saved/state.sqlite" "$state/state.sqlite.new"
    put_state "$state/state.sqlite.new"
    say "settings, tokens, pins and notes are those from before the upgrade: it cannot read later ones, which are kept in $saved"
}

# ---- when it goes

do_stop() {
    # shellcheck disable=SC2086
    ! is_live || systemctl stop $UNITS
}

do_remove() {
    do_stop
    # shellcheck disable=SC2086
    ! is_live || systemctl disable --quiet $UNITS
    rm -rf "$DESTDIR$CACHE"
}

case ${1:-} in
    tree) do_tree ;;
    configure) shift; do_configure "$@" ;;
    stop) do_stop ;;
    remove) do_remove ;;
    *) fail "tree, configure, stop or remove, not ${1:-nothing}" ;;
esac
