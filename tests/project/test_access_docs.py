"""The worked examples of `docs/access.md`: files and commands, as they stand, let in and keep out whom they say."""

import json
import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from certificates import make_certificates

from ik_client import IKClient, IKError
from ik_client.load.cli import main as load
from ik_service.cli import main as serve

REPO = Path(__file__).resolve().parents[2]
PAGE = (REPO / "docs" / "access.md").read_text()
LIMIT_S = 10.0
QUIET = ["--kernel", "vm", "--http", "off"]


def file(name: str) -> str:
    """A file of the page: the block after its name."""
    (text,) = re.findall(rf"^`{re.escape(name)}`[^\n]*:\n\n```\w+\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    return text


def commands(program: str) -> list[str]:
    """What the page types, lines that go on joined."""
    text = PAGE.replace("\\\n", " ")
    return re.findall(rf"^\$ {program} (.*)$", text, re.MULTILINE)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return listener.getsockname()[1]


def solves(ik: IKClient) -> bool:
    q = np.zeros(14)
    wrists = ik.fk(q)
    return ik.solve(wrists.left_wrist, wrists.right_wrist, q).success


class Example:
    """The files of the Zenoh example in a folder of their own, for a free port."""

    def __init__(self, folder: Path) -> None:
        self.folder = make_certificates(folder)
        self.port = free_port()
        self.url = f"zenoh://127.0.0.1:{self.port}"
        for name in ("service.json5", "users.txt", "client.json5"):
            self.write(name, file(name))

    def write(self, name: str, text: str) -> str:
        text = text.replace("robot.example:7447", f"127.0.0.1:{self.port}").replace(":7447", f":{self.port}")
        (self.folder / name).write_text(text)
        return name

    def variant(self, *changes: tuple[str, str]) -> str:
        """The client's file with changes that it must have room for; gives its name."""
        text = file("client.json5")
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        return self.write("variant.json5", text)

    def client(self, config: str) -> IKClient:
        return IKClient(self.url, zenoh_config=config, connect_timeout=0.5, timeout=5.0)

    def serve(self, start: Callable[..., Any]) -> Any:
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(self.folder)
            return start("--zenoh-config", "service.json5", "--tcp", "off", *QUIET)


@pytest.fixture(scope="module")
def example(_starter: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Example]:
    example = Example(tmp_path_factory.mktemp("zenoh"))
    service = example.serve(_starter)
    assert service.ready["zenoh"] == f"tls/0.0.0.0:{example.port}"  # which needed no --insecure
    yield example
    service.stop()


def refused(example: Example, config: str) -> bool:
    try:
        with example.client(config) as ik:
            return not solves(ik)
    except IKError as error:
        assert "\n" not in str(error)
        return True


def test_the_right_client_is_served(example: Example, monkeypatch: pytest.MonkeyPatch) -> None:
    """Hazard row: auth."""
    monkeypatch.chdir(example.folder)
    with example.client("client.json5") as ik:
        assert solves(ik)


CHANGES: dict[str, list[tuple[str, str]]] = {
    "wrong password": [("a-long-password", "a-wrong-password")],
    "unknown user": [('"operator"', '"nobody"')],
    "no user": [('auth: { usrpwd: { user: "operator", password: "a-long-password" } },', "")],
    "a user without a policy": [('"operator"', '"visitor"'), ("a-long-password", "another-password")],
    "no certificate": [('connect_certificate: "client.pem",', ""), ('connect_private_key: "client.key",', "")],
    "a stranger's certificate": [("client.pem", "stranger.pem"), ("client.key", "stranger.key")],
    "an unknown authority": [("ca.pem", "stranger_ca.pem")],
    "no TLS": [("tls/", "tcp/")],
}


@pytest.mark.parametrize("who", CHANGES)
def test_others_are_not(example: Example, monkeypatch: pytest.MonkeyPatch, who: str) -> None:
    """Hazard row: auth."""
    monkeypatch.chdir(example.folder)
    assert refused(example, example.variant(*CHANGES[who]))


def test_a_key_outside_the_list_is_not_served(
    start_service: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same service and the same client, and a list with the keys of another robot."""
    example = Example(tmp_path)
    assert "ik/g1/" in file("service.json5")
    example.write("service.json5", file("service.json5").replace("ik/g1/", "ik/h1/"))
    example.serve(start_service)
    monkeypatch.chdir(example.folder)
    assert refused(example, "client.json5")


@pytest.mark.skipif(shutil.which("openssl") is None, reason="needs the program openssl (Debian package openssl)")
def test_the_token_and_the_certificates_let_in(
    start_service: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    make = [f"openssl {command}".replace("robot.example", "localhost") for command in commands("openssl")]
    assert len(make) == 3
    for command in make:
        made = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=LIMIT_S, check=False)
        assert made.returncode == 0, made.stderr
    token, serve, _ = commands("ik-service")
    write = [sys.executable, "-m", "ik_service", *token.split()]
    said = subprocess.run(write, capture_output=True, text=True, timeout=60, check=True).stdout
    assert said in PAGE
    _, *options = serve.replace("12345", "0").split()
    service = start_service(*options, "--tls-client-ca", "ca.pem", "--zenoh", "off", *QUIET)
    port = service.ready["tcp"].rsplit(":", 1)[1]
    (program,) = re.findall(r"^```py\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    with_certificate = 'ca="ca.pem", cert="client.pem", key="client.key"'
    program = program.replace("robot.example:12345", f"localhost:{port}").replace('ca="ca.pem"', with_certificate)
    secret = json.dumps(Path("ik.token").read_text().strip())
    run = [sys.executable, "-c", program.replace('"..."', secret)]
    assert subprocess.run(run, capture_output=True, text=True, timeout=60, check=True).stdout == "g1\n"
    run[-1] = program
    assert "Unauthorized" in subprocess.run(run, capture_output=True, text=True, timeout=60, check=False).stderr


@pytest.mark.parametrize(("program", "main"), [("ik-service", serve), ("ik-load", load)])
def test_every_option_of_the_page_exists(
    program: str, main: Callable[[list[str]], int], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["serve", "--help"] if program == "ik-service" else ["--help"])
    usage = capsys.readouterr().out
    options = {option for line in commands(program) for option in re.findall(r"--[\w-]+", line)}
    assert options
    assert all(re.search(rf"{option}(?![\w-])", usage) for option in options)
