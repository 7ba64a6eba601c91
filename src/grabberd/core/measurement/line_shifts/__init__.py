"""Line jitter: the shift of every line, solved for jointly from all blobs, and the error that remains.

`chords` cuts blobs into chords line by line, `line_shifts` solves for the shifts, `line_jitter` applies them
or, if the settings forbid it, says how large their effect is (docs/decisions/0006).
"""
