"""The server of ``rig mcp``: it lists the tools, and runs each call in a separate process (mcp_call.py).

A call that is cancelled, or takes too long, ends as a command does at SIGTERM.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.metadata import version
from typing import Any, Final

import anyio
from anyio.abc import Process
from anyio.streams.buffered import BufferedByteReceiveStream
from mcp.server import Server, ServerRequestContext
from mcp.server.stdio import stdio_server
from mcp.types import (
    CallToolRequestParams,
    CallToolResult,
    ListToolsResult,
    PaginatedRequestParams,
    TextContent,
    ToolAnnotations,
)
from mcp.types import Tool as ListedTool

from rig.cli.mcp_tools import MOST_FLIGHTS, MOST_FRAMES, TOOLS, Places, tool
from rig.core.confined import environment
from rig.core.errors import BadInput
from rig.core.threads import cores

LARGEST: Final = 256 << 20  # bytes of an answer
GRACE_S: Final = 10.0  # for a call to end cleanly
_ROOT: Final = "/"  # calls run there: no file of a folder that the agent writes is read by chance
INSTRUCTIONS: Final = (
    "Test redundant flight control in simulation. Begin with the tool scenarios; fly one; explain its log. "
    "Files are written below {write} only; files below {read} are read. No Python code, and no unit under test, runs. "
    f"One flight has at most {MOST_FRAMES} frames (duration_s times rate_hz), one search or suite {MOST_FLIGHTS} "
    "flights, and one call takes at most {most_s:g} s."
)


def serve(places: Places, most_s: float) -> None:
    """Serve until standard input closes; most_s : duration of one call."""
    calls = _Calls(places, most_s)
    read = ", ".join(map(str, (places.write, *places.read)))
    server = Server(
        "rig",
        version=version("jsbsim-rig"),
        instructions=INSTRUCTIONS.format(write=places.write, read=read, most_s=most_s),
        on_list_tools=_listed,
        on_call_tool=calls.answer,
    )

    async def run() -> None:
        async with stdio_server() as (read, write):
            await server.run(read, write, server.create_initialization_options())

    anyio.run(run)


async def _listed(_: ServerRequestContext[Any], __: PaginatedRequestParams | None) -> ListToolsResult:
    return ListToolsResult(
        tools=[
            ListedTool(
                name=each.name,
                description=each.about,
                input_schema=each.schema,
                annotations=ToolAnnotations(
                    read_only_hint=not each.writes, destructive_hint=False, open_world_hint=False
                ),
            )
            for each in TOOLS
        ]
    )


class _Calls:
    """The calls of a server: as many at a time as there are cores."""

    def __init__(self, places: Places, most_s: float) -> None:
        self._places, self._most_s = places, most_s
        self._room = anyio.Semaphore(cores())
        confined = environment(places.write, places.read, MOST_FRAMES)
        self._environment = {**os.environ, **confined, "PYTHONSAFEPATH": "1"}  # no module of the present folder

    async def answer(self, context: ServerRequestContext[Any], asked: CallToolRequestParams) -> CallToolResult:
        """Run one tool; an error is one line."""
        try:
            command = tool(asked.name).command(asked.arguments or {}, self._places)
            async with self._room:
                told = await self._run(context, command)
        except BadInput as error:
            told = {"error": str(error)}
        if "error" in told:
            return CallToolResult(content=[TextContent(text=told["error"])], is_error=True)
        texts = [json.dumps(told["answer"]), *filter(None, [told.get("remark")])]
        return CallToolResult(content=[TextContent(text=text) for text in texts], structured_content=told["answer"])

    async def _run(self, context: ServerRequestContext[Any], command: list[str]) -> dict[str, Any]:
        """Return the last message of a call; end its process, also when the call is cancelled."""
        process = await anyio.open_process(
            [sys.executable, "-P", "-m", "rig.cli.mcp_call"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=None,
            cwd=_ROOT,
            env=self._environment,
        )
        told: dict[str, Any] = {}
        try:
            assert process.stdin is not None
            await process.stdin.send(f"{json.dumps(command)}\n".encode())
            assert process.stdout is not None
            lines = BufferedByteReceiveStream(process.stdout)
            with anyio.move_on_after(self._most_s):
                told = await _last(lines, context)
                return told or {"error": f"{command[0]}: ended without an answer, {await _reason(process)}"}
            process.terminate()
            with anyio.move_on_after(GRACE_S):  # a flight answers with the frames that it has flown
                told = await _last(lines, context)
            if "answer" in told:
                return told
            stopped = f"{command[0]}: stopped after {self._most_s:g} s, the limit of a call"
            return {"error": "; ".join(filter(None, [stopped, told.get("error")]))}
        finally:
            with anyio.CancelScope(shield=True):
                await _end(process, patient=bool(told))


async def _last(lines: BufferedByteReceiveStream, context: ServerRequestContext[Any]) -> dict[str, Any]:
    """Report the progress of a call; return its last message, {} if there is none."""
    reached = _Reached()
    try:
        while True:
            message = json.loads(await lines.receive_until(b"\n", LARGEST))
            if "progress" not in message:
                return message
            what, done, total = message["progress"]
            shown = f"{what}: {done} of {total}" if total else what
            await context.session.report_progress(reached.after(what, done, total), None, shown)
    except (anyio.EndOfStream, anyio.IncompleteRead):
        return {}


class _Reached:
    """Progress as one rising number: the number of steps begun, and the part of the present one that is done."""

    def __init__(self) -> None:
        self._what, self._steps, self._value = "", 0, 0.0

    def after(self, what: str, done: int, total: int) -> float:
        """Return the number for a part of a step."""
        share = min(done / total, 1.0) if total else 0.0
        if what != self._what:
            self._what, self._steps = what, int(self._value) + 1
        self._value = max(self._steps + share * 0.999, self._value + 1e-6)
        return self._value


async def _reason(process: Process) -> str:
    code = await process.wait()
    return f"exit code {code}" if code >= 0 else f"killed by signal {-code}"


async def _end(process: Process, *, patient: bool) -> None:
    """Return when a process is gone: by itself if ``patient``, by SIGTERM, or by SIGKILL if that takes too long."""
    ways = (*([lambda: None] if patient else []), process.terminate, process.kill)
    async with anyio.create_task_group() as tasks:
        tasks.start_soon(_drain, process)
        for way in ways:
            if process.returncode is None:
                way()
                with anyio.move_on_after(GRACE_S):
                    await process.wait()
        tasks.cancel_scope.cancel()
    await process.aclose()


async def _drain(process: Process) -> None:
    """Read output that no call waits for, so that the process can go on."""
    assert process.stdout is not None
    async for _ in process.stdout:
        pass
