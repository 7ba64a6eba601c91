"""State that outlives a capture: the capture index, `state.sqlite`, calibrations, analyses, backups.

The index can be rebuilt from the capture files; all else here cannot.
"""
