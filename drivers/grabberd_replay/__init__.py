"""A recording played as a grabber: a capture file, a folder of PNG pictures, or a video file.

Pictures are woven frames, single fields, or fields whose lines were doubled. A folder that grabberd exported
says in its `fields.csv` what each picture is, and when it was; for others the options say it. What is
delivered are the recording's own times, parities and gaps.

What it does not do: it has no signal to lose and never says that there is none; a recording of 1 to 6 bits
comes as the grey values in the middle of its levels; a video's field order is not looked up in the file, and
a picture of it that decodes with errors comes as the decoder conceals it.
"""

from grabberd_replay.grabber import ReplayGrabber

__all__ = ["ReplayGrabber"]
