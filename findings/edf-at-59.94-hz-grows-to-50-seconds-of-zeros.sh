#!/usr/bin/env bash
# pyEDFlib: ten seconds at 59.94 Hz become fifty, the rest filled with 0 kPa
#
# Expected: 599 samples at 59.94 Hz (a field rate) make an EDF file of ten seconds; the format's
#   whole data records cost at most one more second at the end, as they do at 50 Hz.
# What happens: the file holds 2997 samples and 50 s. The 2398 that were never measured are zeros in
#   physical units. At 12.5 Hz the file is 12 s long, at 999.9 Hz 10 s long, at 50 Hz 11 s (for
#   10.02 s).
# Why: an EDF data record must hold a whole number of samples. The writer looks for a record length
#   that makes this so and fits into eight characters (_calculate_record_duration in edfwriter.py);
#   for 59.94 = 2997/50 only 50 s will do. writeSamples() fills the last record with np.zeros. The
#   rate in the header is exact, which is why the check that everybody makes is passed.
# Why it matters: 0 kPa is a reading: atmospheric pressure, the pump off. Mean, minimum and
#   pulsation ratio are wrong, and the duration suggests that all was recorded. Keep the number of
#   samples beside the file.
# With: pyEDFlib 0.1.42, numpy 2.4.6. The padding is not in the documentation of writeSamples.
# Output seen:
#   rate Hz   written   in the file   duration s   zeros at the end   mean kPa
#     50.00       501           550         11.0                 49       38.3
#     12.50       126           150         12.0                 24       35.3
#    999.90      9999          9999         10.0                  0       42.0
#     59.94       599          2997         50.0               2398        8.4
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    pyEDFlib==0.1.42 numpy==2.4.6

cat > "$work/show.py" <<'PY'
import numpy as np
import pyedflib

print("rate Hz   written   in the file   duration s   zeros at the end   mean kPa")
for rate, n in ((50.0, 501), (12.5, 126), (999.9, 9999), (59.94, 599)):
    vacuum = np.full(n, 42.0)
    writer = pyedflib.EdfWriter("vacuum.edf", 1, file_type=pyedflib.FILETYPE_EDFPLUS)
    writer.setSignalHeader(
        0,
        {
            "label": "vacuum",
            "dimension": "kPa",
            "sample_frequency": rate,
            "physical_min": -100.0,
            "physical_max": 100.0,
            "digital_min": -32768,
            "digital_max": 32767,
            "transducer": "",
            "prefilter": "",
        },
    )
    writer.writeSamples([vacuum])
    writer.close()
    with pyedflib.EdfReader("vacuum.edf") as reader:
        read = reader.readSignal(0)
        zeros = int(np.count_nonzero(np.abs(read) < 0.01))
        print(
            f"{reader.getSampleFrequency(0):7.2f}{n:10}{len(read):14}{reader.getFileDuration():13.1f}"
            f"{zeros:19}{read.mean():11.1f}"
        )
PY

cat > "$work/expected" <<'TXT'
rate Hz   written   in the file   duration s   zeros at the end   mean kPa
  50.00       501           550         11.0                 49       38.3
  12.50       126           150         12.0                 24       35.3
 999.90      9999          9999         10.0                  0       42.0
  59.94       599          2997         50.0               2398        8.4
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
