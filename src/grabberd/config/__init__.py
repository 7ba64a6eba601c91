"""The configuration file, validated as a whole before anything starts.

All problems are reported at once, each with its file and key. Relative paths start at the file's own folder.
"""

from grabberd.config.daemon import Config as Config
from grabberd.config.daemon import HttpConfig as HttpConfig
from grabberd.config.daemon import HttpLimits as HttpLimits
from grabberd.config.daemon import MqttConfig as MqttConfig
from grabberd.config.daemon import MqttTlsConfig as MqttTlsConfig
from grabberd.config.daemon import RetentionConfig as RetentionConfig
from grabberd.config.daemon import StorageConfig as StorageConfig
from grabberd.config.daemon import TlsConfig as TlsConfig
from grabberd.config.daemon import default_config_file as default_config_file
from grabberd.config.daemon import default_state_directory as default_state_directory
from grabberd.config.daemon import shipped_configs as shipped_configs
from grabberd.config.device import AnalysisConfig as AnalysisConfig
from grabberd.config.device import BitDepth as BitDepth
from grabberd.config.device import CaptureConfig as CaptureConfig
from grabberd.config.device import DeviceConfig as DeviceConfig
from grabberd.config.device import GlassConfig as GlassConfig
from grabberd.config.device import Lines as Lines
from grabberd.config.device import LocationConfig as LocationConfig
from grabberd.config.device import OnInterruption as OnInterruption
from grabberd.config.device import RigConfig as RigConfig
from grabberd.config.device import RingConfig as RingConfig
from grabberd.config.device import TargetsConfig as TargetsConfig
from grabberd.config.device import ThresholdConfig as ThresholdConfig
from grabberd.config.logger import ChannelConfig as ChannelConfig
from grabberd.config.logger import LoggerConfig as LoggerConfig
from grabberd.config.reading import load_config as load_config
from grabberd.config.reading import load_sound_part as load_sound_part
from grabberd.config.reading import only_device as only_device
