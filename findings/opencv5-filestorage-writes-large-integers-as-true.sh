#!/usr/bin/env bash
# OpenCV 5: FileStorage writes every integer from 2147483648 on as the word "true"
#
# Expected: storage.write("captured_at_ns", 1700000000000000000) puts that number into the YAML, JSON
#   or XML file, as OpenCV 4 does; or, at worst, is refused because it does not fit into an int.
# What happens: OpenCV 5.0 writes `true` (JSON, XML: 1) and reads it back as 1.0. No warning, no error.
#   720 and 2147483647 are written as numbers, and so is 3e9 as a float: only integers beyond
#   32 bits, of either sign, are hit.
# Why: the Python binding tries the C++ overloads of write() one after the other. Version 5 has a new
#   one for bool, and it stands second: int, bool, int64, double (see the order in cv2/__init__.pyi; in
#   version 4 it is int, int64, double). An integer that does not fit into 32 bits falls from int to
#   bool, which takes any integer and keeps only that it is not zero; int64 is never reached.
# Why it matters: camera calibrations live in these files, and what laboratories add to them is exactly
#   this kind of number: time stamps in nanoseconds or microseconds, serial numbers of cameras, frame
#   counters. Two calibrations of different days become equal. Write such numbers as text.
# With: opencv-python-headless 5.0.0.93 against 4.13.0.92. Not found in the documentation.
# Output seen:
#   4.13.0  720  2147483647  2147483648  1700000000000000000  3000000000
#   5.0.0   720  2147483647  true  true  3000000000
#   5.0.0   read back as 1.0
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cat > "$work/show.py" <<'PY'
import cv2

numbers = {"width": 720, "last": 2**31 - 1, "serial": 2**31, "captured_at_ns": 1_700_000_000_000_000_000, "rate": 3e9}
storage = cv2.FileStorage("calibration.yml", cv2.FILE_STORAGE_WRITE)
for name, number in numbers.items():
    storage.write(name, number)
storage.release()
with open("calibration.yml") as file:
    written = [line.split(": ")[1].strip() for line in file if ": " in line]
print(cv2.__version__.ljust(6), *written, sep="  ")
if cv2.__version__.startswith("5"):
    storage = cv2.FileStorage("calibration.yml", cv2.FILE_STORAGE_READ)
    print(cv2.__version__.ljust(6), f"read back as {storage.getNode('captured_at_ns').real()}", sep="  ")
PY

cat > "$work/expected" <<'TXT'
4.13.0  720  2147483647  2147483648  1700000000000000000  3000000000
5.0.0   720  2147483647  true  true  3000000000
5.0.0   read back as 1.0
TXT

cd "$work"
for version in 4.13.0.92 5.0.0.93; do
    python3 -m venv "venv-$version"
    "venv-$version/bin/pip" install --quiet --disable-pip-version-check \
        "opencv-python-headless==$version" numpy==2.4.6
    "venv-$version/bin/python" show.py
done | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
