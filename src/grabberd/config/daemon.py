"""The sections of the daemon: storage, HTTP, and all grabbers together."""

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, StringConstraints, model_validator

from grabberd.config.device import DeviceConfig
from grabberd.config.mqtt import MqttConfig
from grabberd.config.paths import default_state_directory
from grabberd.config.section import ExistingFile, Section

DeviceName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9_-]{0,31}$")]


class RetentionConfig(Section):
    """Which sealed captures are removed by themselves, the oldest first; without a key, none.

    Running, armed, pinned and damaged ones stay, and those that a job works on.
    """

    keep_days: float | None = Field(None, ge=1, le=36_500, description="older captures are removed")
    min_free_gb: float | None = Field(
        None, gt=0, le=100_000, description="while less is free, the oldest are removed"
    )


class StorageConfig(Section):
    """Where captures are kept, and for how long."""

    directory: Path | None = Field(None, description="default: the service's state directory")
    queue_s: float = Field(10.0, ge=1, le=600)
    reserve_gb: float = Field(
        0.2, ge=0.05, le=100_000, description="stays free: no capture begins or goes on beyond it"
    )
    retention: RetentionConfig = RetentionConfig()

    @model_validator(mode="after")
    def _retention_makes_room(self) -> Self:
        least = self.retention.min_free_gb
        if least is not None and least <= self.reserve_gb:
            raise ValueError(
                f"retention.min_free_gb {least:g} has to be more than reserve_gb {self.reserve_gb:g}"
            )
        return self


HostName = Annotated[
    str, StringConstraints(pattern=r"^([A-Za-z0-9._-]{1,253}|[0-9A-Fa-f:.]+)$", to_lower=True)
]


class TlsConfig(Section):
    """The certificate that the daemon shows, and its private key."""

    certificate: ExistingFile = Field(description="a PEM file, with the chain")
    key: ExistingFile = Field(description="a PEM file without a passphrase, readable for the daemon alone")


class HttpLimits(Section):
    """What one client can ask of the daemon."""

    body_bytes: int = Field(16_777_216, ge=1024, le=2**30, description="of a request")
    head_timeout_s: float = Field(10.0, gt=0, le=600, description="until a request's head has come")
    body_timeout_s: float = Field(30.0, gt=0, le=3600, description="until its body has come")
    write_timeout_s: float = Field(30.0, gt=0, le=3600, description="how long a client may read nothing")
    connections: int = Field(256, ge=4, le=10_000, description="of all clients together")
    streams_per_client: int = Field(8, ge=1, le=1000, description="live streams to one address")


class HttpConfig(Section):
    """Where the daemon listens, and by which names it is called."""

    host: str = Field("127.0.0.1", description="other than loopback only with tokens")
    port: int = Field(8050, ge=0, le=65535)
    hosts: tuple[HostName, ...] = Field((), description="further names and addresses that clients call it by")
    tls: TlsConfig | None = Field(None, description="without it, plain HTTP")
    limits: HttpLimits = HttpLimits()


class Config(Section):
    """The whole configuration."""

    site: dict[str, str] = Field(default_factory=dict)
    devices: dict[DeviceName, DeviceConfig] = Field(min_length=1)
    storage: StorageConfig = StorageConfig()
    http: HttpConfig = HttpConfig()
    mqtt: MqttConfig | None = Field(None, description="without it, nothing is published")

    @property
    def state_directory(self) -> Path:
        """The folder of captures, index and state."""
        return self.storage.directory or default_state_directory()
