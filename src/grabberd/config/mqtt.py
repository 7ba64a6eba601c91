"""The section of the MQTT broker that the daemon tells of its devices and captures."""

from typing import Annotated, Self

from pydantic import Field, StringConstraints, model_validator

from grabberd.config.section import ExistingFile, Section

TopicPrefix = Annotated[
    str, StringConstraints(pattern=r"^[^/+#$\x00-\x1f]+(/[^/+#\x00-\x1f]+)*$", max_length=200)
]
ClientId = Annotated[str, StringConstraints(pattern=r"^[\x21-\x7e]{1,128}$")]

PORT, TLS_PORT = 1883, 8883


class MqttTlsConfig(Section):
    """How the broker is known, and the daemon to it; PEM files."""

    ca: ExistingFile | None = Field(None, description="who certifies the broker; default: the system's own")
    certificate: ExistingFile | None = Field(None, description="the daemon's own, with the chain")
    key: ExistingFile | None = Field(None, description="its private key, without a passphrase")

    @model_validator(mode="after")
    def _both_or_none(self) -> Self:
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate and key belong together: name both or none")
        return self


class MqttConfig(Section):
    """The broker that is told of devices and captures; nothing is taken from it. It needs `site.barn`."""

    host: str = Field(min_length=1, max_length=253)
    port: int | None = Field(None, ge=1, le=65535, description=f"default: {PORT}, with TLS {TLS_PORT}")
    tls: MqttTlsConfig | None = Field(None, description="`{}` for a broker that the system's own CAs certify")
    user: str | None = Field(None, min_length=1)
    password_file: ExistingFile | None = Field(
        None, description="its one line is the password; read at every connection"
    )
    topic_prefix: TopicPrefix = Field("grabberd", description="every topic begins with PREFIX/BARN")
    client_id: ClientId | None = Field(None, description="default: grabberd- and the barn")
    keepalive_s: int = Field(30, ge=5, le=3600, description="a broker notices our end after 1.5 of these")
    every_s: float = Field(5.0, ge=1, le=3600, description="a device's state goes out no more often")
    queue_captures: int = Field(
        10_000, ge=1, le=1_000_000, description="summaries kept on disk while the broker is away"
    )

    @model_validator(mode="after")
    def _password_has_a_user(self) -> Self:
        if self.password_file is not None and self.user is None:
            raise ValueError("password_file without user")
        return self

    @property
    def address(self) -> tuple[str, int]:
        """Host and port."""
        return self.host, self.port or (PORT if self.tls is None else TLS_PORT)
