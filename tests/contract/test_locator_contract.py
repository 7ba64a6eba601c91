"""The program's locators keep what `grabberd.testing` asks of one."""

from typing import ClassVar

import pytest

from grabberd.measurement.location import _locator
from grabberd.measurement.locators import Locator
from grabberd.testing import LocatorContract


class TestEveryLocator(LocatorContract):
    @pytest.fixture(params=["centroid", "weighted", "template", "edge", "correlation", "vernier", "tian-huhns", "locale"])
    def locator(self, request):
        return _locator(request.param, 8)

class TestBit(LocatorContract):
    bits = (1,)
    @pytest.fixture(params=["centroid", "locale", "vernier", "tian-huhns"])
    def locator(self, request):
        return _locator(request.param, 1)
