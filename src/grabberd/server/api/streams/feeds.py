"""The feeds of one service that stream to clients."""

from functools import partial

from grabberd.instrument.live.curves import curves_message
from grabberd.instrument.live.newest_field import PreviewPicture
from grabberd.server.api.streams.broadcast import Broadcast
from grabberd.server.api.streams.events import EventFeed
from grabberd.server.api.streams.points_feed import PointsFeed
from grabberd.server.api.streams.preview_feed import PreviewFeed
from grabberd.server.daemon.service import Service

CURVES_EVERY_S = 0.2


class Feeds:
    """The feeds of a service.

    Attributes:
        events: Feed of the state and its changes.
        pictures: Newest field of each device as a picture.
    """

    def __init__(self, service: Service) -> None:
        self.events = EventFeed(service)
        self._service = service
        self._previews = {name: PreviewFeed(one, service.clock) for name, one in service.instruments.items()}
        self._points = {name: PointsFeed(one, service.clock) for name, one in service.instruments.items()}
        self._curves = {
            name: Broadcast(partial(curves_message, one, service.loggers, service.clock), CURVES_EVERY_S)
            for name, one in service.instruments.items()
        }
        self.pictures = {name: PreviewPicture(one) for name, one in service.instruments.items()}

    def preview(self, device: str | None) -> PreviewFeed:
        """The preview of a device, whose name can be left out if there is only one.

        Raises:
            NotFound: there is no device of that name, or the name is needed.
        """
        return self._previews[self._service.instrument(device).name]

    def points(self, device: str | None) -> PointsFeed:
        """The points of a device's fields; its name can be left out as above.

        Raises:
            NotFound: As above.
        """
        return self._points[self._service.instrument(device).name]

    def curves(self, device: str | None) -> Broadcast[str]:
        """The movement of a device and its vacuum; its name can be left out as above.

        Raises:
            NotFound: As above.
        """
        return self._curves[self._service.instrument(device).name]

    def close(self) -> None:
        """Ends every stream, because the server waits for responses to end before it stops."""
        self.events.broadcast.close()
        for preview in self._previews.values():
            preview.close()
        for points in self._points.values():
            points.close()
        for curves in self._curves.values():
            curves.close()
