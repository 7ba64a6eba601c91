"""Coverage: how well a run was measured.

In how many fields each target should have been found, in how many it was, and why not in the others:
`tally` counts, `coverage` holds what was counted, `verdict` says what it is worth.
"""
