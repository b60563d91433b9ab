"""The oracle's slow-fault tests: three means of each residual, and halves of the channels against the reference."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import exp, inf, sqrt
from statistics import median
from typing import ClassVar

from oracle_answers import Settings, View
from oracle_slow_noise import SecondDifferences

WAYS = [({0, 1}, {2, 3}), ({0, 2}, {1, 3}), ({0, 3}, {1, 2})]


def cut(x: float, most: float) -> float:
    """``x``, no further from zero than ``most``."""
    return max(-most, min(most, x))


def less(x: float, by: float) -> float:
    """``x``, nearer to zero by an allowance."""
    return x - cut(x, by)


@dataclass
class Mean:
    """A mean over a number of frames that forgets."""

    value: float = 0.0

    def move(self, x: float, frames: float) -> float:
        self.value += (x - self.value) / frames
        return self.value


@dataclass
class SlowTests:
    """Memory of one signal; channels are keys."""

    s: Settings
    rules: set[str] = field(default_factory=set)
    repeats: dict[int, int] = field(default_factory=dict)  # of each sample, of the oracle's slow-fault rules
    standing: ClassVar[int] = 14  # repeats of a channel that stands still
    reference_from: ClassVar[int] = 300  # frames that are known of it
    beyond: ClassVar[float] = 0.5  # of a healthy half, the slope
    whole_of: ClassVar[float] = 2.0  # of a step of squares: what counts in the noise

    def __post_init__(self) -> None:
        self.forget()
        self.begun = True  # the first time is no other time

    def forget(self) -> None:
        """Everything starts again."""
        self.k, self.reference_k, self.level = 0, 0, 0
        self.weights, self.next_limits = 0.0, 0.0
        self.bias = dict.fromkeys(range(4), 0.0)
        self.noise, self.usual, self.change, self.halves_noise = Mean(), Mean(), Mean(), Mean()
        self.v, self.last, self.reference_bias, self.run, self.begun = 0.0, 0.0, 0.0, 0, False
        self.vote, self.reference_vote = Mean(), 0.0
        self.usual_change, self.reference_change, self.away = 0.0, 0.0, 0
        self.second = SecondDifferences(self.s)

    def begin(self, n: int) -> None:
        """Another number of channels."""
        self.level, self.run, self.shaken = n, 0, 0.0
        self.second.begin()
        self.fast, self.slow = ({c: Mean() for c in range(4)} for _ in range(2))
        self.squares, self.whole = ({c: Mean(self.noise.value) for c in range(4)} for _ in range(2))
        twice = 2.0 if n == 2 else 1.0
        self.d, self.d_rho = [Mean() for _ in WAYS], [Mean() for _ in WAYS]
        noise = twice * self.halves_noise.value
        self.d_squares, self.d_whole, self.d_energy = ([Mean(noise) for _ in WAYS] for _ in range(3))
        self.halves_shaken = 0.0

    def limit(self, frames: float, factor: float) -> float:
        return 6.0 * factor * sqrt(0.5 / frames + 1.0 / self.known)

    @property
    def squares_limit(self) -> float:
        return 6.0 * self.s.slow_squares * sqrt(1.0 / 128.0 + 2.0 / self.known)

    def isolated(self, view: View, trusted: bool, whole: bool) -> set[int]:
        """The channels that a test isolates; then the frame is learned, or not."""
        n = len(view.use)
        if not self.s.slow_means:
            return set()
        if n < 2 or not whole:
            return self.stop("a channel is missing")
        if not self.begun:
            self.begun = True
            self.rules.add("test: learned again after a reset")
        y = {c: x - self.bias[c] for c, x in view.use.items()}
        m = median(y.values())
        if self.cut(m):
            return self.stop("near an end of the range")
        if not self.k:
            self.usual.value = self.last = m
        self.vote.move(cut(self.s.change(median(view.use.values()), m), self.s.within(n)), 100)
        if n != self.level:
            self.begin(n)
        if self.weights >= self.next_limits:
            self.known = min(max(self.weights, 1.0), 2000.0)
            self.next_limits = 1.1 * self.known if self.known < 2000.0 else inf
        sigma = sqrt(max(self.noise.value, self.shaken, self.s.slow_noise**2))
        a = self.allowance(m, sigma, self.unmoved(view), n)
        self.second.straight = self.second.straight if self.k else -1
        shares = self.shares({c: x - m for c, x in y.items()}, a, sigma) if self.k else dict.fromkeys(y, 0.0)
        rho = None if view.reference is None else self.s.change(view.reference - self.reference_bias, m)
        half_share, way, alike = self.halves(y, rho, a) if self.k and n != 3 else (0.0, 0, False)
        found = self.half(way, half_share if alike else 0.0, rho, trusted, set(y))
        self.by = "slow_halves"
        noisy = self.second.watch(self.moved, y, self.k, self.healthy(n)) if self.k else set[int]()
        if noisy and not found:
            self.rules.add("test: the noisy of two")
            self.by, found = "slow_squares", noisy
        stopped = (alike and half_share * self.s.slow_halves > 0.5) or ":" in view.pattern or n < 3
        if not found and not stopped:
            found = self.one(shares)
        if not found and view.pattern == "normal" and max(*shares.values(), half_share) < 0.5:
            self.learn(y, m, self.to_learn(rho, trusted), sigma, a)
        return found

    def stop(self, why: str) -> set[int]:
        """No test runs in this frame, and the next change of the middle is that of several frames."""
        self.rules.add(f"test: {why}")
        self.away += 1
        return set()

    def at_end(self, view: View) -> bool:
        """Whether the tests are on, and the middle is so near an end of the range."""
        middle = median([x - self.bias[c] for c, x in view.use.items()] or [0.0])
        return bool(self.s.slow_means) and self.cut(middle)

    def cut(self, m: float) -> bool:
        """Whether a healthy sample may be cut off at an end of the range, as near as the middle is to it."""
        margin = 2.0 * self.s.slow_bias + self.s.slow_scale * abs(m) + 8.0 * self.s.slow_noise
        return not self.s.turn and not self.s.low + margin <= m <= self.s.high - margin

    def unmoved(self, view: View) -> bool:
        """Whether the middle of more than two is not that of a majority."""
        n = len(view.use)
        in_the_middle = {view.ascending[(n - 1) // 2], view.ascending[n // 2]}
        if n > 2 and ":" not in view.pattern and in_the_middle & view.lonely:
            self.rules.add("test: a median off the majority")
            return True
        return n > 2 and ":" in view.pattern

    def allowance(self, m: float, sigma: float, odd: bool, n: int) -> float:
        """What motion alone may do to a residual; odd : the middle is not that of a majority."""
        self.moved, self.last = self.s.change(m, self.last) / (self.away + 1), m
        self.second.straight = 0 if odd else self.second.straight + 1
        if self.second.straight:
            self.v = max(abs(self.change.move(self.moved, 16)), 0.99 * self.v)
        if self.second.straight and n > 2:
            self.v = max(self.v, abs(self.moved) - 3.0 * sigma)
        if self.away:
            self.away, self.second.straight = 0, 0
        scale = 2.0 * self.s.slow_scale * abs(self.s.change(m, self.usual.value))
        return scale + self.s.slow_skew * self.unlike(self.usual_change)

    def unlike(self, learned_at: float) -> float:
        """How far the motion may be from what it was while something was learned."""
        if abs(self.change.value - learned_at) > self.v:
            self.rules.add("test: straight on after a turn")
        return max(self.v, abs(self.change.value - learned_at))

    def shares(self, residuals: dict[int, float], a: float, sigma: float) -> dict[int, float]:
        """The largest of the three, each as a share of its limit; the noise follows."""
        shares: dict[int, float] = {}
        self.of_means: dict[int, float] = {}
        square_limit = self.squares_limit
        at_once, healthy = 1.0 + square_limit / (1.0 - exp(-20.0 / 128.0)), self.beside_median(sigma**2)
        for c, whole in residuals.items():
            self.whole[c].move(min(whole**2, self.whole_of * at_once * sigma**2), min(self.k, 128))
            r = less(whole, a)
            of: list[float] = []
            for mean, frames, burst in ((self.fast[c], 16.0, 14.0), (self.slow[c], 100.0, 20.0)):
                limit = self.limit(frames, self.s.slow_means)
                of.append(abs(mean.move(cut(r / sigma, limit / (1.0 - exp(-burst / frames))), frames)) / limit)
            square = self.squares[c].move(min(r * r, at_once * healthy), min(self.k, 128))
            of = of if self.k >= 200 else [0.0]
            self.of_means[c] = max(of)
            shares[c] = max([*of, *([(square / healthy - 1.0) / square_limit] if self.k >= 500 else [])])
        ranked = sorted(self.whole[c].value for c in residuals)
        self.shaken = ranked[1] if len(ranked) > 2 else ranked[0]
        self.noise.move(self.shaken, min(self.k, 1000))
        return shares

    def one(self, shares: dict[int, float]) -> set[int]:
        """The channel with the largest share, if it is alone."""
        worst = max(shares, key=lambda c: shares[c])
        if shares[worst] <= 1.0:
            return set()
        still = {c for c in shares if self.repeats.get(c, 0) >= self.standing}
        if len(shares) == 4 and len(still - {worst}) == 2 and worst not in still:
            self.rules.add("test: beside two that stand still")
            return set()
        by_means = shares[worst] == self.of_means[worst]
        calm = sum(share < 0.5 * shares[worst] for share in shares.values())
        alone = self.alone(calm, len(shares))
        self.by = "slow_means" if by_means else "slow_squares"
        self.rules.add(f"test: one by {self.by}" if alone else "test: not alone")
        return {worst} if alone else set()

    def alone(self, calm: int, n: int) -> bool:
        """Whether enough of ``n`` channels are calm."""
        return calm > n / 2 or (n == 4 and calm == 2)

    def beside_median(self, variance: float) -> float:
        """What a healthy residual's noise may be: the data sheet's, which the median follows, where all have less."""
        least = (2.0 * self.s.slow_noise) ** 2 - variance / 4.0
        if least > variance:
            self.rules.add("test: noise of the data sheet")
        return max(variance, least)

    def healthy(self, n: int) -> float:
        """Variance of D of healthy channels: the data sheet's where four have never shown it."""
        shown = self.halves_noise.value
        if n < 4 and not shown:
            self.rules.add("test: halves of which four were never in use")
            return 4.0 * self.s.slow_noise**2
        return max(shown, self.s.slow_noise**2)

    @property
    def error(self) -> float:
        """The healthy error of the reference."""
        moved = abs(self.vote.value - self.reference_vote)
        return self.s.slow_reference + self.s.slow_reference_frames * self.unlike(self.reference_change) + moved

    def halves(self, y: dict[int, float], rho: float | None, a: float) -> tuple[float, int, bool]:
        """Share of the way with the largest mean square, that way, and whether it is suspected."""
        four = len(y) == 4
        ways = WAYS if four else [({min(y)}, {max(y)})]
        healthy = max(self.healthy(len(y)), self.halves_shaken) * (1.0 if four else 2.0)
        limit = self.limit(100.0, self.s.slow_halves) * sqrt(healthy)
        square_limit = 1.2 * self.squares_limit / self.s.slow_squares * self.s.slow_halves
        at_once = 1.0 - exp(-14.0 / 100.0)
        step, energy_step = limit / at_once, healthy * (1.0 + square_limit / at_once)
        most = max(step, 2.8 * self.error)
        for i, (first, second) in enumerate(ways):
            d = sum(y[c] for c in first) / len(first) - sum(y[c] for c in second) / len(second)
            d = cut(d, most)
            self.d_whole[i].move(min(d * d, energy_step), min(self.k, 100))
            d = less(d, a * (1.5 if four else 2.0))
            self.d[i].move(cut(d, step), 100)
            self.d_squares[i].move(d * d, min(self.k, 100))
            self.d_energy[i].move(min(d * d, energy_step), min(self.k, 100))
            if rho is not None:
                self.d_rho[i].move(cut(rho, most) * d, 100)
        squares = [self.d_squares[i].value for i in range(len(ways))]
        if four:
            self.halves_shaken = min(self.d_whole[i].value for i in range(3))
            self.halves_noise.move(self.halves_shaken, min(self.k, 1000))
        if self.k < 200:
            return 0.0, 0, False
        way = max(range(len(ways)), key=lambda i: squares[i])
        alike = not four or sorted(squares)[1] < 0.35 * squares[way]
        by_square = (self.d_energy[way].value / healthy - 1.0) / square_limit
        return max(abs(self.d[way].value) / limit, by_square), way, alike

    def half(self, way: int, share: float, rho: float | None, trusted: bool, use: set[int]) -> set[int]:
        """The half that the slope decides against, in the tenth frame in a row."""
        said = 0
        if (
            share > 1.0
            and trusted
            and rho is not None
            and self.s.slow_reference
            and self.reference_k > self.reference_from
        ):
            slope = self.d_rho[way].value / self.d_squares[way].value
            d, e, steep = sqrt(self.d_squares[way].value), self.error, abs(slope)
            if steep > 0.1 and d * (steep + 0.5) >= e and d * (steep - self.beyond) <= e:
                said = 1 if slope > 0.0 else -1
            self.rules.add("test: a slope" if said else "test: no slope")
        self.run = self.run + said if said * self.run > 0 else said
        if abs(self.run) < 10:
            return set()
        self.rules.add(f"test: a half of {len(use)}")
        first = {min(use)} if len(use) == 2 else WAYS[way][0]
        return first if said < 0 else use - first

    def weight(self) -> float:
        """Of this frame: less in motion, when the skew moves residuals."""
        usual = max(self.noise.value, self.s.slow_noise**2)
        return usual / (usual + (self.s.slow_skew * self.change.value) ** 2)

    def step(self, sigma: float, a: float) -> float:
        """Up to which a residual is learned."""
        return self.limit(16.0, self.s.slow_means) / (1.0 - exp(-14.0 / 16.0)) * sigma + a

    def known_by(self, weight: float) -> float:
        """What a frame adds to what is known."""
        return weight

    def to_learn(self, rho: float | None, trusted: bool) -> float | None:
        """What a frame tells of the reference's bias: nothing while it is unusable, a threshold at most."""
        return None if rho is None or not trusted else cut(rho, self.s.reference_threshold)

    def learn(self, y: dict[int, float], m: float, rho: float | None, sigma: float, a: float) -> None:
        """Move what is learned."""
        most = self.step(sigma, a) if self.k else inf
        weight = self.weight()
        self.weights += self.known_by(weight)
        share = weight / min(self.weights, 1000.0)
        self.usual.value += share * self.s.change(m, self.usual.value)
        self.usual_change += share * (self.change.value - self.usual_change)
        bound = self.s.slow_bias + 1.6 * self.s.slow_scale * abs(self.usual.value)
        for c, x in y.items():
            self.bias[c] = cut(self.bias[c] + share * cut(x - m, most), bound)
        self.k += 1
        if rho is not None:
            gain, most = 1.0 / min(self.reference_k + 1, 1000), self.s.reference_threshold
            self.reference_bias = cut(self.reference_bias + gain * rho, most)
            self.reference_vote += gain * (self.vote.value - self.reference_vote)
            self.reference_change += gain * (self.change.value - self.reference_change)
            self.reference_k += 1
