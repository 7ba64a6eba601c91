"""The installed drivers of grabbers and of data loggers, by name."""

from grabberd.core.channels.logger import Logger
from grabberd.instrument.acquisition.device import Grabber
from grabberd.registry import Registry

GRABBERS: Registry[Grabber] = Registry("grabberd.drivers")
LOGGERS: Registry[Logger] = Registry("grabberd.loggers")
