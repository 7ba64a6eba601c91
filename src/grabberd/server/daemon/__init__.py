"""The daemon assembled from its parts, and its own affairs: heartbeat, journal, upkeep, diagnostics.

The `Service` holds all instruments, the loggers, the archive of captures, the job queue and the process that
runs the jobs. Nothing here is module state, so a process may hold several services.
"""
