"""A recording played as a grabber: a capture file, a folder of PNG pictures, or a video file.

Pictures are woven frames, single fields, or fields whose lines were doubled. For a folder that grabberd
exported, `fields.csv` gives kind and time of each picture; for other folders the options do. Times, parities
and gaps are those of the recording.

Limits: a recording has no signal to lose and never reports a lost one; a recording of 1 to 6 bits is played
as the grey values in the middle of its levels; without the program `ffmpeg`, a video's field order is not
read from the file, and a picture that decodes with errors is played as the decoder conceals them.
"""

from grabberd_replay.grabber import ReplayGrabber

__all__ = ["ReplayGrabber"]
