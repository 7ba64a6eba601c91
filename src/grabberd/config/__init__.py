"""The configuration file, validated as a whole before anything starts.

All problems are reported at once, each with its file and key. Relative paths start at the file's own folder.
"""

from grabberd.config.daemon import (
    Config,
    HttpConfig,
    HttpLimits,
    MqttConfig,
    MqttTlsConfig,
    RetentionConfig,
    StorageConfig,
    TlsConfig,
    default_config_file,
    default_state_directory,
    shipped_configs,
)
from grabberd.config.device import (
    AnalysisConfig,
    BitDepth,
    CaptureConfig,
    DeviceConfig,
    GlassConfig,
    Lines,
    LocationConfig,
    OnInterruption,
    RigConfig,
    RingConfig,
    TargetsConfig,
    ThresholdConfig,
)
from grabberd.config.logger import ChannelConfig, LoggerConfig
from grabberd.config.reading import load_config, load_sound_part, only_device

__all__ = [
    "AnalysisConfig",
    "BitDepth",
    "CaptureConfig",
    "ChannelConfig",
    "Config",
    "DeviceConfig",
    "GlassConfig",
    "HttpConfig",
    "HttpLimits",
    "Lines",
    "LocationConfig",
    "LoggerConfig",
    "MqttConfig",
    "MqttTlsConfig",
    "OnInterruption",
    "RetentionConfig",
    "RigConfig",
    "RingConfig",
    "StorageConfig",
    "TargetsConfig",
    "ThresholdConfig",
    "TlsConfig",
    "default_config_file",
    "default_state_directory",
    "load_config",
    "load_sound_part",
    "only_device",
    "shipped_configs",
]
