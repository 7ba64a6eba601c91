"""A recording played to its end."""

from grabberd.errors import PictureError, StreamEnded
from grabberd_replay import ReplayGrabber

PERIOD_NS = 20_000_000


def play(path, **options):
    """Stream info, every field (copied), and the error that ended it."""
    grabber = ReplayGrabber(path, **options)
    info, played = grabber.open(), []
    while True:
        try:
            with grabber.dequeue(1.0) as fields:
                played.extend(fields)
        except (StreamEnded, PictureError) as error:
            grabber.close()
            return info, played, error


def rows(played):
    return [(f.field.parity, f.field.y0, f.field.y_step) for f in played]
