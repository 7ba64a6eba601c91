"""Publishing to an MQTT broker as an extension: a part of the daemon, and a check of its configuration."""

from grabberd.extension import Extension

EXTENSION = Extension(
    name="mqtt", part="grabberd_mqtt.part:MqttPart", config_check="grabberd_mqtt.part:check_mqtt"
)
