"""How many trials a target needs, by hand."""

import pytest

from rig.studies.reliability.sample_size import needed


@pytest.mark.parametrize(
    ("target", "chances", "trials"),
    [
        (1e-7, (1.25e-5, 8.333e-3, 12.5), (239_659, 360, 0)),
        (1e-9, (1.25e-7, 8.333e-5, 0.125), (23_965_859, 35_949, 24)),
    ],
)
def test_half_of_the_budget_for_each_number_of_good_channels(target, chances, trials):
    found = needed(target, 1e-3)
    assert [one.good_before for one in found] == [4, 3, 2]
    assert [one.chance for one in found] == pytest.approx(chances, rel=1e-3)
    assert [one.trials for one in found] == list(trials)
    assert [one.open_loop for one in found] == [True, True, False]


def test_two_channels_have_one_fault_to_settle():
    [one] = needed(1e-6, 1e-3, channels=2)
    assert one.good_before == 2 and one.chance == pytest.approx(0.5e-6 / 2e-3)


def test_a_longer_flight_allows_less():
    [_, short, _], [_, long, _] = needed(1e-9, 1e-3), needed(1e-9, 1e-3, hours=10.0)
    assert long.chance == pytest.approx(short.chance / 10.0)
