"""What outlives a capture: the index of captures, `state.sqlite`, stored calibrations and analyses, backups.

The index can be rebuilt from the capture files; all else here cannot.
"""
