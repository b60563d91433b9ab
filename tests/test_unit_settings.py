"""Unit files: what they may say, and one clear line for what they may not."""

from __future__ import annotations

from pathlib import Path

import pytest

from rig.core.errors import BadInput
from rig.unit.unit_file import read_unit

LIBRARY = 'name = "u"\npath = "u.so"\n'
NO_PROGRAM = "no program listens at 127.0.0.1:9 (port unreachable)"
ONLY_STARTED = "on_dead: the rig can restart only a unit that it has started"
LAW = 'name = "u"\ntransport = "python"\nrole = "control-law"\n'
UDP = 'name = "u"\ntransport = "udp"\n'
WRONG = {
    LIBRARY + 'on_miss = "wait"\n': "on_miss: must be 'hold', 'fault' or 'end'",
    LIBRARY + "deadline = 1.5\n": "deadline: must be at most 1, got 1.5",
    LIBRARY
    + "latency = 1\n": "latency: unknown key; nearest: latency_frames, isolate, lane; all keys: rig unit schema",
    'name = "u"\n': "path: missing; the transport library needs it",
    'path = "u.so"\n': "name: missing",
    'name = "u"\npath = "v.so"\n': "path: v.so: no such file",
    UDP: "transport udp: needs either command, which the rig starts, or address",
    UDP + 'address = "somewhere"\n': "address: must be host:port, got 'somewhere'",
    UDP + 'address = "127.0.0.1:70000"\n': "address: must be host:port, got '127.0.0.1:70000'",
    UDP
    + 'address = "192.168.1.5:5600"\n': "address: 192.168.1.5:5600 is not on this machine; remote = true permits it",
    UDP + 'address = "127.0.0.1:5600"\non_dead = "restart"\n': ONLY_STARTED,
    LIBRARY + 'isolate = false\non_dead = "restart"\n': ONLY_STARTED,
    'name = "u"\ntransport = "python"\n': "manager: missing; the transport python needs it",
    LAW: "law: missing; the transport python needs it",
    LAW + 'law = "a:B"\nmanager = "a:B"\n': "manager: not with the transport python and the role control-law",
    LIBRARY + 'role = "control-law"\nlaw = "a:B"\n': "law: not with the transport library and the role control-law",
    'name = "u"\ntransport = "python"\nmanager = "a:B"\nlaw = "a:B"\n': "law: not with the transport python and the",
    LAW + 'law = "a:B"\non_dead = "restart"\n': ONLY_STARTED,
    LIBRARY + 'role = "law"\n': "role: must be 'redundancy', 'flight-computer' or 'control-law', got 'law'",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_wrong_unit_file_is_one_line(tmp_path: Path, text: str):
    (tmp_path / "u.so").touch()
    path = tmp_path / "unit.toml"
    path.write_text(text)
    with pytest.raises(BadInput) as error:
        read_unit(path)
    assert str(error.value).startswith(f"{path}: ") and WRONG[text].lower() in str(error.value).lower()


def test_paths_begin_in_the_folder_of_the_unit_file(tmp_path: Path, monkeypatch):
    monkeypatch.chdir("/")
    (tmp_path / "u.so").write_bytes(b"abc")
    (tmp_path / "unit.toml").write_text(LIBRARY)
    unit = read_unit(tmp_path / "unit.toml")
    assert unit.file == tmp_path / "u.so"
    assert unit.sha256() == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"  # FIPS 180-2, B.1
    assert unit.about()["sha256"] == unit.sha256() and unit.about()["timeout_s"] == 2.0


def test_another_machine_may_be_permitted(tmp_path: Path):
    (tmp_path / "unit.toml").write_text(UDP + 'address = "192.168.1.5:5600"\nremote = true\n')
    assert read_unit(tmp_path / "unit.toml").host_and_port == ("192.168.1.5", 5600)


def test_an_address_may_be_in_use_by_no_program(tmp_path: Path, rig_command):
    """No program answers there: refused within the time that the file allows, nothing written."""
    (tmp_path / "unit.toml").write_text(UDP + 'address = "127.0.0.1:9"\nstart_s = 0.2\n')
    code, out, err = rig_command("fly", "--unit", "unit.toml", "--set", "duration_s=1")
    assert (code, out) == (
        2,
        "",
    ) and err == f"error: unit.toml: u did not send READY within start_s = 0.2 s: {NO_PROGRAM}\n"
    assert not (tmp_path / "logs").exists() or not list((tmp_path / "logs").iterdir())
