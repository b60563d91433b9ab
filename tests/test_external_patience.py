"""How long rig and unit look for a message before they sleep: nobody where cores are wanted by others."""

import pytest

from rig.computer.external import way
from rig.computer.external.host import LOOKS
from rig.computer.external.processes import Started


def test_nobody_looks_in_a_campaign_or_without_a_second_core(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(way, "cores", lambda: 2)
    assert way.patience(crowded=True) == (0, 0)
    alone = way.patience(crowded=False)
    assert alone.spin_ns > 0 and alone.looks > 0
    monkeypatch.setattr(way, "cores", lambda: 1)
    assert way.patience(crowded=False) == (0, 0)


@pytest.mark.parametrize("looks", [0, 7])
def test_what_the_rig_starts_is_told_how_often_to_look(looks: int):
    process = Started("exec", ["env"], looks=looks)
    assert process.how_it_ended(20.0) == "exited with status 0"
    assert f"{LOOKS}={looks}" in process.printed().splitlines()
    process.stop()
    process.forget()
