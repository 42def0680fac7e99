"""What a client shows and when: its token once a connection, how long an answer is worth having, its stream."""

import json
from pathlib import Path

import numpy as np
import pytest
from fake_service import EYE, FakeService, Q

from ik_client import IKClient, Refused, ServiceTimeout, Unauthorized
from ik_client.access import Access, read_token
from ik_client.load.cli import main as load
from ik_proto import FkRequest, InfoRequest, Status

TOKEN = "a-secret-of-the-test"


@pytest.fixture(autouse=True)
def no_token(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("IK_TOKEN", raising=False)


def tokens(service: FakeService) -> list[str | None]:
    return [document.get("token") for document in service.documents]


def test_a_connection_begins_with_the_token_and_requests_go_without(fake, service):
    with IKClient(fake.url, timeout=2.0, token=TOKEN) as ik:
        ik.solve(EYE, EYE, Q)
        ik.fk(Q)
    assert tokens(service) == [TOKEN, None, None, None]
    assert isinstance(service.requests[0], InfoRequest)
    assert isinstance(service.requests[3], FkRequest)


def test_a_new_connection_shows_it_again(service, start_tcp):
    """Hazard row: service restart."""
    first = start_tcp(service)
    with IKClient(first.url, timeout=2.0, token=TOKEN) as ik:
        first.stop()
        service.boot_id = "boot-2"
        service.documents.clear()
        start_tcp(service, first.port)
        assert ik.solve(EYE, EYE, Q).success
        assert ik.boot_id == "boot-2"
    assert tokens(service) == [TOKEN, None]


def test_without_a_token_nothing_is_sent_first(fake, service):
    with IKClient(fake.url, timeout=2.0) as ik:
        ik.solve(EYE, EYE, Q)
    assert tokens(service) == [None, None]


def test_over_zenoh_each_request_carries_it(service, start_zenoh, free_port):
    start_zenoh(service, f"tcp/127.0.0.1:{free_port}")
    with IKClient(f"zenoh://127.0.0.1:{free_port}", timeout=5.0, token=TOKEN) as ik:
        ik.solve(EYE, EYE, Q)
    assert tokens(service) == [TOKEN, TOKEN]


def test_the_environment_serves_where_none_is_given(fake, service, monkeypatch):
    monkeypatch.setenv("IK_TOKEN", f"{TOKEN}\n")
    with IKClient(fake.url, timeout=2.0):
        pass
    assert tokens(service)[0] == TOKEN
    service.documents.clear()
    with IKClient(fake.url, timeout=2.0, token="another-secret"):
        pass
    assert tokens(service)[0] == "another-secret"


@pytest.mark.parametrize(
    ("token", "words"), [(None, "the service demands a token; pass"), (TOKEN, "another token than the one shown")]
)
def test_a_service_that_does_not_let_us_in_says_what_to_do(fake, service, token, words):
    """Hazard row: auth."""
    service.answer = lambda request: service.refuse(request, Status.UNAUTHORIZED, "no")
    with pytest.raises(Unauthorized, match=words) as caught:
        IKClient(fake.url, timeout=2.0, token=token)
    assert caught.value.status is Status.UNAUTHORIZED
    assert "IK_TOKEN" in str(caught.value)
    assert TOKEN not in str(caught.value)
    assert fake.accepted == 1  # told at once, and not tried again


def test_a_refused_connection_is_told_as_the_refusal_that_it_is(fake, service):
    service.answer = lambda request: service.refuse(request, Status.OVERLOADED, "all connections are taken")
    with pytest.raises(Refused, match="overloaded: all connections are taken"):
        IKClient(fake.url, timeout=2.0, token=TOKEN)


@pytest.mark.parametrize("status", [Status.EXPIRED, Status.SUPERSEDED])
def test_an_answer_that_came_too_late_is_a_refusal(ik, service, status):
    service.answer = lambda request: service.refuse(request, status)
    with pytest.raises(Refused) as caught:
        ik.solve(EYE, EYE, Q)
    assert type(caught.value) is Refused
    assert caught.value.status is status


def test_a_solve_is_worth_having_as_long_as_the_call_may_take(fake, service):
    """Hazard row: stale target."""
    with IKClient(fake.url, timeout=2.5) as ik:
        ik.solve(EYE, EYE, Q)
        ik.solve_batch(np.tile(EYE, (10, 1, 1)), np.tile(EYE, (10, 1, 1)), np.tile(Q, (10, 1)))
        ik.fk(Q)
        ik.timeout = 11.0
        ik.solve(EYE, EYE, Q)  # more than the contract can say
    assert [document.get("budget_ms") for document in service.documents] == [None, 2500.0, 2520.0, None, None]


def test_or_as_long_as_it_is_told(fake, service):
    with IKClient(fake.url, timeout=2.5, budget=0.02, stream="operator 1") as ik:
        ik.solve(EYE, EYE, Q)
        ik.info()
    assert [document.get("budget_ms") for document in service.documents] == [None, 20.0, None]
    assert [document.get("stream") for document in service.documents] == [None, "operator 1", None]


@pytest.mark.parametrize("budget", [0.0, -1.0, 10.001, float("nan"), float("inf")])
def test_a_budget_is_within_the_contract(budget):
    with pytest.raises(ValueError, match="budget must be above 0 s and at most 10 s"):
        IKClient("tcp://127.0.0.1:1", budget=budget)


@pytest.mark.parametrize(
    ("url", "arguments", "words"),
    [
        ("tcp://h:1", {"stream": "x" * 65}, "stream must have at most 64"),
        ("tcp://h:1", {"token": "x" * 257}, "a token is a line"),
        ("tcp://h:1", {"token": "two\nlines"}, "a token is a line"),
        ("tcp://h:1", {"token": "ä"}, "a token is a line"),
        ("tcp://h:1", {"ca": "ca.pem"}, "for tls:// addresses"),
        ("zenoh://h:1", {"cert": "client.pem"}, "Zenoh takes them in zenoh_config"),
        ("tls://h:1", {"key": "client.key"}, "give both"),
        ("tls://h:1", {"zenoh_config": "client.json5"}, "for zenoh:// addresses"),
        ("zenoh://h:1", {"zenoh_config": "no such file"}, "zenoh_config no such file cannot be read"),
    ],
)
def test_what_makes_no_sense_is_one_line(url, arguments, words):
    with pytest.raises(ValueError, match=words) as caught:
        IKClient(url, connect=False, **arguments)
    assert "\n" not in str(caught.value)


def test_a_zenoh_configuration_that_is_none_is_one_line(tmp_path):
    file = tmp_path / "client.json5"
    file.write_text("{ transport: { auth: 3 } }")
    with pytest.raises(ValueError, match=r"client\.json5") as caught:
        IKClient("zenoh://h:1", connect=False, zenoh_config=file)
    assert "\n" not in str(caught.value)


def test_a_token_shows_in_no_representation():
    assert TOKEN not in repr(Access(token=TOKEN))


def write(file: Path, text: str, mode: int = 0o600) -> Path:
    file.touch(mode)
    file.chmod(mode)
    file.write_text(text, encoding="utf-8")
    return file


def test_a_token_file_is_read_if_it_is_private(tmp_path):
    assert read_token(write(tmp_path / "good", f"{TOKEN}\n")) == TOKEN
    for name, text, mode, words in (
        ("open", TOKEN, 0o644, "chmod 600"),
        ("empty", "\n", 0o600, "is empty"),
        ("strange", "ä", 0o600, "something else"),
    ):
        with pytest.raises(ValueError, match=words):
            read_token(write(tmp_path / name, text, mode))
    with pytest.raises(ValueError, match="cannot be read"):
        read_token(tmp_path / "nowhere")


def test_a_command_takes_the_token_from_its_file_and_reports_only_where_it_was(fake, service, tmp_path):
    file, report = write(tmp_path / "ik.token", TOKEN), tmp_path / "load.json"
    arguments = ["--duration", "0.05", "--warmup", "0", "--closed", "--token-file", str(file), "--json", str(report)]
    assert load([fake.url, *arguments]) == 0
    assert tokens(service)[0] == TOKEN
    assert json.loads(report.read_text())["options"]["access"]["token_file"] == str(file)
    assert TOKEN not in report.read_text()


def test_a_command_with_a_wrong_file_fails_in_one_line(fake, tmp_path, capsys):
    file = write(tmp_path / "ik.token", TOKEN, 0o644)
    assert load([fake.url, "--token-file", str(file)]) == 2
    error = capsys.readouterr().err
    assert error == f"ik-load: others can read the token file {file}: chmod 600 it\n"


def test_a_service_that_stays_silent_after_the_greeting_is_timed_out(fake, service):
    """Hazard row: lost connection."""
    service.answer = lambda request: b"" if isinstance(request, InfoRequest) else None
    service.frame = lambda body: b""
    with pytest.raises(ServiceTimeout):
        IKClient(fake.url, connect_timeout=0.1, token=TOKEN)
