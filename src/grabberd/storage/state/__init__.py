"""What outlives a capture: the index, `state.sqlite`, stored calibrations and analyses, and their backup."""
