"""The retained messages by which other programs discover the devices, and those that are to be removed."""

from collections.abc import Collection, Iterator, Sequence

from grabberd.archive.state.state_store import StateStore
from grabberd.server.mqtt.messages import Message

ANNOUNCED = "mqtt_announced_topics"
"""Key of the settings: topics on which the broker retains something only as long as it is wanted."""


class Announcements:
    """Compares what is to be announced with what was.

    A retained message stays with the broker when nobody publishes it any longer. So the topics are kept, and
    what is no longer wanted is removed by an empty message: the feature was turned off, or a device renamed.

    Args:
        store: Keeps the topics.
        wanted: What is to be announced; nothing where that is turned off.
        also: Topics that others publish on, for those alone who are told by the announcements.
    """

    def __init__(self, store: StateStore, wanted: Sequence[Message], also: Collection[str] = ()) -> None:
        self._store = store
        self._wanted = wanted
        self._topics = [*(message.topic for message in wanted), *also]

    @property
    def any(self) -> bool:
        """True if something is to be announced."""
        return bool(self._wanted)

    def due(self) -> Iterator[Message]:
        """Yields everything to be announced, then an empty message for each topic to be removed.

        Each is taken to have been published when the next one is asked for.

        Raises:
            StorageError: The state database cannot be used.
        """
        known: list[str] = self._store.get(ANNOUNCED) or []
        if new := [topic for topic in self._topics if topic not in known]:
            known += new  # kept before: what is published must be removable whatever happens next
            self._keep(known)
        yield from self._wanted
        # In their sequence: what names a topic is removed before that topic's own message.
        for topic in [topic for topic in known if topic not in self._topics]:
            yield Message(topic, None, retained=True)
            known.remove(topic)
            self._keep(known)

    def _keep(self, topics: Sequence[str]) -> None:
        if topics:
            self._store.put({ANNOUNCED: topics})
        else:
            self._store.remove(ANNOUNCED)
