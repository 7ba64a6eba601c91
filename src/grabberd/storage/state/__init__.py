"""State that outlives a capture: the capture index, `state.sqlite`, stored calibrations and analyses, backups.

The index can be rebuilt from the capture files; all else here cannot.
"""
