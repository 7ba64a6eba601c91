#!/usr/bin/env bash
# FilterPy: a missed measurement counts as a perfect one in the log-likelihood
#
# Expected: update(None) says that nothing was measured, so this step adds nothing to the likelihood
#   of the track: log_likelihood afterwards is 0, or NaN, or is left out.
# What happens: it is the largest value there can be, that of a measurement exactly on the
#   prediction, and with the innovation covariance S of the last real measurement, not of now. A
#   track of 200 fields that does not fit its motion model scores -546; with all but its first three
#   fields lost, +508.
# Why: update(None) sets y to zeros and returns before S is computed; log_likelihood is lazy and
#   evaluates the normal density at y = 0 with whatever S is there (kalman_filter.py). The docstring
#   says that for None "nothing is computed". log_likelihood_of(None), by contrast, is
#   log(sys.float_info.min).
# Why it matters: summed log_likelihood is the usual score to choose between motion models, noise
#   levels and hypotheses of a multi-target tracker. Targets of a moving wall vanish for many fields
#   of each cycle; the hypothesis that lost the target wins. Skip update() (and the sum) for missed
#   fields.
# With: filterpy 2.0.0, numpy 2.4.6, scipy 1.17.1. Also in filterpy 1.4.5.
# Output seen:
#   measured in every field       score      -546
#   measured in every second      score      -630
#   measured in first three only  score       508
#   a step of the last kind: 2.59 - a real measurement before it: 2.59
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    filterpy==2.0.0 numpy==2.4.6 scipy==1.17.1

cat > "$work/show.py" <<'PY'
import numpy as np
from filterpy.kalman import KalmanFilter


def score(measurements):
    """Sum of the log-likelihoods of a track under a model of constant speed."""
    track = KalmanFilter(dim_x=2, dim_z=1)
    track.F = np.array([[1.0, 1.0], [0.0, 1.0]])
    track.H = np.array([[1.0, 0.0]])
    track.P *= 10.0
    track.R *= 0.01**2
    track.Q = np.eye(2) * 0.01**2
    steps = []
    for z in measurements:
        track.predict()
        track.update(z)
        steps.append(float(track.log_likelihood))
    return np.array(steps)


field = np.arange(200)
wall = 3 * np.sin(2 * np.pi * field / 50)  # mm; a wall that does not move at constant speed
all_seen = list(wall)
half_lost = [z if i < 20 or i % 2 else None for i, z in enumerate(wall)]
lost_early = [z if i < 3 else None for i, z in enumerate(wall)]
for name, measurements in (("every field", all_seen), ("every second", half_lost), ("first three only", lost_early)):
    print(f"measured in {name:17} score {score(measurements).sum():9.0f}")
steps = score([0.0, 0.0, 0.0, None])
print("a step of the last kind:", steps[3].round(2), "- a real measurement before it:", steps[2].round(2))
PY

cat > "$work/expected" <<'TXT'
measured in every field       score      -546
measured in every second      score      -630
measured in first three only  score       508
a step of the last kind: 2.59 - a real measurement before it: 2.59
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
