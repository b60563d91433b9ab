"""A library behind a UDP socket that goes wrong by a plan: python udp.py LIBRARY RIG PLAN.

PLAN is a list in JSON: [kind, first frame, last frame, ...].  Kinds: lost-request, lost-reply, late-request, late-reply
(after those of the next frame that is not), delay (seconds last), double, stale, short, long, foreign, layout, magic,
crc, die (once: last a file that is made then).
"""

import ctypes
import json
import socket
import struct
import sys
import time
import zlib
from pathlib import Path
from typing import Any

HEAD = struct.Struct("<IHHQQqd")
SIZES = json.loads(sys.argv[4])  # input, law_input, output, config, part, ready, layout, version
PLAN = json.loads(sys.argv[3])


class Unit:
    def __init__(self) -> None:
        self.library = ctypes.CDLL(sys.argv[1])
        self.config = bytearray(SIZES["config"] + 1024)
        self.stepped, self.last = 0, b""

    def ready(self, asked: bytes, kind: int) -> bytes:
        _, version, _, layout, session, frame, time_s = HEAD.unpack_from(asked)
        layout ^= any(entry[0] == "built for another layout" for entry in PLAN)
        head = HEAD.pack(0x4F474952, version, kind, layout, session, frame, time_s)
        return head + b"planned".ljust(SIZES["ready"] - 48, b"\0") + struct.pack("<II", SIZES["ready"] - 8, 0)

    def configure(self, message: bytes) -> bool:
        part, parts = struct.unpack_from("<II", message, 40)
        self.config[part * 1024 : part * 1024 + 1024] = message[48 : 48 + 1024]
        if part + 1 == parts:
            self.library.rig_unit_close()
            held = (ctypes.c_char * len(self.config)).from_buffer(self.config)
            assert self.library.rig_unit_open(ctypes.byref(held)) == 0
            self.stepped = 0
        return part + 1 == parts

    def step(self, message: bytes) -> bytes:
        output = bytearray(SIZES["output"])
        output[:40] = HEAD.pack(0x4F474952, *HEAD.unpack_from(message)[1:2], 7, *HEAD.unpack_from(message)[3:])
        asked = ctypes.create_string_buffer(message, len(message))
        held = (ctypes.c_char * len(output)).from_buffer(output)
        law = len(message) == SIZES["law_input"]  # of a control law
        assert (self.library.rig_unit_law if law else self.library.rig_unit_step)(asked, held) == 0
        self.stepped += 1
        output[40:48] = self.stepped.to_bytes(8, "little")
        output[-8:] = struct.pack("<II", len(output) - 8, 0)
        return bytes(output)


def planned(frame: int) -> tuple[str, Any]:
    for kind, first, last, *rest in PLAN:
        if first <= frame <= last:
            return kind, rest[0] if rest else 0.0
    return "", 0.0


def answers(kind: str, more: Any, reply: bytes, last: bytes) -> list[bytes]:
    """What goes out in the place of ``reply``."""
    wrong = bytearray(reply)
    if kind == "die":
        once = Path(more)
        if not once.exists():
            once.touch()
            raise SystemExit(4)
    if kind == "delay":
        time.sleep(more)
    if kind == "foreign":
        wrong[16] ^= 1
    elif kind == "layout":
        wrong[8] ^= 1
    elif kind == "magic":
        wrong[0] ^= 1
    elif kind == "crc":
        wrong[-4:] = struct.pack("<I", zlib.crc32(reply[:-8]) ^ 1)
    instead = {
        "lost-reply": [],
        "double": [reply, reply],
        "stale": [last],
        "short": [reply[:-9]],
        "long": [reply + b"\0" * 16],
        **{key: [bytes(wrong)] for key in ("foreign", "layout", "magic", "crc")},
    }
    return instead.get(kind, [reply])


def main() -> None:
    talk = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    host, port = sys.argv[2].split(":")
    talk.connect((host, int(port)))
    unit, asked, said = Unit(), list[bytes](), list[bytes]()  # the latter: requests and replies that are overtaken
    layout = SIZES["layout"]
    talk.send(unit.ready(HEAD.pack(0, SIZES["version"], 0, layout, 0, 0, 0.0), 5))
    while True:
        try:
            message = talk.recv(4096)
        except ConnectionRefusedError:
            return
        kind = message[6]
        if kind == 1:
            old = any(entry[0] == "old start" for entry in PLAN)  # READY of the session to both
            talk.send(unit.ready(message if old else HEAD.pack(*HEAD.unpack_from(message)[:4], 0, 0, 0.0), 5))
        elif kind == 2 and unit.configure(message):
            talk.send(unit.ready(message, 5))
        elif kind == 3:
            frame = HEAD.unpack_from(message)[5]
            what, more = planned(frame)
            if what in ("lost-request", "late-request"):
                asked += [message] if what == "late-request" else []
                continue
            reply = unit.step(message)
            if what == "late-reply":
                said.append(reply)
                continue
            for one in [*answers(what, more, reply, unit.last), *reversed(said), *map(unit.step, asked)]:
                talk.send(one)
            unit.last, asked, said = reply, [], []


main()
