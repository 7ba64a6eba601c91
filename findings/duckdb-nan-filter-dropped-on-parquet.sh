#!/usr/bin/env bash
# DuckDB: on a Parquet file from another writer, "WHERE NOT isnan(x)" removes nothing
#
# Expected: a filter is a property of the data. The same 1000 residuals, ten of them NaN (targets
#   that were not found), give the same counts however the Parquet file is cut into row groups, and
#   avg(x) with "WHERE NOT isnan(x)" is the mean of the 990 numbers.
# What happens: isnan(x) finds no row at all, NOT isnan(x) keeps all 1000, so that the guarded mean is
#   still NaN. x > 0.5 gives 505 rows from a file of one row group (DuckDB sorts NaN above every
#   number) and 500 from the same data in ten row groups; x <= 0.5 gives 495 and 500. Written without
#   statistics, or loaded into a table first, the same data gives the right answers.
# Why: pyarrow and Polars leave NaN out of the minimum and maximum of a row group, as the Parquet
#   format asks. DuckDB takes the two for bounds of every value: it proves "cannot be NaN", folds
#   isnan() to false, and answers a comparison for a whole row group from the bounds. The result hangs
#   on row_group_size, which nobody thinks of as part of the data. DuckDB writes no bounds for a
#   column with NaN itself, so a test that makes its file with DuckDB does not show it.
# Why it matters: an analysis of measured points filters its gaps out first. Here the filter is
#   accepted, does nothing, and the counts of outliers depend on how long the recorder buffered.
#   Write missing values as null, never as NaN, into Parquet that others will query.
# With: duckdb 2.0.1, pyarrow 26.0.1. Known as duckdb/duckdb issue 25521 (pull request 16962 of 2025
#   had made the bounds safe for NaN). "PRAGMA disable_optimizer" is the way round it.
# Output seen:
#   predicate      one group  ten groups  no statistics  table
#   x > 0.5              505         500            505    505
#   x <= 0.5             495         500            495    495
#   isnan(x)               0           0             10     10
#   not isnan(x)        1000        1000            990    990
#   avg(x) where not isnan(x): one group nan, table 0.500501
#   optimizer off, isnan(x): 10
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    duckdb==2.0.1 pyarrow==26.0.1 numpy==2.4.6

cat > "$work/show.py" <<'PY'
import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

x = np.linspace(0, 1, 1000)
x[::100] = np.nan
table = pa.table({"x": x})
pq.write_table(table, "one.parquet")
pq.write_table(table, "ten.parquet", row_group_size=100)
pq.write_table(table, "bare.parquet", row_group_size=100, write_statistics=False)

db = duckdb.connect()
db.execute("create table t as from 'ten.parquet'")
sources = ("'one.parquet'", "'ten.parquet'", "'bare.parquet'", "t")


def count(connection, source, predicate):
    return connection.execute(f"select count(*) from {source} where {predicate}").fetchall()[0][0]


print(f"{'predicate':13}{'one group':>11}{'ten groups':>12}{'no statistics':>15}{'table':>7}")
for predicate in ("x > 0.5", "x <= 0.5", "isnan(x)", "not isnan(x)"):
    a, b, c, d = (count(db, source, predicate) for source in sources)
    print(f"{predicate:13}{a:11}{b:12}{c:15}{d:7}")
mean = [db.execute(f"select avg(x) from {s} where not isnan(x)").fetchall()[0][0] for s in ("'one.parquet'", "t")]
print(f"avg(x) where not isnan(x): one group {mean[0]:.6f}, table {mean[1]:.6f}")
plain = duckdb.connect()
plain.execute("pragma disable_optimizer")
print("optimizer off, isnan(x):", count(plain, "'one.parquet'", "isnan(x)"))
PY

cat > "$work/expected" <<'TXT'
predicate      one group  ten groups  no statistics  table
x > 0.5              505         500            505    505
x <= 0.5             495         500            495    495
isnan(x)               0           0             10     10
not isnan(x)        1000        1000            990    990
avg(x) where not isnan(x): one group nan, table 0.500501
optimizer off, isnan(x): 10
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
