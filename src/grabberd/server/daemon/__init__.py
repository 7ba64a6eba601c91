"""The daemon's parts put together, and what it does for itself: heartbeat, journal, upkeep, diagnostics.

The `Service` holds all instruments, the loggers, the archive of captures, the queue of jobs and the process
that runs them. Nothing here is module state, so a process may hold as many as it likes.
"""
