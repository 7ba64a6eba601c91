#!/usr/bin/env bash
# Polars, DuckDB: the median of a column with NaN is a plausible number that is too high
#
# Expected: the median of 66 residuals and 34 NaN is NaN (as in NumPy) or that of the 66 numbers,
#   49.5 (as in pandas and pyarrow). Since max() in Polars leaves NaN out, the median should do so
#   too.
# What happens: Polars gives 75.0, DuckDB as well: every NaN counts as a value greater than all
#   others, and the median moves to about the 76th percentile of what was measured. Polars'
#   quantile(0.5) is 76, its mean NaN, its max 98, its rolling_max NaN again where rolling_median is
#   a number. In DuckDB max is NaN, but approx_quantile(x, 0.5) is 49.5. describe() shows it all in
#   one table: mean NaN, 50 % 76, max 98.
# Why: both define a total order of floating point numbers with NaN last, and take the median by
#   sorting. For max, Polars has a rule of its own (NaN is ignored; nan_max() is the other one).
#   pyarrow skips NaN in quantiles like null.
# Why it matters: the median is what one takes because it withstands outliers: thresholds from the
#   median absolute deviation, the resting position of a target, a typical residual. Where a third
#   of the fields is missing, the result is wrong by a quarter of the range and nothing looks odd.
#   Turn NaN into null on reading (fill_nan(None)).
# With: polars 2.1.0, duckdb 2.0.1, pyarrow 26.0.1, pandas 3.1.1, numpy 2.4.6. Documented is the
#   order of NaN in sorting and comparison, not what follows for a median.
# Output seen:
#   numpy    median nan  nanmedian 49.5
#   pandas   median 49.5
#   pyarrow  quantile(0.5) 49.5
#   polars   median 75.0  quantile(0.5) 76.0  mean nan  max 98.0
#   polars   median after fill_nan(None) 49.5
#   duckdb   median 75.0  approx_quantile(0.5) 49.5  max nan
#   polars   of [1, NaN, 3]: rolling_median 3.0  rolling_max nan  max 3.0
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    polars==2.1.0 duckdb==2.0.1 pyarrow==26.0.1 pandas==3.1.1 numpy==2.4.6

cat > "$work/show.py" <<'PY'
import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.compute as pc

x = np.arange(100.0)
x[::3] = np.nan  # 34 of 100 are missing
series = pl.Series("x", x)
data = pa.table({"x": x})
db = duckdb.sql("select median(x), approx_quantile(x, 0.5), max(x) from data").fetchall()[0]

print("numpy    median", np.median(x), " nanmedian", np.nanmedian(x))
print("pandas   median", pd.Series(x).median())
print("pyarrow  quantile(0.5)", pc.quantile(data["x"], 0.5)[0].as_py())
print("polars   median", series.median(), " quantile(0.5)", series.quantile(0.5), " mean", series.mean(), " max", series.max())
print("polars   median after fill_nan(None)", series.fill_nan(None).median())
print("duckdb   median", db[0], " approx_quantile(0.5)", db[1], " max", db[2])
window = pl.Series([1.0, float("nan"), 3.0])
print("polars   of [1, NaN, 3]: rolling_median", window.rolling_median(3)[2], " rolling_max", window.rolling_max(3)[2], " max", window.max())
PY

cat > "$work/expected" <<'TXT'
numpy    median nan  nanmedian 49.5
pandas   median 49.5
pyarrow  quantile(0.5) 49.5
polars   median 75.0  quantile(0.5) 76.0  mean nan  max 98.0
polars   median after fill_nan(None) 49.5
duckdb   median 75.0  approx_quantile(0.5) 49.5  max nan
polars   of [1, NaN, 3]: rolling_median 3.0  rolling_max nan  max 3.0
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
