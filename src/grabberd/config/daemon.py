"""Configuration sections of the daemon: storage, HTTP, MQTT, and the whole file; default locations."""

import os
import sys
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Self

from pydantic import AfterValidator, Field, StringConstraints, model_validator

from grabberd.config.device import DeviceConfig
from grabberd.config.logger import LoggerConfig
from grabberd.config.section import ExistingFile, Section


def default_state_directory() -> Path:
    """The state directory given by systemd, else one in the user's home."""
    if systemd := os.environ.get("STATE_DIRECTORY"):
        return Path(systemd.split(":")[0])
    base = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(base) / "grabberd"


def shipped_configs() -> Path:
    """Folder of the configurations shipped with the program, in a checkout or as installed."""
    checkout = Path(__file__).resolve().parents[3] / "configs"
    return checkout if checkout.is_dir() else Path(sys.prefix) / "share" / "grabberd" / "configs"


def default_config_file() -> Path:
    """The configuration of the simulated grabber, used when none is given."""
    return shipped_configs() / "fake.yaml"


TopicPrefix = Annotated[
    str, StringConstraints(pattern=r"^[^/+#$\x00-\x1f]+(/[^/+#\x00-\x1f]+)*$", max_length=200)
]
ClientId = Annotated[str, StringConstraints(pattern=r"^[\x21-\x7e]{1,128}$")]

PORT, TLS_PORT = 1883, 8883


class MqttTlsConfig(Section):
    """TLS towards the broker; all files in PEM format."""

    ca: ExistingFile | None = Field(
        None, description="CA certificates to verify the broker with; default: the system's"
    )
    certificate: ExistingFile | None = Field(
        None, description="the daemon's client certificate, with its chain"
    )
    key: ExistingFile | None = Field(
        None, description="private key of the client certificate, without a passphrase"
    )

    @model_validator(mode="after")
    def _both_or_none(self) -> Self:
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate and key go together: give both or neither")
        return self


class MqttConfig(Section):
    """The MQTT broker that device states and captures are published to; requires `site.barn`."""

    host: str = Field(min_length=1, max_length=253, description="name or address of the broker")
    port: int | None = Field(
        None, ge=1, le=65535, description=f"port of the broker; default: {PORT}, with TLS {TLS_PORT}"
    )
    tls: MqttTlsConfig | None = Field(
        None, description="`{}` for a broker certified by one of the system's CAs"
    )
    user: str | None = Field(None, min_length=1, description="user name at the broker")
    password_file: ExistingFile | None = Field(
        None, description="file with the password on its only line; read at every connection"
    )
    topic_prefix: TopicPrefix = Field("grabberd", description="every topic starts with PREFIX/BARN")
    client_id: ClientId | None = Field(None, description="default: grabberd-BARN")
    keepalive_s: int = Field(
        30, ge=5, le=3600, description="the broker notices a lost connection after 1.5 times this"
    )
    every_s: float = Field(
        5.0, ge=1, le=3600, description="minimum interval between two state messages of a device"
    )
    queue_captures: int = Field(
        10_000,
        ge=1,
        le=1_000_000,
        description="capture summaries kept on disk while the broker is unreachable",
    )
    home_assistant: bool = Field(
        False, description="publish Home Assistant discovery messages; `false` removes them"
    )
    home_assistant_prefix: TopicPrefix = Field(
        "homeassistant", description="Home Assistant's prefix of discovery topics"
    )

    @model_validator(mode="after")
    def _password_has_a_user(self) -> Self:
        if self.password_file is not None and self.user is None:
            raise ValueError("password_file requires user")
        return self

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of the broker."""
        return self.host, self.port or (PORT if self.tls is None else TLS_PORT)


DeviceName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9_-]{0,31}$")]


class RetentionConfig(Section):
    """Automatic deletion of sealed captures, oldest first; without any key nothing is deleted.

    Running, armed, pinned and damaged captures are kept, and those that a job is using.
    """

    keep_days: float | None = Field(None, ge=1, le=36_500, description="delete captures older than this")
    min_free_gb: float | None = Field(
        None, gt=0, le=100_000, description="delete the oldest captures while less than this is free"
    )


class StorageConfig(Section):
    """Storage of captures: folder, queue, free space and retention."""

    directory: Path | None = Field(None, description="default: the service's state directory")
    # Ten seconds of doubled fields at 1 bit are 26 MB of memory.
    queue_s: float = Field(
        10.0, ge=1, le=600, description="length of the recorder's queue: how long the disk may stall"
    )
    reserve_gb: float = Field(
        0.2, ge=0.05, le=100_000, description="disk space kept free: no capture starts or continues below it"
    )
    retention: RetentionConfig = RetentionConfig()

    @model_validator(mode="after")
    def _retention_makes_room(self) -> Self:
        least = self.retention.min_free_gb
        if least is not None and least <= self.reserve_gb:
            raise ValueError(
                f"retention.min_free_gb {least:g} must be more than reserve_gb {self.reserve_gb:g}"
            )
        return self


HostName = Annotated[
    str, StringConstraints(pattern=r"^([A-Za-z0-9._-]{1,253}|[0-9A-Fa-f:.]+)$", to_lower=True)
]


def _check_proxy(name: str) -> str:
    if name != "unix":
        try:
            ip_network(name)
        except ValueError as error:
            raise ValueError(f"{name!r} is neither an address nor a network nor 'unix': {error}") from None
    return name


ProxyAddress = Annotated[str, AfterValidator(_check_proxy)]


class TlsConfig(Section):
    """The daemon's TLS certificate and private key."""

    certificate: ExistingFile = Field(description="PEM file with the certificate chain")
    key: ExistingFile = Field(description="PEM file without a passphrase, readable only by the daemon")


class HttpLimits(Section):
    """Limits on what clients may ask of the daemon."""

    body_bytes: int = Field(16_777_216, ge=1024, le=2**30, description="maximum size of a request body")
    head_timeout_s: float = Field(10.0, gt=0, le=600, description="maximum time to receive a request head")
    body_timeout_s: float = Field(30.0, gt=0, le=3600, description="maximum time to receive a request body")
    write_timeout_s: float = Field(
        30.0, gt=0, le=3600, description="time after which a client that reads nothing is disconnected"
    )
    connections: int = Field(256, ge=4, le=10_000, description="maximum number of connections of all clients")
    reads: int = Field(
        4, ge=1, le=64, description="maximum number of requests that read captures at the same time"
    )
    read_timeout_s: float = Field(
        30.0,
        gt=0,
        le=3600,
        description="maximum time to read captures for a request, or for a chunk of a download",
    )
    connections_per_client: int = Field(
        64, ge=1, le=10_000, description="maximum number of connections per client address"
    )
    streams_per_client: int = Field(
        8, ge=1, le=1000, description="maximum number of live streams per client address"
    )


class HttpConfig(Section):
    """Address the daemon listens on, and the host names clients reach it by."""

    host: str = Field("127.0.0.1", description="anything but loopback requires tokens")
    port: int = Field(8050, ge=0, le=65535, description="port to listen on; 0: any free one")
    hosts: tuple[HostName, ...] = Field(
        (), description="additional host names and addresses that clients use"
    )
    proxies: tuple[ProxyAddress, ...] = Field(
        (),
        description="addresses, networks or `unix` of proxies whose X-Forwarded-For and -Proto are trusted",
    )
    tls: TlsConfig | None = Field(None, description="default: plain HTTP")
    limits: HttpLimits = HttpLimits()

    @property
    def url(self) -> str:
        """Address at which programs on this computer find the daemon.

        With TLS it is the first name in `hosts`, if there is one: certificates are for names.
        """
        host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)  # noqa: S104 - never bound
        if self.tls is not None and self.hosts:
            host = self.hosts[0]
        written = f"[{host}]" if ":" in host else host
        return f"{'https' if self.tls else 'http'}://{written}:{self.port}"


class Config(Section):
    """The whole configuration file."""

    site: dict[str, str] = Field(
        default_factory=dict, description="name and data of the site, such as `barn`; stored in every capture"
    )
    devices: dict[DeviceName, DeviceConfig] = Field(min_length=1, description="the grabbers, by name")
    loggers: dict[DeviceName, LoggerConfig] = Field(
        default_factory=dict, description="data loggers beside the grabbers; default: none"
    )
    storage: StorageConfig = StorageConfig()
    http: HttpConfig = HttpConfig()
    mqtt: MqttConfig | None = Field(None, description="default: nothing is published")

    @property
    def state_directory(self) -> Path:
        """Folder of the captures, the index and the state database."""
        return self.storage.directory or default_state_directory()
