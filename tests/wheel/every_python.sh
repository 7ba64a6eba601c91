#!/usr/bin/env bash
# Installs one wheel into an environment of every Python from 3.11 on that this machine has, and captures there.
# usage: every_python.sh WHEEL
set -euo pipefail
wheel=$(realpath "$1")
here=$(pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
unset PYTHONPATH

found() { # one of each version: of PATH, and of pyenv's
    for version in 3.11 3.12 3.13 3.14; do
        for python in "$(command -v "python$version" || true)" "${PYENV_ROOT:-$HOME/.pyenv}"/versions/"$version".*/bin/"python$version"; do
            [ -x "$python" ] && "$python" -c 'import venv, ensurepip' 2>/dev/null && echo "$version $python" && continue 2
        done
        echo "$version -"
    done
}

tried=0
while read -r version python; do
    if [ "$python" = - ]; then
        echo "pythons: $version is not on this machine"
        continue
    fi
    "$python" -m venv "$work/$version"
    "$work/$version/bin/python" -m pip install --quiet --no-compile --constraint "$here/constraints.txt" "$wheel"
    (cd "$work" && "$work/$version/bin/grabberd" capture --fields 16 --out "$version.grab" >/dev/null)
    "$work/$version/bin/grabberd" export "$work/$version.grab" --format csv --out "$work/$version-points" >/dev/null
    echo "pythons: $version: $("$work/$version/bin/grabberd" --version | head -1), $(($(wc -l <"$work/$version-points/points.csv") - 1)) points in 16 fields"
    tried=$((tried + 1))
done < <(found)
test $tried -gt 0
