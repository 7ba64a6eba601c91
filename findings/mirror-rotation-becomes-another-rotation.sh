#!/usr/bin/env bash
# OpenCV and pycolmap: the pose of a camera behind a mirror silently becomes another rotation
#
# Expected: handed a reflection (an orthogonal matrix of determinant -1), what turns a matrix into a
#   rotation vector or a quaternion refuses it, as SciPy does, or returns the nearest true rotation.
# What happens: cv2.Rodrigues() returns a rotation vector whose matrix differs from the given one by
#   up to 1.7 in an element; it is not near anything. pycolmap.Rotation3d() takes the matrix as
#   well, and holds a "quaternion" of length 0.71 whose matrix is neither the reflection nor a
#   rotation. Both are silent. Stranger still, cv2.projectPoints() is right when it is given the 3 x
#   3 reflection itself in place of the rotation vector, and 115 pixels off through Rodrigues(): the
#   documented round trip between the two forms is what breaks it.
# Why: Rodrigues() orthogonalises by U * Vt without looking at the determinant, then takes axis and
#   angle from the antisymmetric part and the trace, which mean something for rotations only.
#   projectPoints() converts a 3 x 3 argument too, but then puts the original matrix back
#   (modules/calib3d/src/calibration.cpp). pycolmap passes the matrix to Eigen's quaternion
#   constructor, which presumes a rotation.
# Why it matters: a view through a mirror has a pose of determinant -1; so has a calibration whose
#   image axis points the other way. Its export into another tool's rotation vector or quaternion
#   succeeds and is wrong. Fold the mirror into the image (flip x, cx -> w - 1 - cx) before
#   converting.
# With: opencv-python-headless 5.0.0.93 (4.13.0.92 alike), pycolmap 4.2.1, scipy 1.17.1. Not
#   found in the documentation.
# Output seen:
#   given: determinant -1.00
#   OpenCV: vector [ 1.499 -0.377  0.298], determinant of its matrix 1.00, largest difference 1.72
#   pycolmap: length of the quaternion 0.708, determinant of its matrix 0.994, largest difference 1.81
#   SciPy: Non-positive determinant
#   projectPoints with the 3 x 3 matrix: up to 0.0 px off
#   projectPoints with Rodrigues() of it: up to 114.9 px off
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    opencv-python-headless==5.0.0.93 pycolmap==4.2.1 scipy==1.17.1 numpy==2.4.6

cat > "$work/show.py" <<'PY'
import cv2
import numpy as np
import pycolmap
from scipy.spatial.transform import Rotation

rotation = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix()
reflection = np.diag([-1.0, 1.0, 1.0]) @ rotation
print(f"given: determinant {np.linalg.det(reflection):.2f}")

vector, _ = cv2.Rodrigues(reflection)
back, _ = cv2.Rodrigues(vector)
print(f"OpenCV: vector {vector.ravel().round(3)}, determinant of its matrix {np.linalg.det(back):.2f}, "
      f"largest difference {np.abs(back - reflection).max():.2f}")

quaternion = pycolmap.Rotation3d(reflection)
matrix = quaternion.matrix()
print(f"pycolmap: length of the quaternion {np.linalg.norm(quaternion.quat):.3f}, "
      f"determinant of its matrix {np.linalg.det(matrix):.3f}, largest difference {np.abs(matrix - reflection).max():.2f}")

try:
    Rotation.from_matrix(reflection)
    print("SciPy: accepted")
except ValueError as error:
    print("SciPy:", str(error).split(" (")[0])

camera = np.array([[800.0, 0, 360], [0, 800, 288], [0, 0, 1]])
points = np.array([[10.0, 20, 0], [-15, 5, 3], [7, -9, 1]])
translation = np.array([0.0, 0, 200])
seen = points @ reflection.T + translation
truth = seen[:, :2] / seen[:, 2:] * 800 + [360, 288]
for name, pose in (("the 3 x 3 matrix", reflection), ("Rodrigues() of it", vector)):
    pixels = cv2.projectPoints(points, pose, translation, camera, None)[0].reshape(-1, 2)
    print(f"projectPoints with {name}: up to {np.abs(pixels - truth).max():.1f} px off")
PY

cat > "$work/expected" <<'TXT'
given: determinant -1.00
OpenCV: vector [ 1.499 -0.377  0.298], determinant of its matrix 1.00, largest difference 1.72
pycolmap: length of the quaternion 0.708, determinant of its matrix 0.994, largest difference 1.81
SciPy: Non-positive determinant
projectPoints with the 3 x 3 matrix: up to 0.0 px off
projectPoints with Rodrigues() of it: up to 114.9 px off
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
