"""State that outlives captures: their index, `state.sqlite`, stored calibrations and analyses, backups.

The index can be rebuilt from the capture files; all else here cannot.
"""
