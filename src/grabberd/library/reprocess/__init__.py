"""Re-measures an archive of captures, on many processes, into a data set of points.

`capture_selection` decides what to do before any work is done, `reprocess_archive` hands a task for each
capture to a `task_pool`, and its `workers`, here or on a Dask cluster, run `reprocess_capture`.
"""
