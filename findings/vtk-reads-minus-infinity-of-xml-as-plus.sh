#!/usr/bin/env bash
# VTK: a minus infinity in an ASCII XML file is read as plus infinity, the one VTK has just written
#
# Expected: -inf written into a .vtu or .vtp file as text comes back as -inf; or the reader refuses
#   it as a text that it cannot parse.
# What happens: it comes back as +inf, for 32 and 64 bits alike, without a warning. NaN, +inf and
#   all finite negative numbers come back as they were. The file itself is right ("-inf", and
#   RangeMin="-inf" above it): meshio reads it rightly. VTK's own binary and appended XML, and its
#   legacy .vtk files as text, keep the sign as well.
# Why it matters: the logarithm of a pressure of zero is -inf, and so is the level of a silent
#   channel. In the file one looks at with an editor the touched and the free part of a surface
#   differ; in ParaView and pyvista, which read by VTK, the free part has the greatest value of all,
#   and a threshold "above" selects it. Whoever checks an export by a binary file sees nothing.
# With: vtk 9.7.2, pyvista 0.49.1, meshio 5.3.5, numpy 2.4.6, all from PyPI.
# Output seen:
#   written                     [-inf -1.5  nan  inf]
#   the file says               -inf -1.5 nan inf
#   .vtu as text, by VTK        [ inf -1.5  nan  inf]
#   .vtu as text, by meshio     [-inf -1.5  nan  inf]
#   .vtu, binary, by VTK        [-inf -1.5  nan  inf]
#   .vtk as text, by VTK        [-inf -1.5  nan  inf]
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check vtk==9.7.2 pyvista==0.49.1 meshio==5.3.5 numpy==2.4.6

cat > "$work/show.py" <<'PY'
import warnings

import meshio
import numpy as np
import pyvista

warnings.filterwarnings("ignore")
cells = np.column_stack([np.full(4, 1), np.arange(4)]).ravel()
mesh = pyvista.UnstructuredGrid(cells, np.full(4, pyvista.CellType.VERTEX), np.eye(4, 3))
mesh.point_data["level"] = np.array([-np.inf, -1.5, np.nan, np.inf])
mesh.save("text.vtu", binary=False)
mesh.save("binary.vtu", binary=True)
mesh.save("text.vtk", binary=False)
lines = open("text.vtu").read().splitlines()
said = next(lines[at + 1] for at, line in enumerate(lines) if 'Name="level"' in line)


def report(what, values):
    print(f"{what:27} {values}")


report("written", mesh.point_data["level"])
report("the file says", said.strip())
report(".vtu as text, by VTK", pyvista.read("text.vtu").point_data["level"])
report(".vtu as text, by meshio", meshio.read("text.vtu").point_data["level"])
report(".vtu, binary, by VTK", pyvista.read("binary.vtu").point_data["level"])
report(".vtk as text, by VTK", pyvista.read("text.vtk").point_data["level"])
PY

cat > "$work/expected" <<'TXT'
written                     [-inf -1.5  nan  inf]
the file says               -inf -1.5 nan inf
.vtu as text, by VTK        [ inf -1.5  nan  inf]
.vtu as text, by meshio     [-inf -1.5  nan  inf]
.vtu, binary, by VTK        [-inf -1.5  nan  inf]
.vtk as text, by VTK        [-inf -1.5  nan  inf]
TXT

cd "$work"
venv/bin/python show.py 2>log | tee seen
if ! diff -u expected seen; then
    cat log >&2
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
