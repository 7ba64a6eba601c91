"""Networks and orientations in the files of other programs, read from their text into a `Network` or `View`.

`photomodeler` reads exports that DBAT (Börlin and Grussenmeyer) works on, with its control points; `openptv`
reads orientations, targets and calibration points of OpenPTV.
"""
