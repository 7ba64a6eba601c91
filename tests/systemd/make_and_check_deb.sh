#!/usr/bin/env bash
# Makes the Debian package of all of it twice and compares; asks lintian; installs it into an empty root, captures there
# as the package's program, and purges it.
# $WHEEL, if set, is grabberd's own wheel; otherwise it is built.
# usage: make_and_check_deb.sh SYSTEM_PYTHON BUILDING_PYTHON [BUNDLE]
set -euo pipefail
python=$1 building_python=$2 here=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "deb: $*"; exit 1; }
unset PYTHONPATH
export COMPRESSION=${COMPRESSION:-1}

bundle=${3:-}
if [ -z "$bundle" ]; then
    bash "$here/systemd/bundle.sh" "$building_python" "$work/bundle" >/dev/null
    bundle=$(echo "$work"/bundle/*.tar.gz)
fi
for one in first second; do
    bash "$here/systemd/deb.sh" "$bundle" "$python" "$work/$one" >/dev/null
done
(cd "$work/second" && sha256sum --check --quiet "$work/first/SHA256SUMS") || fail "two builds differ"
deb=$(echo "$work"/first/*.deb)
rm -r "$work/second"
echo "deb: two builds are the same $(stat -c %s "$deb" | awk '{printf "%.0f MB", $1 / 1e6}'), $(grep -c '"purl"' "$work"/first/*.cdx.json) packages in it"

if command -v lintian >/dev/null; then
    lintian --fail-on error,warning --tag-display-limit 0 "$deb" || fail "lintian finds the above"
    echo "deb: lintian has nothing against it"
else
    echo "deb: lintian is missing, so it was NOT asked: sudo apt-get install lintian"
fi

root=$work/root database=$work/root/var/lib/dpkg
mkdir -p "$database"/{updates,info,triggers}
touch "$database"/{status,available}
dpkg() { DEBIAN_FRONTEND=noninteractive command dpkg --root="$root" --force-depends --force-script-chrootless --force-not-root --no-triggers "$@" >"$work/said" 2>&1 || { cat "$work/said"; fail "dpkg $*"; }; }
dpkg --install "$deb"
grabberd() { env -i PATH=/usr/bin:/bin HOME="$work" "$root/usr/lib/grabberd/bin/python" -c 'from grabberd.cli import main; main()' "$@"; }
test -s "$(echo "$root"/usr/lib/grabberd/lib/python3*/site-packages/grabberd/web/site/index.html)" || fail "it has no documentation to serve at /docs"
grabberd check-config "$root/etc/grabberd/grabberd.yaml" >/dev/null
grabberd capture --fields 32 --out "$work/liner.grab"
dpkg --purge grabberd
test -z "$(find "$root" -type f ! -path "$database/*")" || fail "purged, it leaves $(find "$root" -type f ! -path "$database/*" | head)"
echo "deb: installed into an empty root, captured there, purged"
