#!/usr/bin/env bash
# Makes a Debian package of a bundle (bundle.sh), and beside it what is in it (CycloneDX) and digests of both.
# The same bundle gives the same bytes: times are SOURCE_DATE_EPOCH, that of the latest commit unless it is set.
# usage: deb.sh BUNDLE.tar.gz SYSTEM_PYTHON OUTPUT_DIRECTORY
# COMPRESSION: of dpkg-deb, 1 to 9.   PACKAGES: a folder with what a bundle of grabberd alone lacks.
set -euo pipefail
umask 022
bundle=$(realpath "$1") python=$2 output=$(mkdir -p "$3" && cd "$3" && pwd)
here=$(cd "$(dirname "$0")" && pwd)
for program in dpkg-deb dpkg; do
    command -v "$program" >/dev/null || { echo "deb: $program is missing: apt-get install dpkg"; exit 1; }
done
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git -C "$here" log -1 --format=%ct 2>/dev/null || stat -c %Y "$here/../pyproject.toml")}
export SOURCE_DATE_EPOCH LC_ALL=C.UTF-8 TZ=UTC
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

mkdir "$work/unpacked" "$work/tree"
tar xf "$bundle" --strip-components=1 --directory "$work/unpacked"
cp "$here"/{package.sh,release.sh,release_checks.py} "$work/unpacked"
DESTDIR=$work/tree PYTHON=$python PYTHONPATH=${PACKAGES:-} PIP_CONFIG_FILE=/dev/null sh "$work/unpacked/package.sh" tree

wheel=$(basename "$work"/unpacked/wheels/grabberd-*.whl)
version=$(cut -d- -f2 <<<"$wheel" | sed -E 's/\.?(dev|a|b|rc)([0-9]*)/~\1\2/')
architecture=$(dpkg --print-architecture)
name=grabberd_${version}_$architecture
numbers=$("$python" -c 'import sys; print("%d.%d %d.%d" % (*sys.version_info[:2], sys.version_info[0], sys.version_info[1] + 1))')

doc=$work/tree/usr/share/doc/grabberd
mkdir -p "$doc" "$work/tree/usr/share/lintian/overrides" "$work/tree/DEBIAN"
"$python" "$here/debian/copyright.py" "$work/tree/usr/lib/grabberd" >"$doc/copyright"
printf 'grabberd (%s) unstable; urgency=medium\n\n  * What changed for users: /docs/changelog/ of the daemon.\n\n -- %s  %s\n' \
    "$version" "$(sed -n 's/^Maintainer: //p' "$here/debian/control")" "$(date -R -d "@$SOURCE_DATE_EPOCH")" | gzip -9n >"$doc/changelog.gz"
cp "$here/debian/lintian-overrides" "$work/tree/usr/share/lintian/overrides/grabberd"
size_kb=$(find "$work/tree" -type f -printf '%s\n' | awk '{sum += $1} END {print int(sum / 1024) + 1}')
filled() {
    sed -e "s|@VERSION@|$version|; s|@ARCHITECTURE@|$architecture|; s|@SIZE@|$size_kb|" \
        -e "s|@PYTHON@|${numbers% *}|; s|@PYTHON_AFTER@|${numbers#* }|" "$here/debian/$1"
}
filled control >"$work/control"
for script in preinst postinst prerm postrm; do
    filled "$script" >"$work/tree/DEBIAN/$script"
    chmod 755 "$work/tree/DEBIAN/$script"
done
mv "$work/control" "$work/tree/DEBIAN/control"
echo /etc/grabberd/grabberd.yaml >"$work/tree/DEBIAN/conffiles"
(cd "$work/tree" && find . -type f ! -path './DEBIAN/*' ! -path ./etc/grabberd/grabberd.yaml -printf '%P\0' | sort -z | xargs -0 md5sum >DEBIAN/md5sums)
chmod -R u=rwX,go=rX "$work/tree"
find "$work/tree" -exec touch --no-dereference --date "@$SOURCE_DATE_EPOCH" {} +

dpkg-deb --root-owner-group -Zxz "-z${COMPRESSION:-6}" --build "$work/tree" "$output/$name.deb" >/dev/null
"$python" "$here/debian/sbom.py" "$work/tree/usr/lib/grabberd" "$work/unpacked/wheels" >"$output/$name.cdx.json"
(cd "$output" && sha256sum "$name.deb" "$name.cdx.json" >SHA256SUMS)
echo "$output/$name.deb ($(du -h "$output/$name.deb" | cut -f1)); there: sudo apt install ./$name.deb"
