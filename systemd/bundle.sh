#!/usr/bin/env bash
# Packs a bundle: wheels of grabberd and all it needs, and the installer, for a computer without internet.
# It is for the same Python and processor as the Python that packs it.
# $WHEEL, if set, is grabberd's own wheel; otherwise it is built.
# usage: bundle.sh PYTHON OUTPUT_DIRECTORY [OPTIONS OF pip download]        --no-deps: grabberd's own wheel alone
set -euo pipefail
python=$1 output=$(mkdir -p "$2" && cd "$2" && pwd)
root=$(cd "$(dirname "$0")/.." && pwd)
work=$(mktemp -d)
shift 2
trap 'rm -rf "$work"' EXIT

wheel=${WHEEL:+$(realpath "$WHEEL")}
if [ -z "$wheel" ]; then
    "$python" -m build --wheel --outdir "$work/built" "$root" >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
    wheel=$(echo "$work"/built/grabberd-*.whl)
fi
version=$(basename "$wheel" | cut -d- -f2)
name=$("$python" -c "import sys, platform as p; print('grabberd-$version-python%d.%d-' % sys.version_info[:2] + p.machine())")
bundle=$work/$name
mkdir "$bundle"
"$python" -m pip download --quiet --only-binary=:all: --constraint "$root/constraints.txt" --dest "$bundle/wheels" "$@" "$wheel[report,mqtt]"

cp "$root"/systemd/{installer.sh,release.sh,release_checks.py} "$root/constraints.txt" "$root/docs/howto/install.md" "$bundle"
"$python" -c 'import sys, platform as p; print("Python %d.%d on" % sys.version_info[:2], p.machine())' >"$bundle/made-for"
tar --create --gzip --sort=name --owner=0 --group=0 --file "$output/$name.tar.gz" --directory "$work" "$name"
echo "$output/$name.tar.gz ($(du -h "$output/$name.tar.gz" | cut -f1)); there: tar xf it, cd $name, sudo sh installer.sh"
