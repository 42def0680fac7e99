"""Every command and every program in the documentation is run, against a real service; every link leads somewhere."""

import json
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest
from person_film import film_t_pose

REPO = Path(__file__).resolve().parents[2]
PAGES = sorted(
    [REPO / "README.md", REPO / "CONTRIBUTING.md", REPO / "proto" / "README.md", *(REPO / "docs").glob("*.md")]
)
BIN = Path(sys.executable).parent
DEFAULT_TCP = "127.0.0.1:12345"


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL)


def name_of(page: Path) -> str:
    return str(page.relative_to(REPO))


def commands() -> list[Any]:
    """Every distinct shell command; `&&` separates two, a `#` begins a comment, `uv run` changes nothing."""
    lines = [(page, line) for page in PAGES for block in blocks(page, "sh") for line in block.splitlines()]
    split = [(page, part.split("#")[0].strip()) for page, line in lines for part in line.split("&&")]
    distinct = {command.removeprefix("uv run "): name_of(page) for page, command in reversed(split) if command}
    return [pytest.param(command, id=f"{page}: {command}") for command, page in distinct.items()]


def programs() -> list[Any]:
    found = [(page, k, code) for page in PAGES for k, code in enumerate(blocks(page, "python"))]
    return [pytest.param(code, id=f"{name_of(page)} {k}") for page, k, code in found]


@pytest.fixture(scope="module", autouse=True)
def _kernel_of_this_run(kernel_cache: Path) -> Iterator[None]:
    """Commands and the services they start use the kernel that was compiled for this run of the suite."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("IK_CACHE_DIR", str(kernel_cache))
        yield


def run(*command: Any, cwd: Path) -> None:
    result = subprocess.run([str(part) for part in command], cwd=cwd, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, f"{command}: {result.stdout[-2000:]}{result.stderr[-2000:]}"


@contextmanager
def listening(*command: Any, log: Path) -> Generator[dict[str, Any]]:
    """A program that runs until it is asked to end: the line with which it says that it listens; it must end well."""
    with (
        log.open("w") as errors,
        subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE, stderr=errors, text=True) as process,
    ):
        assert process.stdout is not None
        try:
            line = process.stdout.readline()
            assert line, log.read_text()
            yield json.loads(line)
            process.terminate()
            process.communicate(timeout=60)
            assert process.returncode == 0, log.read_text()
        finally:
            process.kill()


def robot(folder: Path) -> AbstractContextManager[dict[str, Any]]:
    """`ik-sim --listen` as the pages have it, but at a free port."""
    return listening(BIN / "ik-sim", "--listen", "127.0.0.1:0", "--headless", log=folder / "robot.log")


@pytest.fixture(scope="module")
def recording(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Callable[[], Path]:
    """Gives a recording for `ik-camera`, filmed when it is first asked for; skips where nobody can be filmed."""
    made: list[Path] = []

    def film() -> Path:
        if not made:
            data = request.getfixturevalue("shared_data")
            made.append(film_t_pose(tmp_path_factory.mktemp("film") / "person.ikcam", data))
        return made[0]

    return film


def run_camera(rest: list[str], recording: Path, service: str, folder: Path) -> None:
    """`ik-camera` as the pages have it, with a recording for its camera."""
    program = BIN / "ik-camera"
    if "--replay" in rest:
        shutil.copy(recording, folder / rest[rest.index("--replay") + 1])
    else:
        rest = [*rest, "--replay", str(recording)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CONFIG_HOME", str(folder))
        if "--user" in rest:
            fit = ["calibrate", "--user", rest[rest.index("--user") + 1], "--replay", recording]
            run(program, *fit, cwd=folder)
            assert list((folder / "ik-camera").glob("*.json"))
        if rest[:1] != ["calibrate"]:
            with robot(folder) as ready:
                ends = ("--service", service, "--robot", f"tcp://{ready['listen']}")
                run(program, *rest, *ends, "--no-preview", "--replay-speed", "2", cwd=folder)


@pytest.mark.timeout(400)
@pytest.mark.parametrize("command", commands())
def test_a_documented_command_works(
    command: str, service_process: Any, tmp_path: Path, recording: Callable[[], Path]
) -> None:
    program, *rest = shlex.split(command)
    rest = [part.replace(DEFAULT_TCP, service_process.ready["tcp"]) for part in rest]
    match program:
        case "ik-demo":  # briefly: a second's film instead of twelve takes a twelfth of the time
            run(BIN / program, *rest, "--duration", "1", cwd=tmp_path)
            assert (tmp_path / "out" / "demo" / "report.json").is_file()
        case "ik-load":
            run(BIN / program, *rest, cwd=tmp_path)
        case "ik-sim" if "--listen" in rest:
            with robot(tmp_path):
                pass
        case "ik-xr":
            with robot(tmp_path) as ready:
                free = (
                    "--service",
                    service_process.tcp_url,
                    "--robot",
                    f"tcp://{ready['listen']}",
                    "--local-port",
                    "0",
                )
                port = () if "--emulate" in rest else ("--port", "0", "--certificates", str(tmp_path / "certificates"))
                with listening(BIN / program, *rest, *free, *port, log=tmp_path / "xr.log") as page:
                    assert page["emulator" if "--emulate" in rest else "pages"]
        case "ik-camera" if rest == ["models"]:
            made = subprocess.run([BIN / program, *rest], capture_output=True, text=True, timeout=300)
            if made.returncode and "npm" in made.stderr:
                pytest.skip(made.stderr)
            assert made.returncode == 0, made.stderr
        case "ik-camera" if rest and rest[0] == "record":
            run(BIN / program, *rest, "--source", recording(), "--duration", "2", cwd=tmp_path)
            assert (tmp_path / rest[1]).is_file()
        case "ik-camera":
            run_camera(rest, recording(), service_process.tcp_url, tmp_path)
        case "ik-gamepad" if "--list" in rest:
            run(BIN / program, *rest, cwd=tmp_path)
        case "ik-gamepad":  # with a virtual pad, and a window that nobody sees
            with robot(tmp_path) as ready:
                hidden = ("env", "SDL_VIDEODRIVER=dummy") if "--keyboard" in rest else ("env", "-u", "DISPLAY")
                pad = (sys.executable, REPO / "tests" / "gamepad" / "pad_process.py")
                ends = ("--service", service_process.tcp_url, "--robot", f"tcp://{ready['listen']}")
                with listening(*hidden, *pad, *rest, *ends, log=tmp_path / "pad.log") as told:
                    assert told["window"] == ("--keyboard" in rest)
        case "ik-sim":
            run(BIN / program, service_process.tcp_url, *rest, cwd=tmp_path)
        case "ik-service":
            assert rest == ["serve"]
            assert service_process.ready["tcp"]  # it runs: the other programs of this page talk to it
        case "pytest":  # this very suite; whether its options are understood is what is left to see
            folders = [] if any((REPO / part).exists() for part in rest) else [Path(__file__).parent]
            run(BIN / program, *rest, *folders, "--collect-only", "-q", cwd=REPO)
        case "ruff" | "ty":
            if not (BIN / program).exists():
                pytest.skip(f"{program} is a development tool and not installed here")
            run(BIN / program, *rest, cwd=REPO)
        case "pip":
            assert rest[0] == "install"
            extras = tomllib.loads((REPO / "pyproject.toml").read_text())["project"]["optional-dependencies"]
            (wanted,) = re.findall(r"\[(\w+)\]", rest[-1])
            assert wanted in extras
        case "python" if rest[0].startswith("benchmarks/"):
            table = subprocess.run([sys.executable, *rest], cwd=REPO, capture_output=True, text=True, timeout=300)
            # Exit status 1 says that a limit was missed, which on a shared machine is no fault of the command.
            assert table.returncode in (0, 1), table.stderr
            assert "p50" in table.stdout
        case "python" | ".":
            assert command in ("python -m venv .venv", ". .venv/bin/activate")
        case _:
            pytest.fail(f"no test knows how to run {command!r}")


@pytest.mark.slow
def test_the_demonstration_works_at_its_full_length(tmp_path: Path) -> None:
    run(BIN / "ik-demo", cwd=tmp_path)
    report = json.loads((tmp_path / "out" / "demo" / "report.json").read_text())
    assert report["seconds"] == 12.0
    assert (tmp_path / "out" / "demo" / "demo.mp4").is_file()


@pytest.mark.parametrize("code", programs())
def test_a_documented_program_works(code: str, service_process: Any, tmp_path: Path) -> None:
    host, port = service_process.tcp
    code = code.replace(DEFAULT_TCP, f"{host}:{port}").replace('("127.0.0.1", 12345)', f'("{host}", {port})')
    assert "12345" not in code
    run(sys.executable, "-c", code, cwd=tmp_path)


def test_every_page_is_checked_for_something() -> None:
    assert len(commands()) >= 10
    assert len(programs()) >= 4


@pytest.mark.parametrize("page", PAGES, ids=lambda page: name_of(page))
def test_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text())
    missing = [target for target in targets if not target.startswith("http") and not (page.parent / target).exists()]
    assert missing == []
