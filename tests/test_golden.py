"""Golden flights decide as they did; ``make golden`` renews them when a decision was meant to move."""

import golden_flights as golden
import pytest

KEPT = golden.kept()


@pytest.mark.parametrize("name", KEPT)
def test_a_golden_flight_decides_as_it_did(name):
    moved = golden.difference(KEPT[name]["decisions"], golden.decide(KEPT[name]))
    assert not moved, f"{name}: decisions moved (make golden renews all, when that was meant):\n{moved}"


def test_all_golden_flights_were_renewed_together():
    stamp = golden.together({name: flight["decisions"] for name, flight in KEPT.items()})
    assert {flight["together"] for flight in KEPT.values()} == {stamp} and len(KEPT) == 6


def test_a_moved_decision_is_shown_as_it_was_and_as_it_is():
    flight = {**KEPT["hardover"], "set": [*KEPT["hardover"]["set"], "redundancy.signals.pitch_rate.persistence=4"]}
    moved = golden.difference(KEPT["hardover"]["decisions"], golden.decide(flight))
    assert "-207 pitch_rate.3 state: suspect -> failed" in moved
    assert "+203 pitch_rate.3 state: suspect -> failed" in moved


def test_a_flight_that_hangs_on_the_noise_is_not_kept(tmp_path, monkeypatch):
    """A threshold amid the noise: other seeds decide otherwise, and nothing is written."""
    kept = tmp_path / "noisy.toml"
    kept.write_text(
        'scenario = "f16_pitch_rate_hardover"\n'
        'set = ["duration_s=1", "faults=[]", "redundancy.signals.pitch_rate.threshold=0.003"]\n'
    )
    before = kept.read_text()
    monkeypatch.setattr(golden, "FOLDER", tmp_path)
    with pytest.raises(SystemExit, match="hangs on the noise, seed 2 decides otherwise; nothing is renewed"):
        golden.renew()
    assert kept.read_text() == before
