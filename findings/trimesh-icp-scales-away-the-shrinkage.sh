#!/usr/bin/env bash
# trimesh: ICP fits shape and mirror image alike, and scales away the shrinkage one wants to measure
#
# Expected: icp() finds the rigid motion (rotation and translation) that lays measured points onto a
#   model. A part that is 3 % smaller than the model leaves residuals, here of 0.8 mm, from which
#   one reads its strain.
# What happens: the transformation has a scale of 1.031 and the cost is zero: the part has exactly
#   its nominal size. A mirrored set of points, as a mix-up of left and right views makes it, fits
#   as well, by a matrix of determinant -1. Neither is announced; one has to take the determinant of
#   the result.
# Why: icp(a, b, ...) hands its further arguments to procrustes(), whose defaults are scale=True and
#   reflection=True. mesh_other() of the same module has scale=False, but reflection=True.
# Why it matters: registration comes before every comparison of shapes. An isotropic strain
#   disappears in it entirely, an anisotropic one by its mean; a handedness error, which residuals
#   should reveal, is absorbed. Pass scale=False, reflection=False.
# With: trimesh 5.2.0, numpy 2.4.6, scipy 1.17.1. The docstring of icp says "args to pass to
#   procrustes".
# Output seen:
#   icp                                        determinant  1.096   scale 1.031   rms 0.000 mm
#   icp {'scale': False, 'reflection': False}  determinant  1.000   scale 1.000   rms 0.765 mm
#   procrustes, mirrored {}                    determinant -1.096   scale 1.031   rms 0.000 mm
#   procrustes, mirrored {both False}          determinant  1.000   scale 1.000   rms 4.772 mm
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    trimesh==5.2.0 numpy==2.4.6 scipy==1.17.1

cat > "$work/show.py" <<'PY'
import numpy as np
from scipy.spatial.transform import Rotation
from trimesh.registration import icp, procrustes

# A grid of targets on a part of a cylinder (mm) and the same, 3 % smaller, in another place.
angle, height = np.meshgrid(np.linspace(0, 2.2, 9), np.arange(0, 80, 6.5))
model = np.c_[12 * np.cos(angle).ravel(), 12 * np.sin(angle).ravel(), height.ravel()]
turn = Rotation.from_euler("xyz", [0.3, 0.5, -0.4], degrees=True).as_matrix()
measured = 0.97 * model @ turn.T + [0.2, -0.3, 1.2]


def report(name, matrix, fitted):
    determinant = np.linalg.det(matrix[:3, :3])
    rms = np.sqrt(np.mean(np.sum((fitted - model) ** 2, axis=1)))
    print(f"{name:42} determinant {determinant:6.3f}   scale {abs(determinant) ** (1 / 3):.3f}   rms {rms:.3f} mm")


for options in ({}, {"scale": False, "reflection": False}):
    matrix, fitted, _ = icp(measured, model, max_iterations=200, **options)
    report(f"icp {options or ''}".strip(), matrix, fitted)
mirrored = measured * [1, 1, -1]
for options in ({}, {"scale": False, "reflection": False}):
    matrix, fitted, _ = procrustes(mirrored, model, **options)
    report("procrustes, mirrored " + ("{}" if not options else "{both False}"), matrix, fitted)
PY

cat > "$work/expected" <<'TXT'
icp                                        determinant  1.096   scale 1.031   rms 0.000 mm
icp {'scale': False, 'reflection': False}  determinant  1.000   scale 1.000   rms 0.765 mm
procrustes, mirrored {}                    determinant -1.096   scale 1.031   rms 0.000 mm
procrustes, mirrored {both False}          determinant  1.000   scale 1.000   rms 4.772 mm
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
