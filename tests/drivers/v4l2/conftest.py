"""A grabber that streams, on the card and with the options that a test gives."""

import pytest

from drivers.v4l2.bench import Bench


@pytest.fixture
def streaming(tmp_path):
    def make(card=None, **options):
        bench = Bench(tmp_path, card, **options)
        bench.info = bench.grabber.open()
        return bench

    return make
