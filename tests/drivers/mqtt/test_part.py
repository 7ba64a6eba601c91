"""From the configuration to what publishes, or to why it cannot."""

import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from grabberd.config import default_config_file, load_config
from grabberd.config.section import without_secrets
from grabberd.errors import ConfigError
from grabberd_mqtt.part import check_mqtt


def written(folder: Path, mqtt: dict[str, Any], site: dict[str, str] | None = None) -> Path:
    document = yaml.safe_load(default_config_file().read_text())
    del document["devices"]["simulated"]["calibration"], document["devices"]["simulated"]["object"]
    document |= {"mqtt": mqtt, "site": {"barn": "north"} if site is None else site}
    file = folder / "barn.yaml"
    file.write_text(yaml.safe_dump(document))
    return file


def complaint(file: Path) -> str:
    with pytest.raises(ConfigError) as caught:
        check_mqtt(load_config(file), file)
    return caught.value.message


def test_ports_are_those_of_mqtt_unless_named(tmp_path: Path) -> None:
    def address(**mqtt: Any) -> Any:
        config = load_config(written(tmp_path, {"host": "broker", **mqtt}))
        assert config.mqtt is not None
        return config.mqtt.address

    assert address() == ("broker", 1883)
    assert address(tls={}) == ("broker", 8883)
    assert address(port=1) == ("broker", 1)


def test_a_barn_without_a_name_is_refused(tmp_path: Path) -> None:
    assert "site.barn: mqtt needs it" in complaint(written(tmp_path, {"host": "broker"}, site={}))


def test_without_the_extra_it_says_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    assert "pip install 'grabberd[mqtt]'" in complaint(written(tmp_path, {"host": "broker"}))


def test_a_certificate_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "ca.pem").write_text("none")
    assert "mqtt.tls: a certificate" in complaint(written(tmp_path, {"host": "b", "tls": {"ca": "ca.pem"}}))


@pytest.mark.parametrize(
    ("mqtt", "said"),
    [
        ({"host": "b", "password": "x"}, "mqtt.password: unknown key; did you mean password_file?"),
        ({"host": "b", "password_file": "barn.yaml"}, "password_file requires user"),
        ({"host": "b", "password_file": "none", "user": "u"}, "no file"),
        ({"host": "b", "tls": {"certificate": "barn.yaml"}}, "go together"),
        ({"host": "b", "topic_prefix": "a/#"}, "topic_prefix"),
        ({"host": "b", "topic_prefix": "a/"}, "topic_prefix"),
        ({"host": "b", "topic_prefix": "$SYS"}, "topic_prefix"),
    ],
)
def test_what_cannot_be_meant_is_refused(mqtt: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(written(tmp_path, mqtt))
    assert said in caught.value.message


def test_nothing_secret_is_shown(tmp_path: Path) -> None:
    file = written(tmp_path, {"host": "b", "user": "barn", "password_file": "barn.yaml"})
    shown = without_secrets(load_config(file).model_dump(mode="json"))
    assert shown["mqtt"]["password_file"] == "…"


def test_a_daemon_that_publishes_nothing_does_not_load_mqtt() -> None:
    script = """
from pathlib import Path; import sys
from grabberd.config import default_config_file, load_config
from grabberd.server.daemon.service import Service
from grabberd.instrument.setup import set_up
file = default_config_file()
Service.from_config(load_config(file), set_up(load_config(file), file))
print([name for name in ("aiomqtt", "paho") if name in sys.modules])
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout.strip() == "[]"
