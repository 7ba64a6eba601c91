"""Configuration section of the MQTT publisher."""

from typing import Annotated, Self

from pydantic import Field, StringConstraints, model_validator

from grabberd.config.section import ExistingFile, Section

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
