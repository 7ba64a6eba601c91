"""State that outlives captures: their index, `state.sqlite`, stored calibrations, the job queue, backups.

The index can be rebuilt from the capture files; everything else here cannot.
"""
