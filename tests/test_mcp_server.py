"""``rig mcp`` over its standard streams, asked by the client of the SDK, as an agent does it."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import psutil
import pytest

from rig.cli.mcp_tools import tool
from rig.core.text import LONGEST_LINE
from rig.log import read_log

anyio: Any = pytest.importorskip("anyio")
pytestmark = pytest.mark.skipif(find_spec("mcp") is None, reason="the SDK is not installed")

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "how-to" / "let-an-agent-fly.md"
Command = Callable[..., tuple[int, str, str]]
Ask = Callable[..., Awaitable[Any]]
CODE = "from pathlib import Path\nPath(__file__).with_name('mark').touch()\nclass X:\n    pass\n"
SHORT = {"duration_s": 3, "faults.0.start_s": 1}


def sdk() -> Any:
    """The SDK, which takes half a second to be imported: not by every worker that collects the tests."""
    return import_module("mcp")


@asynccontextmanager
async def server(folder: Path, *options: str) -> AsyncIterator[Any]:
    """A client of ``rig mcp --out folder/agent``."""
    words = ["-m", "rig", "mcp", "--out", str(folder / "agent"), *options]
    started = sdk().StdioServerParameters(command=sys.executable, args=words, env=dict(os.environ), cwd=str(folder))
    async with sdk().Client(started) as client:
        yield client


def asked(folder: Path, ask: Callable[[Any], Awaitable[Any]], *options: str) -> Any:
    """What ``ask(client)`` returns, of a server that ends afterwards."""

    async def run() -> Any:
        async with server(folder, *options) as client:
            return await ask(client)

    return anyio.run(run)


def process(folder: Path) -> psutil.Process:
    """The server of a folder."""
    (found,) = [each for each in psutil.Process().children() if str(folder / "agent") in each.cmdline()]
    return found


def test_progress_is_one_number_that_rises():
    from rig.cli.mcp_server import _Reached  # imports what may be absent

    reached = _Reached()
    steps = [("a", 0, 0), ("a", 1, 4), ("a", 4, 4), ("b", 9, 3), ("b", 1, 2), ("c", 0, 0), ("a", 1, 2)]
    values = [reached.after(*step) for step in steps]
    assert values == sorted(set(values)) and [int(value) for value in values] == [1, 1, 1, 2, 2, 3, 4]


def put_files(folder: Path) -> None:
    """A suite and a space to search."""
    given = folder / "given"
    given.mkdir()
    fault = '[[faults]]\nkind = "offset"\nsignal = "pitch_rate"\nchannels = [1]\nstart_s = 0.5\noffset = 0.1\n'
    (given / "base.toml").write_text(f'duration_s = 1.5\nredundancy.manager = "mean"\n{fault}')
    vary = '[vary]\n"faults.0.offset" = { low = 0.05, high = 1.0, log = true }\n'
    (given / "space.toml").write_text(f'base = "base.toml"\nsampling = "random"\nruns = 1\n{vary}')
    (given / "suite.toml").write_text('requirements = ["redundancy"]\n[[cases]]\nscenario = "base.toml"\n')


async def every_tool(client: Any) -> dict[str, Any]:
    """Call every tool once."""
    told: dict[str, Any] = {"listed": [each.name for each in (await client.list_tools()).tools], "steps": []}

    async def heard(value: float, total: float | None, step: str | None) -> None:
        told["steps"].append((value, step))

    async def call(name: str, **arguments: Any) -> Any:
        result = await client.call_tool(name, arguments, progress_callback=heard)
        assert not result.is_error, result.content
        assert json.loads(result.content[0].text) == result.structured_content
        told[name] = result.structured_content
        return told[name]

    await call("scenarios")
    log = (await call("fly", scenario="f16_pitch_rate_hardover", overrides=SHORT))["log"]
    await call("explain", log=log)
    await call("score", log=log)
    await call("vote", recording=log)
    await call("diagnose", recording=log)
    await call("check", suite="suite.toml")
    await call("search", campaign="space.toml", requirement=["vote"], flights=10, out="found", method="random")
    await call("campaign_status", folder="found")
    return told


@pytest.mark.long
def test_each_tool_answers_as_its_command(tmp_path: Path, rig_command: Command):
    put_files(tmp_path)
    told = asked(tmp_path, every_tool, "--read", str(tmp_path / "given"))
    assert sorted(told["listed"]) == sorted(told.keys() - {"listed", "steps"})

    def command(*words: object) -> dict[str, Any]:
        _, out, _ = rig_command(*words, "--json")
        return json.loads(out)

    def alike(one: dict[str, Any], other: dict[str, Any], *times: str) -> bool:
        return {**one, **dict.fromkeys(times)} == {**other, **dict.fromkeys(times)}

    log, sets = told["fly"]["log"], [word for key, value in SHORT.items() for word in ("--set", f"{key}={value}")]
    assert Path(log).parent == tmp_path / "agent"
    flown = command("fly", "f16_pitch_rate_hardover", *sets, "--out", "other")
    assert alike(told["fly"], flown, "log", "timing", "next")
    assert told["explain"]["summary"] in flown["conclusion"][0] and told["explain"]["digest"] == flown["digest"]
    assert told["scenarios"] == command("scenario", "list")
    assert told["score"] == command("score", log)
    voted = command("vote", log, "--out", "votes.csv")
    assert alike(told["vote"], voted, "out", "seconds")
    assert alike(told["diagnose"], command("diagnose", log), "seconds")
    assert (tmp_path / "agent" / "votes.csv").read_bytes() == (tmp_path / "votes.csv").read_bytes()
    assert told["check"]["tests"] == command("check", tmp_path / "given" / "suite.toml")["tests"]
    assert "violated" in {test["result"] for test in told["check"]["tests"]}  # exit code 1, and an answer
    assert told["campaign_status"] == command("campaign", "status", tmp_path / "agent" / "found")
    assert told["campaign_status"]["done"] == told["search"]["flights"] == 10
    values = [value for value, _ in told["steps"]]
    assert "flying: 300 of 300" in [step for _, step in told["steps"]] and len(values) > 8


BAD = (
    ("flight", {}, "'flight': no such tool; nearest: "),
    ("fly", {"scenario": "f16_pitch_rate_hardver"}, "no such file; nearest bundled: f16_pitch_rate_hardover"),
    ("fly", {"scenario": "f16_pitch_rate_hardover", "sed": 3}, "fly: sed: unknown key"),
    ("fly", {"scenario": "f16_pitch_rate_hardover", "overrides": {"duration_s": -1}}, "duration_s: must be above 0"),
    ("fly", {"scenario": "f16_pitch_rate_hardover", "overrides": {"duration_s": 601}}, "flies at most 60000"),
    ("fly", {"scenario": "f16_pitch_rate_hardover", "requirements": ["none"]}, "none: no such requirements file"),
    ("score", {"log": "none.mcap"}, "log: 'none.mcap': no such file in "),
    ("explain", {"log": "no_log.mcap"}, "no_log.mcap: "),
    ("vote", {"recording": "no_log.mcap", "out": "votes.txt"}, "votes.txt: must end in "),
    ("search", {"campaign": "none", "requirement": ["vote"], "flights": 9, "out": "s"}, "none: no such file; bundled"),
    ("check", {"suite": "none"}, "none: no such suite; bundled: bundled"),
    ("campaign_status", {"folder": "."}, "not a campaign's folder"),
)


@pytest.mark.long
def test_a_bad_call_gets_one_line_and_writes_nothing(tmp_path: Path):
    agent = tmp_path / "agent"
    agent.mkdir()
    (agent / "no_log.mcap").write_text("no log")

    async def ask(client: Any) -> list[Any]:
        return [await client.call_tool(name, arguments) for name, arguments, _ in BAD]

    for (_, _, line), result in zip(BAD, asked(tmp_path, ask), strict=True):
        (content,) = result.content
        assert result.is_error and result.structured_content is None
        assert line in content.text and "\n" not in content.text and len(content.text) <= LONGEST_LINE
    assert [path.name for path in agent.iterdir()] == ["no_log.mcap"]


@pytest.mark.long
def test_no_spelling_of_an_override_runs_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rig_command: Command):
    """The module can be imported by the server and by its calls: the command runs it, and leaves its mark."""
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "evil.py").write_text(CODE)
    mark = tmp_path / "lib" / "mark"
    paths = [str(tmp_path / "lib"), *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    monkeypatch.syspath_prepend(str(tmp_path / "lib"))
    rig_command("fly", "--set", "redundancy.manager=evil:X")
    assert mark.exists()
    mark.unlink()
    agent, base = tmp_path / "agent", "f16_pitch_rate_hardover"
    agent.mkdir()
    (agent / "named.toml").write_text('redundancy.manager = "evil:X"\nduration_s = 1.0\n')
    put_files(tmp_path)
    (agent / "config.toml").write_text('[signal.pitch_rate]\nthreshold = 0.1\nmanager = "evil:X"\n')
    columns = ",".join(["time_s", *(f"pitch_rate.{channel}" for channel in range(1, 5))])
    (agent / "r.csv").write_text("\n".join([columns, *(f"{k / 100},0,0,0,0" for k in range(20))]))
    search = {"campaign": "space.toml", "requirement": ["vote"], "flights": 10, "method": "random", "out": "s"}
    overrides: list[dict[str, Any]] = [
        {"redundancy.manager": "evil:X"},
        {"redundancy": {"manager": "evil:X"}},
        {" redundancy.manager ": "evil:X"},
        {'redundancy={manager="evil:X"} #': "1"},  # a key that is a whole override, and a remark
    ]
    spellings: list[tuple[str, dict[str, Any]]] = [
        *(("fly", {"scenario": base, "overrides": each}) for each in overrides),
        ("fly", {"scenario": "named.toml"}),
        ("vote", {"recording": "r.csv", "config": "config.toml"}),
        ("search", {**search, "overrides": overrides[0]}),
        ("search", {**search, "against": "redundancy={manager='evil:X'}"}),
        *(("fly", {"scenario": base, "overrides": {'redundancy."manager"': "evil:X"}}),),
        *(("fly", {"scenario": base, "overrides": {"Redundancy.Manager": "evil:X"}}),),
    ]

    async def ask(client: Any) -> list[Any]:
        return [await client.call_tool(name, arguments) for name, arguments in spellings]

    before = sorted(agent.rglob("*"))
    results = asked(tmp_path, ask, "--read", str(tmp_path / "given"))
    assert not mark.exists() and sorted(agent.rglob("*")) == before
    lines = [result.content[0].text for result in results]
    assert all(result.is_error for result in results)
    assert all("'evil:X' is code, and rig mcp runs no code" in line for line in lines[:-2]), lines
    assert all("unknown key" in line for line in lines[-2:]), lines


@pytest.mark.long
def test_files_outside_the_folders_are_neither_read_nor_written(tmp_path: Path):
    agent, secret = tmp_path / "agent", tmp_path / "secret"
    for folder in (agent, secret):
        folder.mkdir()
    (secret / "s.toml").write_text("duration_s = 1.0\nsecret = 1\n")
    (secret / "noise.csv").write_text("secret,0,0,0\n")
    (agent / "link.toml").symlink_to(secret / "s.toml")
    (agent / "away").symlink_to(secret)
    (agent / "nested.toml").write_text(f'sensors.pitch_rate.noise_file = "{secret / "noise.csv"}"\n')
    put_files(tmp_path)
    (secret / "empty").mkdir()
    search = {"campaign": "space.toml", "requirement": ["vote"], "flights": 10, "method": "random"}
    calls: list[tuple[str, dict[str, Any]]] = [
        ("fly", {"scenario": str(secret / "s.toml")}),
        ("fly", {"scenario": "../secret/s.toml"}),
        ("fly", {"scenario": "link.toml"}),
        ("fly", {"scenario": "away/s.toml"}),
        ("fly", {"scenario": "nested.toml"}),
        ("fly", {"scenario": "f16_pitch_rate_hardover", "requirements": [str(secret / "s.toml")]}),
        ("fly", {"scenario": "f16_pitch_rate_hardover", "overrides": {"requirements": [str(secret / "s.toml")]}}),
        ("check", {"suite": str(secret / "s.toml")}),
        ("vote", {"recording": "nested.toml", "out": "away/votes.csv"}),
        ("search", {**search, "out": "away/s"}),
    ]

    async def ask(client: Any) -> list[Any]:
        results = [await client.call_tool(name, arguments) for name, arguments in calls]
        found = await client.call_tool("search", {**search, "out": "found"})
        assert not found.is_error
        shutil.rmtree(agent / "found" / "confirmed")
        (agent / "found" / "confirmed").symlink_to(secret / "empty")
        return [*results, await client.call_tool("search", {**search, "out": "found"})]

    before = sorted(secret.rglob("*"))
    results = asked(tmp_path, ask, "--read", str(tmp_path / "given"))
    lines = [result.content[0].text for result in results]
    assert all(result.is_error for result in results), lines
    assert "found/confirmed/lock: is outside the folder that rig mcp may write" in lines[-1]
    assert "duration_s" not in "".join(lines)  # of what the files hold
    assert sorted(secret.rglob("*")) == before


@pytest.mark.long
def test_a_cancelled_flight_ends_and_the_server_goes_on(tmp_path: Path):
    long = {"scenario": "f16_pitch_rate_hardover", "overrides": {"duration_s": 600}}

    async def ask(client: Any) -> tuple[list[psutil.Process], Any, list[Any]]:
        flying, one = anyio.Event(), process(tmp_path)

        async def heard(value: float, total: float | None, step: str | None) -> None:
            if step and step.startswith("flying: "):
                flying.set()

        async with anyio.create_task_group() as tasks:
            tasks.start_soon(lambda: client.call_tool("fly", long, progress_callback=heard))
            await flying.wait()
            calls = one.children(recursive=True)
            listening = [each for call in (one, *calls) for each in call.net_connections()]
            tasks.cancel_scope.cancel()
        while one.children(recursive=True):
            await anyio.sleep(0.05)
        assert one.is_running()
        return calls, await client.call_tool("scenarios", {}), listening

    calls, after, listening = asked(tmp_path, ask)
    assert calls and not any(call.is_running() for call in calls)
    assert listening == []  # no network socket while a flight is under way
    assert not after.is_error
    (path,) = (tmp_path / "agent").iterdir()
    log = read_log(path)
    assert log.result is not None and log.result["end_reason"] == "interrupted" and len(log.rows) < 60_000


@pytest.mark.long
def test_a_call_that_takes_too_long_is_stopped(tmp_path: Path):
    """The limit is over before the process has imported the rig, or while it flies: never 60,000 frames."""
    long = {"scenario": "f16_pitch_rate_hardover", "overrides": {"duration_s": 600}}
    result = asked(tmp_path, lambda client: client.call_tool("fly", long), "--call-limit", "1")
    if result.is_error:
        assert result.content[0].text == "fly: stopped after 1 s, the limit of a call"
    else:
        assert result.structured_content["end_reason"] == "interrupted"


@pytest.mark.long
def test_standard_output_has_nothing_but_the_protocol(tmp_path: Path):
    """Also when JSBSim and the compiler print, and when a line is no message at all."""
    around = {**os.environ, "RIG_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "1", "JSBSIM_DEBUG": "1"}
    hello = {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "test", "version": "1"}}
    flight = {"name": "fly", "arguments": {"scenario": "f16_pitch_rate_hardover", "overrides": {"duration_s": 0.5}}}
    lines = [
        {"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": hello},
        {"jsonrpc": "2.0", "method": "notifications/initialized"},
        {"jsonrpc": "2.0", "id": 2, "method": "tools/call", "params": flight},
    ]
    words = [sys.executable, "-m", "rig", "mcp", "--out", str(tmp_path / "agent")]
    pipes: Any = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(words, env=around, cwd=tmp_path, text=True, **pipes) as served:
        assert served.stdin is not None and served.stdout is not None
        served.stdin.write("no message\n" + "".join(f"{json.dumps(line)}\n" for line in lines))
        served.stdin.flush()
        messages: list[dict[str, Any]] = []
        while not any(message.get("id") == 2 for message in messages):
            messages.append(json.loads(served.stdout.readline()))
        served.stdin.close()
        messages += [json.loads(line) for line in served.stdout]
    assert served.returncode == 0
    assert all(message["jsonrpc"] == "2.0" for message in messages)
    (answer,) = [message for message in messages if message.get("id") == 2]
    assert answer["result"]["structuredContent"]["frames"] == 50


@pytest.mark.long
@pytest.mark.parametrize("how", ["kill", "terminate"])
def test_no_call_is_left_when_the_server_is_gone(tmp_path: Path, how: str):
    long = {"scenario": "f16_pitch_rate_hardover", "overrides": {"duration_s": 600}}
    calls: list[psutil.Process] = []

    async def ask(client: Any) -> None:
        flying, one = anyio.Event(), process(tmp_path)

        async def heard(value: float, total: float | None, step: str | None) -> None:
            if step and step.startswith("flying: "):
                flying.set()

        async def fly() -> None:
            with pytest.raises(sdk().MCPError):  # the connection is closed
                await client.call_tool("fly", long, progress_callback=heard)

        async with anyio.create_task_group() as tasks:
            tasks.start_soon(fly)
            await flying.wait()
            calls.extend(one.children(recursive=True))
            getattr(one, how)()

    asked(tmp_path, ask)
    _, alive = psutil.wait_procs(calls, timeout=60)
    assert calls and alive == []
    (path,) = (tmp_path / "agent").iterdir()
    log = read_log(path)
    assert log.result is not None and log.result["end_reason"] == "interrupted"


def conversations() -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """The calls of the page, each with the keys of its answer that the page shows."""
    blocks = re.findall(r"^```json\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    told = [each for each in map(json.loads, blocks) if "mcpServers" not in each]
    return list(zip(told[::2], told[1::2], strict=True))


def shown(real: Any, page: Any) -> Any:
    """What a page would show of a real answer, if it showed the same keys."""
    if isinstance(page, dict) and isinstance(real, dict):
        return {key: shown(real.get(key), value) for key, value in page.items()}
    if isinstance(page, list) and isinstance(real, list) and len(real) == len(page):
        return [shown(one, other) for one, other in zip(real, page, strict=True)]
    return real


def test_the_page_has_three_conversations_of_tools_that_are_there():
    assert len(re.findall(r"^### .*\?$", PAGE.read_text(), re.MULTILINE)) == 3
    for call, answer in conversations():
        assert set(call) == {"tool", "arguments"} and "tool" not in answer
        assert tool(call["tool"]).arguments.model_fields.keys() >= call["arguments"].keys()


@pytest.mark.long
def test_the_answers_on_the_page_are_those_of_the_server(tmp_path: Path):
    given = tmp_path / "given"
    given.mkdir()
    for name in ("channels.csv", "vote.toml", "faults.toml"):
        shutil.copy(ROOT / "docs" / "examples" / name, given)

    async def ask(client: Any) -> list[Any]:
        return [await client.call_tool(call["tool"], call["arguments"]) for call, _ in conversations()]

    results = asked(tmp_path, ask, "--read", str(given))
    for (call, page), result in zip(conversations(), results, strict=True):
        real = {"error": result.content[0].text} if result.is_error else result.structured_content
        real = json.loads(json.dumps(real).replace(str(tmp_path / "agent"), "/home/ada/agent"))
        assert shown(real, page) == page, call
    quoted = re.findall(r"`(pitch rate, channel 4: .*?)`", PAGE.read_text())
    assert quoted and all(line in results[-2].structured_content["conclusion"] for line in quoted)


def test_folders_that_cannot_be_used_are_refused_before_it_serves(tmp_path: Path, rig_command: Command):
    (tmp_path / "file").write_text("")
    for words, line in (
        (("--read", "none"), "none: no such folder"),
        (("--out", "file"), "error: --out file: "),
        (("--out", "file/agent"), "error: --out file/agent: "),
        (("--call-limit", "0"), "--call-limit: "),
    ):
        code, out, err = rig_command("mcp", *words)
        assert (code, out) == (2, "") and line in err and err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.long
def test_a_bundled_scenario_can_be_listed_and_the_folder_is_made(tmp_path: Path):
    told = asked(tmp_path, lambda client: client.call_tool("scenarios", {}))
    assert told.structured_content["f16_pitch_rate_hardover"] == "F-16 pitch-rate hardover"
    assert list((tmp_path / "agent").iterdir()) == []
    shutil.rmtree(tmp_path / "agent")
