"""Failed attempts are slowed, counted and logged, without their secrets."""

import logging
import subprocess
import sys
from pathlib import Path

import pytest

from grabberd.archive.access import Access
from grabberd.documents.enums import Role
from grabberd.server.api.guard import authentication
from grabberd.server.api.guard.authentication import (
    ADDRESSES,
    COOKIE,
    FORGOTTEN_AFTER_S,
    FREE_ATTEMPTS,
    LONGEST_WAIT_S,
    Attempts,
    client_of,
)
from grabberd.server.api.problems import Refusal
from server.api.gates import Gated, Ticks, is_problem

STATE = "/api/v1/state"


@pytest.fixture
def clock() -> Ticks:
    return Ticks()


@pytest.fixture
def attempts(clock: Ticks) -> Attempts:
    return Attempts(clock)


def waits_s(attempts: Attempts, client: str, secret: str = "guess") -> int:
    try:
        attempts.check(client, secret)
    except Refusal as refusal:
        return int((refusal.headers or {})["Retry-After"])
    return 0


def fail(attempts: Attempts, client: str, times: int) -> None:
    for _ in range(times):
        attempts.failed(client)


def test_a_page_and_a_person_may_err_a_few_times(attempts: Attempts) -> None:
    fail(attempts, "a", FREE_ATTEMPTS)
    assert waits_s(attempts, "a") == 0


def test_after_that_the_wait_doubles_up_to_a_minute(attempts: Attempts) -> None:
    fail(attempts, "a", FREE_ATTEMPTS)
    waits = []
    for _ in range(8):
        attempts.failed("a")
        waits.append(waits_s(attempts, "a"))
    assert waits == [1, 2, 4, 8, 16, 32, 60, 60]
    fail(attempts, "a", 5000)
    assert waits_s(attempts, "a") == LONGEST_WAIT_S


def test_time_ends_the_wait_and_in_the_end_forgets(attempts: Attempts, clock: Ticks) -> None:
    fail(attempts, "a", FREE_ATTEMPTS + 3)
    clock.now_s += 4
    assert waits_s(attempts, "a") == 0
    attempts.failed("a")
    assert waits_s(attempts, "a") == 8
    clock.now_s += 1000
    attempts.failed("a")
    assert waits_s(attempts, "a") == 0


def test_others_do_not_wait(attempts: Attempts) -> None:
    fail(attempts, "a", FREE_ATTEMPTS + 5)
    assert waits_s(attempts, "b") == 0


def test_who_was_right_before_does_not_wait_behind_the_same_address(attempts: Attempts) -> None:
    attempts.succeeded("right")
    fail(attempts, "a", FREE_ATTEMPTS + 5)
    assert waits_s(attempts, "a", "right") == 0
    assert waits_s(attempts, "a", "guess") == 16


def test_being_right_ends_the_wait_of_that_token_alone(attempts: Attempts) -> None:
    fail(attempts, "a", FREE_ATTEMPTS + 5)
    attempts.succeeded("right")
    assert waits_s(attempts, "a", "right") == 0
    assert waits_s(attempts, "a") == 16


def test_a_valid_token_buys_no_further_guesses(attempts: Attempts) -> None:
    for _ in range(FREE_ATTEMPTS + 5):
        attempts.failed("a")
        attempts.succeeded("right")
    assert waits_s(attempts, "a") == 16


def test_who_mistypes_now_and_then_is_never_made_to_wait(attempts: Attempts, clock: Ticks) -> None:
    for _ in range(3 * FREE_ATTEMPTS):
        attempts.failed("a")
        assert waits_s(attempts, "a", "right") == 0
        attempts.succeeded("right")
        clock.now_s += FORGOTTEN_AFTER_S + 1


def test_however_many_try_few_are_remembered(attempts: Attempts) -> None:
    for n in range(3 * ADDRESSES):
        fail(attempts, f"client {n}", 1)
        attempts.succeeded(f"secret {n}")
    assert len(attempts._records) == ADDRESSES
    assert len(attempts._proven) <= ADDRESSES


@pytest.mark.parametrize(
    ("address", "client"),
    [
        ("192.168.1.4", "192.168.1.4"),
        ("::ffff:192.168.1.4", "192.168.1.4"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("", "this machine"),
    ],
)
def test_a_host_is_one_client_whichever_of_its_addresses_it_takes(address: str, client: str) -> None:
    assert client_of({"type": "http", "client": (address, 5000)}) == client
    assert client_of({"type": "http", "client": None}) == "this machine"


def test_the_log_has_one_line_a_minute(
    attempts: Attempts, clock: Ticks, caplog: pytest.LogCaptureFixture
) -> None:
    fail(attempts, "a", 500)
    clock.now_s += 61
    fail(attempts, "b", 500)
    assert [record.getMessage() for record in caplog.records] == [
        "refused invalid tokens or sessions: 1, the last from a",
        "refused invalid tokens or sessions: 500, the last from b",
    ]


def test_over_http_guessing_is_told_to_wait_and_the_right_token_works_after_it(tmp_path: Path) -> None:
    gated = Gated(tmp_path)
    client = gated.client()
    guess = {"Authorization": "Bearer grabberd_guess"}
    for _ in range(FREE_ATTEMPTS + 1):
        assert is_problem(client.get(STATE, headers=guess), 401, "unauthorized")
    answer = client.get(STATE, headers=guess)
    assert is_problem(answer, 429, "too-many-attempts")
    assert answer.headers["retry-after"] == "1"
    assert client.get(STATE, headers=gated.bearer(Role.VIEWER)).status_code == 429
    gated.clock.now_s += 1
    assert client.get(STATE, headers=gated.bearer(Role.VIEWER)).status_code == 200


def test_sessions_are_guessed_no_faster(tmp_path: Path) -> None:
    gated = Gated(tmp_path)
    for _ in range(FREE_ATTEMPTS + 1):
        assert gated.client(cookies={"grabberd_session": "guess"}).get(STATE).status_code == 401
    assert gated.client(cookies={"grabberd_session": "guess"}).get(STATE).status_code == 429


def test_asking_without_any_token_is_no_attempt(tmp_path: Path) -> None:
    client = Gated(tmp_path).client()
    assert {client.get(STATE).status_code for _ in range(3 * FREE_ATTEMPTS)} == {401}


def test_no_secret_comes_into_the_log_or_an_answer(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    gated = Gated(tmp_path)
    client = gated.client()
    secrets = [*gated.secrets.values(), "grabberd_wrong-one"]
    answers = [client.get(STATE, headers={"Authorization": f"Bearer {secret}"}) for secret in secrets]
    told = caplog.text + "".join(answer.text + str(answer.headers) for answer in answers)
    assert "invalid tokens" in caplog.text
    assert not any(secret in told for secret in secrets)
    stored = (tmp_path / "state.sqlite").read_bytes()
    assert not any(secret.encode() in stored for secret in secrets)


REMOVE = """
import sys
from pathlib import Path
from grabberd.archive.access import Access
Access(Path(sys.argv[1])).remove(sys.argv[2])
"""


def test_who_is_known_is_admitted_without_a_thread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gated = Gated(tmp_path)
    client, headers = gated.client(), gated.bearer(Role.VIEWER)
    assert client.get(STATE, headers=headers).status_code == 200
    monkeypatch.setattr(authentication, "run_in_threadpool", lambda *_: pytest.fail("it reads the disk"))
    assert client.get(STATE, headers=headers).status_code == 200


@pytest.mark.parametrize("traded", [False, True])
def test_a_token_that_another_process_removes_is_refused_from_the_next_request_on(
    tmp_path: Path, traded: bool
) -> None:
    gated = Gated(tmp_path)
    client, headers = gated.client(), gated.bearer(Role.OPERATOR)
    if traded:
        identity = gated.access.of_token(gated.secrets[Role.OPERATOR])
        assert identity
        headers = {"Cookie": f"{COOKIE}={gated.access.open_session(identity)}"}
    for _ in range(3):
        assert client.get(STATE, headers=headers).status_code == 200
    subprocess.run([sys.executable, "-c", REMOVE, str(tmp_path), Role.OPERATOR.value], check=True)
    assert is_problem(client.get(STATE, headers=headers), 401, "unauthorized")


def test_the_first_token_closes_the_private_socket_from_the_next_request_on(tmp_path: Path) -> None:
    gated = Gated(tmp_path, tokens=False)
    client = gated.client(client=("127.0.0.1", 50000))
    for _ in range(3):
        assert client.get(STATE).status_code == 200
    Access(tmp_path).add("tablet", Role.OPERATOR)
    assert is_problem(client.get(STATE), 401, "unauthorized")
