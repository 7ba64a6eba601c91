#!/usr/bin/env bash
# Packs a bundle, installs it from an empty directory into an empty root, without any index of packages; runs it
# there; installs it again, goes back, removes it. What a person has changed and what was captured has to survive.
# usage: bundle_and_install.sh SYSTEM_PYTHON BUILDING_PYTHON [BUNDLE]
set -euo pipefail
python=$1 building_python=$(cd "$(dirname "$2")" && pwd)/$(basename "$2") here=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
root=$work/root config=$work/root/etc/grabberd/grabberd.yaml

must() { "$@" || { echo "install: failed: $*"; exit 1; }; }
must_not() { ! "$@" || { echo "install: must not be: $*"; exit 1; }; }
cleanly() { env -i PATH=/usr/bin:/bin:/usr/sbin HOME="$work" PIP_CONFIG_FILE=/dev/null DESTDIR="$root" PYTHON="$python" "$@"; }

if [ $# -gt 2 ]; then
    cp "$3" "$work"
else
    PIP_QUIET=2 bash "$here/systemd/bundle.sh" "$building_python" "$work" >/dev/null
fi
cd "$work"
tar xf grabberd-*.tar.gz
bundle=$(echo "$work"/grabberd-*/)

must cleanly sh "$bundle/installer.sh" >"$work/first"
for file in /usr/local/bin/grabberd /usr/local/lib/{systemd/system/grabberd.{service,socket},sysusers.d/grabberd.conf} \
    /usr/local/lib/{tmpfiles.d/grabberd.conf,udev/rules.d/72-grabberd.rules,modprobe.d/grabberd.conf} /etc/grabberd/grabberd.yaml; do
    must test -e "$root$file" -o -L "$root$file"
done
must test "$(readlink "$root/usr/local/bin/grabberd")" = /opt/grabberd/current/bin/grabberd
for named in $(grep -ohE '/opt/grabberd/[^ ]+' "$root"/usr/local/lib/systemd/system/grabberd.*); do
    must test -e "$root$named"
done
must_not grep -rIq "$root" "$root/opt/grabberd/current/bin" "$root/usr" "$root/etc"

grabberd() { cleanly "$root/opt/grabberd/current/bin/python" -c 'from grabberd.cli import main; main()' "$@"; }
must grabberd check-config "$config" >/dev/null
must grabberd capture --fields 32 --out "$work/liner.grab"
if command -v systemd-analyze >/dev/null; then # the same within the unit's filters
    sandboxed="$here/tests/systemd/sandbox.py $here/systemd/grabberd.service $root/opt/grabberd/current/bin/python"
    for command in "capture --fields 8 --out $work/sandboxed.grab" devices; do
        # shellcheck disable=SC2086
        must cleanly "$python" $sandboxed -c 'from grabberd.cli import main; main()' $command >/dev/null
    done
fi
must mkdir -p "$root/var/lib/grabberd/captures"
cp "$work/liner.grab" "$root/var/lib/grabberd/captures"

echo "# ours" >>"$config"
before=$(readlink "$root/opt/grabberd/current")
mv "$bundle/constraints.txt" "$bundle/away"
must_not cleanly sh "$bundle/installer.sh" >"$work/failing" 2>&1
must test "$(readlink "$root/opt/grabberd/current")" = "$before"
must test "$(ls "$root/opt/grabberd/releases" | wc -l)" = 1
mv "$bundle/away" "$bundle/constraints.txt"
must cleanly sh "$bundle/installer.sh" >"$work/second"
after=$(readlink "$root/opt/grabberd/current")
must test "$after" != "$before"
must test "$(readlink "$root/opt/grabberd/previous")" = "$before"
must test "$(ls "$root/opt/grabberd/releases" | wc -l)" = 2
must cleanly sh "$root/opt/grabberd/current/share/grabberd/systemd/installer.sh" rollback >"$work/back"
must test "$(readlink "$root/opt/grabberd/current")" = "$before"
must test "$(readlink "$root/opt/grabberd/previous")" = "$after"
must grep -q "# ours" "$config"
must grabberd export "$work/liner.grab" --format csv --out "$work/exported" >/dev/null

must cleanly sh "$root/opt/grabberd/current/share/grabberd/systemd/installer.sh" uninstall >"$work/third"
must grep -q /var/lib/grabberd "$work/third"
left=$(cd "$root" && find . -type f | sort)
must test "$left" = "$(printf '%s\n' ./etc/grabberd/grabberd.yaml ./var/lib/grabberd/captures/liner.grab)"
must cleanly sh "$bundle/installer.sh" uninstall >/dev/null

echo "install: from a bundle into an empty root, again over itself, back to the release before, and away; configuration and captures stayed"
