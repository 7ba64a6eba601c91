"""The configuration without its secrets."""

import pytest

from grabberd.config.section import HIDDEN, without_secrets


@pytest.mark.parametrize("key", ["password", "mqtt_password", "token", "api_key", "Secret", "apikey"])
def test_a_secret_is_hidden_by_its_name(key: str) -> None:
    document = {"options": [{key: "hunter2", "port": 1883}]}
    assert without_secrets(document) == {"options": [{key: HIDDEN, "port": 1883}]}


def test_a_secret_that_is_not_set_is_seen_not_to_be() -> None:
    assert without_secrets({"password": None}) == {"password": None}


def test_a_name_and_a_password_in_an_address_are_hidden() -> None:
    assert without_secrets("mqtt://cow:milk@host/x") == f"mqtt://{HIDDEN}@host/x"


def test_everything_else_is_shown_as_it_is() -> None:
    document = {"http": {"tls": {"key": "/etc/key.pem"}}, "slots": 32, "path": "a@b", "list": [1, None]}
    assert without_secrets(document) == document
