"""Re-measures an archive of captures, on many processes, into a data set of points.

`reprocess_archive` decides what to do before any work is done, then hands a task for each capture to a pool;
its `workers`, here or on a Dask cluster, run `reprocess_capture`.
"""
