"""The chain's solver against closed forms, published cases and an exponential of 120 digits."""

import random
from decimal import Decimal, localcontext
from itertools import pairwise
from math import expm1
from pathlib import Path

import numpy as np
import pytest
from reliability_cases import CHAINS, Case, binomial, chain_of, channels_fail, k_of_n

from rig.core.progress import listening
from rig.studies.reliability import chain
from rig.studies.reliability.chain import probabilities, solve_file


@pytest.mark.parametrize("case", CHAINS, ids=lambda case: case.name)
def test_what_is_known_comes_out(case: Case):
    if case.needs is not None and not case.needs.is_file():
        pytest.skip("needs the published chains")
    assert case.difference <= case.within


@pytest.mark.parametrize(("needed", "n", "hours"), [(1, 1, 1.0), (1, 4, 1.0), (2, 3, 1.0), (2, 4, 10.0)])
def test_k_of_n_channels_are_left_as_the_binomial_says(needed: int, n: int, hours: float):
    assert k_of_n(needed, n, hours) == pytest.approx(binomial(needed, n, hours), rel=1e-13)


def exponential(rates: np.ndarray, start: int, hours: float) -> list[float]:
    """exp(Q hours) by scaling and squaring with 150 digits."""
    n = len(rates)
    with localcontext() as context:
        context.prec = 150
        q = [[Decimal(float(x)) * Decimal(hours) for x in row] for row in rates]
        for i in range(n):
            q[i][i] = -sum((q[i][j] for j in range(n) if j != i), Decimal(0))
        most, halvings = max(-q[i][i] for i in range(n)), 0
        while most > Decimal("0.01"):
            most, halvings = most / 2, halvings + 1
        scaled = [[x / 2**halvings for x in row] for row in q]
        identity = [[Decimal(i == j) for j in range(n)] for i in range(n)]
        found = term = identity
        for k in range(1, 50):
            term = [[x / k for x in row] for row in product(term, scaled)]
            found = [[a + b for a, b in zip(one, other, strict=True)] for one, other in zip(found, term, strict=True)]
        for _ in range(halvings):
            found = product(found, found)
        return [float(x) for x in found[start]]


def product(a: list[list[Decimal]], b: list[list[Decimal]]) -> list[list[Decimal]]:
    columns = list(zip(*b, strict=True))
    return [[sum((x * y for x, y in zip(row, column, strict=True)), Decimal(0)) for column in columns] for row in a]


@pytest.mark.parametrize("seed", range(12))
def test_every_digit_holds_whatever_the_spread_of_the_rates(seed: int):
    draw = random.Random(seed)
    n = draw.randint(3, 6)
    rates = {
        (a, b): 10 ** draw.uniform(-9, 9) for a in range(n) for b in range(n + 1) if a != b and draw.random() < 0.5
    }
    rates |= {(a, a + 1): 10 ** draw.uniform(-9, 2) for a in range(n)}
    given, hours = chain_of(rates), 10 ** draw.uniform(-3, 3)
    found, expected = probabilities(given, 0, hours), exponential(given, 0, hours)
    for mine, theirs in zip(found, expected, strict=True):
        assert mine == pytest.approx(theirs, rel=1e-11, abs=1e-60)


def test_a_long_row_of_rare_steps_keeps_its_digits():
    rate, steps, hours = 1e-3, 9, 1.0
    found = probabilities(chain_of({(k, k + 1): rate for k in range(steps)}), 0, hours)[-1]
    # The ninth event of a Poisson process: the tail of its series, all terms positive.
    mean, term, tail = rate * hours, 1.0, 0.0
    for k in range(1, 40):
        term *= mean / k
        tail += term if k >= steps else 0.0
    assert found == pytest.approx(tail * np.exp(-mean), rel=1e-12) and found < 1e-30


def test_the_order_of_the_states_does_not_matter():
    draw = random.Random(3)
    rates = {(a, b): 10 ** draw.uniform(-6, 6) for a in range(6) for b in range(6) if a != b}
    given, order = chain_of(rates), [3, 5, 0, 2, 1, 4]
    moved = given[np.ix_(order, order)]
    assert np.allclose(
        probabilities(moved, order.index(0), 2.0), probabilities(given, 0, 2.0)[order], rtol=1e-12, atol=0
    )


def test_time_adds_up():
    given = channels_fail(4, 0.3)
    halfway = probabilities(given, 0, 0.7)
    later = sum(p * probabilities(given, k, 0.5) for k, p in enumerate(halfway))
    assert np.allclose(later, probabilities(given, 0, 1.2), rtol=1e-13, atol=0)


@pytest.mark.parametrize("hours", [0.0, 1e-300])
def test_nothing_happens_in_no_time(hours: float):
    assert np.allclose(probabilities(channels_fail(3, 1.0), 1, hours), [0, 1, 0, 0])


def test_histories_drawn_one_by_one_agree():
    """Gillespie's algorithm, a million histories."""
    rng, n = np.random.default_rng(5), 1_000_000
    rates = chain_of({(0, 1): 2.0, (1, 0): 1.5, (1, 2): 0.7, (0, 2): 0.05, (2, 3): 3.0, (3, 1): 0.4})
    expected = probabilities(rates, 0, 1.0)
    state, left = np.zeros(n, int), np.ones(n)
    cumulative = np.cumsum(rates, axis=1)
    while (left > 0).any():
        leaving = cumulative[state, -1]
        left -= rng.exponential(1.0, n) / leaving
        chosen = (rng.random(n)[:, None] * leaving[:, None] > cumulative[state]).sum(axis=1)
        state = np.where(left > 0, chosen, state)
    seen = np.bincount(state, minlength=4) / n
    assert (np.abs(seen - expected) < 3 * np.sqrt(expected * (1 - expected) / n)).all()


GOOD = 'hours = 1.0\nstart = "a"\ntransitions = [{ from = "a", to = "b", per_hour = 1e-3 }]\n'


def test_the_command_prints_every_state(rig_command, tmp_path: Path):
    path = tmp_path / "chain.toml"
    path.write_text(GOOD)
    code, out, _ = rig_command("reliability", "chain", str(path))
    assert code == 0 and "b" in out and "9.995001666" in out
    assert out.splitlines()[-1].startswith("death states: 9.995001666")


def test_transitions_between_the_same_states_add_up(tmp_path: Path):
    path = tmp_path / "chain.toml"
    both = [{"from": "a", "to": "b", "per_hour": rate} for rate in (0.25, 0.5)]
    rows = ", ".join(f'{{ from = "{t["from"]}", to = "{t["to"]}", per_hour = {t["per_hour"]} }}' for t in both)
    path.write_text(f'hours = 1.0\nstart = "a"\ntransitions = [{rows}]\n')
    assert solve_file(path).probability["b"] == pytest.approx(-expm1(-0.75))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("1e-3", "-1e-3", "transitions.0.per_hour: must be 0 or more, got -0.001"),
        ("1e-3", "inf", "transitions.0.per_hour: must be a finite number, got inf"),
        ('start = "a"', 'start = "c"', "start: no state 'c', allowed: a, b"),
        ('to = "b"', 'to = "a"', "transitions.0: a transition must lead to another state; 'a' is given twice"),
        ("hours = 1.0", "hours = -1.0", "hours: must be 0 or more, got -1.0"),
        ("hours = 1.0", "", "hours: missing"),
        ("per_hour", "per_hours", "transitions.0.per_hour: missing"),
    ],
)
def test_bad_input_is_one_line(rig_command, tmp_path: Path, old: str, new: str, said: str):
    path = tmp_path / "chain.toml"
    path.write_text(GOOD.replace(old, new))
    code, out, err = rig_command("reliability", "chain", str(path))
    assert (code, out) == (2, "") and err.startswith(f"error: {path}: ") and len(err.splitlines()) == 1
    assert said in err


def test_states_are_in_the_order_of_the_file(tmp_path: Path):
    path = tmp_path / "chain.toml"
    names = ["z", "y", "x"]
    rows = ", ".join(f'{{ from = "{a}", to = "{b}", per_hour = 1.0 }}' for a, b in pairwise(names))
    path.write_text(f'hours = 1.0\nstart = "z"\ntransitions = [{rows}]\n')
    found = solve_file(path)
    assert list(found.probability) == names and found.death == ["x"]


@pytest.mark.parametrize("ways", [1, 5])
def test_rates_beyond_all_sums_are_refused_in_one_line(rig_command, ways: int):
    way = '{ from = "a", to = "b", per_hour = 1e308 }'
    Path("c.toml").write_text(f'hours = 1.0\nstart = "a"\ntransitions = [{", ".join([way] * ways)}]\n')
    code, said, error = rig_command("reliability", "chain", "c.toml")
    assert (code, said, error.count("\n")) == (2, "", 1) and "per_hour" in error and "1e+30" in error


def test_the_largest_rate_ends_in_the_death_state_at_once(rig_command):
    Path("c.toml").write_text('hours = 1e12\nstart = "a"\ntransitions = [{ from = "a", to = "b", per_hour = 1e30 }]\n')
    assert solve_file(Path("c.toml")).probability == {"a": 0.0, "b": 1.0}


def test_a_large_chain_tells_how_far_it_is(monkeypatch: pytest.MonkeyPatch):
    """A rate of 8 an hour, 16th parts of it in a step: seven doublings."""
    rates, told = np.zeros((4, 4)), list[tuple[str, int, int]]()
    rates[0, 1] = 8.0
    with listening(lambda *step: told.append(step)):
        probabilities(rates, 0, 1.0)
        assert told == []
        monkeypatch.setattr(chain, "LARGE", 4)
        probabilities(rates, 0, 1.0)
    assert told == [("doubling the time of the chain", done, 7) for done in range(7)]
