"""Other rules than those of the requirement, for a choice of flights: each once one, or a likely misreading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from typing import Any, ClassVar

from oracle import Frame
from oracle_answers import Settings, View
from oracle_boxes import ResettableOracle
from oracle_references import References
from oracle_slow_faults import SlowFaults
from oracle_slow_noise import SecondDifferences
from oracle_slow_tests import SlowTests
from oracle_split import Split
from oracle_trend import Trend


class Other(ResettableOracle):
    """One with another memory of splits, trends or slow faults."""

    splits: ClassVar[type[Split]] = Split
    trends: ClassVar[type[Trend]] = Trend
    repeated: ClassVar[type[SlowFaults]] = SlowFaults
    told: ClassVar[type[References]] = References
    tests: ClassVar[type[SlowTests]] = SlowTests

    def __post_init__(self) -> None:
        self.split, self.trend, self.slow_faults = self.splits(), self.trends(), self.repeated(self.s)
        self.slow_tests = self.tests(self.s, repeats=self.slow_faults.repeats)
        self.references = self.told(self.s)


class OtherTies(ResettableOracle):
    """Of equal samples the one of the larger channel is the smaller: nothing may hang on that."""

    def view(
        self, samples: list[float | None], ilm: Sequence[str], reference: float | None, lanes: Sequence[int]
    ) -> View:
        view = super().view(samples, ilm, reference, lanes)
        view.by_seen = sorted(view.seen, key=lambda c: (view.seen[c], view.use[c], -c))
        view.ascending = sorted(view.use, key=lambda c: (view.use[c], -c))
        return view


class BegunAtZero(ResettableOracle):
    """A frame without a sample begins the vote."""

    def step(self, samples: list[float | None], *given: Any) -> Frame:  # pyright: ignore[reportIncompatibleMethodOverride]  # hands all on
        frame = super().step(samples, *given)
        self.vote = frame.voted if self.vote is None else self.vote
        return frame


# References --------------------------------------------------------------------------------------------------


class _OfVote(References):
    voted = 0.0

    def off_ranks(self, view: View, reference: float) -> float:
        return self.s.apart(self.voted, reference)


class AgainstTheVote(Other):
    """The reference is compared with the vote."""

    told = _OfVote

    def decide(self, view: View, disputed_by: str) -> tuple[str, float, set[int]]:
        answer = super().decide(view, disputed_by)
        if isinstance(self.references, _OfVote):
            self.references.voted = answer[1]
        return answer


class _NoCut(References):
    def cuts(self, view: View) -> bool:
        return False


class NeverCut(Other):
    """A reference does not fail the pair that extremes have left."""

    told = _NoCut


class _NoSuspicion(References):
    def level_changed(self, left_by_extremes: bool = False) -> None:
        super().level_changed(False)


class Unsuspected(Other):
    """The pair that extremes have left is as any other."""

    told = _NoSuspicion


class StaysSuspected(ResettableOracle):
    """A readmission does not end the suspicion of a pair."""

    def command(self, channels: set[int]) -> None:
        kept = self.references.suspected, self.references.pair_off
        super().command(channels)
        self.references.suspected, self.references.pair_off = kept


class CutAgrees(ResettableOracle):
    """The pair of a frame that has cut it still agrees, against two references."""

    def refer(self, view: View, vote: float, second: float | None, decided_by: str, in_dispute: bool) -> str:
        out = set(self.failed)
        if not self.references.cuts(view):
            self.references.pair_off -= self.references.pair_off > 0  # it is asked again
            return super().refer(view, vote, second, decided_by, in_dispute)
        all_in_use = len(view.use) > 1 and set(view.use) == self.in_use and not self.readmitted
        lost = self.references.lost(view, vote, second, all_in_use, in_dispute)
        self.failed = set(range(self.s.channels)) if lost else out | set(view.use)
        return "common" if lost else "reference"


class EndsRuns(References):
    """A run of contradicting frames ends in a dispute, too."""

    def lost(self, view: View, vote: float, second: float | None, all_in_use: bool, in_dispute: bool) -> bool:
        self.contradicted = 0 if in_dispute else self.contradicted
        return super().lost(view, vote, second, all_in_use, in_dispute)


class FirstDisputes(References):
    """A second reference disputes nothing."""

    @property
    def in_dispute(self) -> bool:
        return self.s.tells != 0 and not self.trusted


class SecondDisputes(References):
    """A first reference disputes nothing."""

    @property
    def in_dispute(self) -> bool:
        return self.s.tells != 0 and self.second_off >= self.s.persistence


# Splits, trends, repeats, filter -----------------------------------------------------------------------------


class _AtOnce(Split):
    def settled(self, s: Settings) -> bool:
        return self.in_split and self.lasted >= s.split_persistence


class AtOnce(Other):
    """A pattern that has lasted is settled by the rule that answers then."""

    splits = _AtOnce


class _Young(Split):
    def hear(self, decided_by: str, wrong: set[int], s: Settings) -> None:
        super().hear(decided_by, wrong, replace(s, trend_frames=1))


class YoungTrend(Other):
    """The answer of a trend is as old as any other's."""

    splits = _Young


class _Moved(Split):
    def hold(self, view: View, vote: float | None) -> float:
        if vote is None:
            return super().hold(view, vote)
        return vote + (0.0 if self.lasted == 1 else sum(view.trend.rises) / 2)


class Moved(Other):
    """While no rule answers the vote moves as the voting ranks do, but in a pattern's first frame."""

    splits = _Moved


class _Again(Split):
    def hold(self, view: View, vote: float | None) -> float:
        self.ranked = frozenset()
        return super().hold(view, vote)


class SharedAgain(Other):
    """The shares of the vote are found in every frame."""

    splits = _Again


class _ByRank(Split):
    place, share = 0, 0.5

    def hold(self, view: View, vote: float | None) -> float:
        before = self.shares, self.ranked
        voted = super().hold(view, vote)
        if vote is None:
            return voted
        if (self.shares, self.ranked) != before:
            self.place, self.share = view.ascending.index(self.shares[0]), self.shares[2]
        low, high = view.x[self.place], view.x[self.place + 1]
        return low + self.share * (high - low)


class SharedByRank(Other):
    """The shares stay with the ranks, of any channels."""

    splits = _ByRank


class _Falling(Trend):
    def verdict(self, frames: int) -> str:
        self.still = [0, 0]
        return super().verdict(frames)


class FrozenFalls(Other):
    """A side that does not move does not rise: a trend."""

    trends = _Falling


class _Gaps(SlowFaults):
    def stale(self, samples: list[float | None], in_use: set[int], reference: float | None, trusted: bool) -> set[int]:
        for c in [c for c, x in enumerate(samples) if x is None and c in self.last]:
            del self.last[c]
        return super().stale(samples, in_use, reference, trusted)


class _AboutSamples(SlowFaults):
    def residuals(self, view: View, bias: dict[int, float]) -> dict[int, float]:
        about = replace(self.s, slow_means=0.0)
        kept, self.s = self.s, about
        found = super().residuals(view, bias)
        self.s = kept
        return found


class SumsAboutSamples(Other):
    """The sums beside the slow-fault tests are of the samples themselves."""

    repeated = _AboutSamples


class _AboutMedian(SlowFaults):
    def residuals(self, view: View, bias: dict[int, float]) -> dict[int, float]:
        return super().residuals(view, dict.fromkeys(bias, 0.0))


class SumsWithBiases(Other):
    """The sums beside the slow-fault tests are about the median, biases included."""

    repeated = _AboutMedian


class EndedByGaps(Other):
    """A frame without a sample ends a count of repeats."""

    repeated = _Gaps


class _Always(SlowFaults):
    frame = 0.0

    def stale(self, samples: list[float | None], in_use: set[int], reference: float | None, trusted: bool) -> set[int]:
        """As beside as many other channels, which are never the same."""
        self.frame, others = self.frame + 1.0, set(range(len(samples), 2 * len(samples)))
        more = [self.frame] * len(samples)
        return super().stale([*samples, *more], in_use | others, reference, trusted) - others


class OfAllAtRest(Other):
    """Repeats are counted where no channel moves, too."""

    repeated = _Always


class _NoReference(SlowFaults):
    def stale(self, samples: list[float | None], in_use: set[int], reference: float | None, trusted: bool) -> set[int]:
        self.last_reference = reference
        return super().stale(samples, in_use, reference, trusted)


class WithoutReference(Other):
    """Beside the only channel left nothing moves."""

    repeated = _NoReference


class AtTheStops(Other):
    """A sensor at its stop repeats its sample as any other."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.slow_faults.s = replace(self.s, low=-inf, high=inf)


class _AnyReference(Settings):
    def limited(self, x: float | None) -> float | None:
        return x


class BeyondTheStops(ResettableOracle):
    """A reference beyond the sensor's range is compared as it is."""

    def step(self, samples: list[float | None], *given: Any) -> Frame:
        self.s = _AnyReference(**vars(self.s))
        return super().step(samples, *given)


class LimitedSample(ResettableOracle):
    """A sample tells the filter three thresholds at most."""

    def smooth(self, key: str | int, x: float | None) -> float | None:
        last, s = self.memory.get(key), self.s
        if x is None or last is None or not s.filter_share:
            return super().smooth(key, x)
        step = min(max(s.change(x, last), -3.0 * s.threshold), 3.0 * s.threshold)
        self.memory[key] = s.near(last + s.filter_share * step, self.base)
        return self.memory[key]


class AgreesAtOnce(ResettableOracle):
    """A channel that is failed by the frame may agree with its vote."""

    def step(self, samples: list[float | None], *given: Any) -> Frame:
        agreed, out = list(self.agreed), set(self.failed)
        frame = super().step(samples, *given)
        voted = self.memory.get("vote", frame.voted)
        for c in self.failed - out:
            x = self.memory.get(c)
            near = x is not None and self.s.apart(x, voted) <= self.s.threshold
            self.agreed[c] = agreed[c] + 1 if near else 0
        return frame


class CountsBursts(ResettableOracle):
    """A miscompare behind a filter counts, whatever the sample itself is."""

    def off(self, c: int, view: View, vote: float) -> bool:
        return True


class EndsBursts(ResettableOracle):
    """What the filter still shows of a burst ends the count."""

    def count(self, view: View, vote: float) -> None:
        before = list(self.counts)
        super().count(view, vote)
        self.counts = [
            0.0 if now < was and c in view.lonely else now
            for c, (was, now) in enumerate(zip(before, self.counts, strict=True))
        ]


class _NeverClosed(Split):
    def name(self, pattern: str, closed: bool = False) -> None:
        super().name(pattern, False)


class NeverClosed(Other):
    """A split behind a filter goes on where its samples are together again."""

    splits = _NeverClosed


class _OnlySettles(Split):
    def name(self, pattern: str, closed: bool = False) -> None:
        super().name(pattern, False)
        self.closed = closed


class OnlySettles(Other):
    """A split behind a filter lasts on where its samples are together again, and is not settled."""

    splits = _OnlySettles


class FollowsStale(ResettableOracle):
    """The filter goes on over samples that repeat for too long."""

    shown: list[float | None] = []  # of the frame, replaced in each

    def without_stale(self, samples: list[float | None], reference: float | None) -> list[float | None]:
        self.shown = samples
        return super().without_stale(samples, reference)

    def smooth(self, key: str | int, x: float | None) -> float | None:
        if isinstance(key, str) or x is not None or self.shown[key] is None:
            return super().smooth(key, x)
        super().smooth(key, self.s.near(self.shown[key] or 0.0, self.base))
        return None


class _Kept(SlowTests):
    def __post_init__(self) -> None:
        super().forget()
        self.begun = True

    def forget(self) -> None:
        pass


class _LearnsUnusable(SlowTests):
    def to_learn(self, rho: float | None, trusted: bool) -> float | None:
        return super().to_learn(rho, True)


class LearnsUnusable(Other):
    """The bias of an unusable reference is learned."""

    tests = _LearnsUnusable


class _LearnsFarOff(SlowTests):
    def to_learn(self, rho: float | None, trusted: bool) -> float | None:
        return rho if trusted else None


class LearnsFarOff(Other):
    """A frame of the reference counts whatever it is off."""

    tests = _LearnsFarOff


class _MovedOffMajority(SlowTests):
    def unmoved(self, view: View) -> bool:
        return ":" in view.pattern and len(view.use) > 2


class MovedOffMajority(Other):
    """A median off the majority moves as the aircraft does."""

    tests = _MovedOffMajority


class _SecondOutOfSplits(SecondDifferences):
    since = 2


class _MovedOut(SlowTests):
    def forget(self) -> None:
        super().forget()
        self.second = _SecondOutOfSplits(self.s)


class MovedOutOfSplits(Other):
    """The change of the median after a split is in a second difference."""

    tests = _MovedOut


class _MovedByGaps(SlowTests):
    def stop(self, why: str) -> set[int]:
        super().stop(why)
        self.away = 0
        return set()


class MovedByGaps(Other):
    """The change of the median over a gap is that of a frame."""

    tests = _MovedByGaps


class _HalfOfTheNoise(SlowTests):
    def healthy(self, n: int) -> float:
        return max(self.halves_noise.value, self.s.slow_noise**2)


class HalfOfTheNoise(Other):
    """Where four channels were never in use the noise of halves is half of the data sheet's."""

    tests = _HalfOfTheNoise


class KeptAfterReset(Other):
    """What slow-fault tests have learned is kept where a channel is readmitted."""

    tests = _Kept


class _Evenly(SlowTests):
    def weight(self) -> float:
        return 1.0


class LearnsEvenly(Other):
    """A frame in motion is learned like any other."""

    tests = _Evenly


class _KnownByFrames(SlowTests):
    def known_by(self, weight: float) -> float:
        return 1.0


class KnownByFrames(Other):
    """A frame in motion adds as much to what is known as any other."""

    tests = _KnownByFrames


class _WeightsKept(SlowTests):
    weights = 0.0

    def forget(self) -> None:
        weights = self.weights
        super().forget()
        self.weights = weights


class WeightsKeptAfterReset(Other):
    """What is known is kept where a channel is readmitted, the biases are not."""

    tests = _WeightsKept


class _SlowKept(SlowTests):
    def begin(self, n: int) -> None:
        slow = self.slow if self.level else None
        super().begin(n)
        self.slow = slow or self.slow


class SlowKeptAtALevel(Other):
    """The slow means go on where a channel leaves."""

    tests = _SlowKept


class _NotAlone(SlowTests):
    def alone(self, calm: int, n: int) -> bool:
        return True


class _TurnForgotten(SlowTests):
    def unlike(self, learned_at: float) -> float:
        return self.v


class TurnForgotten(Other):
    """What a steady motion has moved a bias by is not allowed for when it ends."""

    tests = _TurnForgotten


class _QuietSheet(SlowTests):
    def beside_median(self, variance: float) -> float:
        return variance


class QuietSheet(Other):
    """Noise is a fault where it is more than that of the others, within the data sheet too."""

    tests = _QuietSheet


class _AsKnown(SlowTests):
    @property
    def error(self) -> float:
        return self.s.slow_reference + self.s.slow_reference_frames * self.v


class ReferenceAsKnownAtALevel(Other):
    """The bias of the reference is known as well after a change of level as before."""

    tests = _AsKnown


class IsolatedBesideOthers(Other):
    """A channel is isolated whatever the shares of the others are."""

    tests = _NotAlone


class _NeverCut(SlowTests):
    def cut(self, m: float) -> bool:
        return False


class TestedAtTheStop(Other):
    """Residuals are tested and learned at an end of the range too."""

    tests = _NeverCut


class _MovedBySplits(SlowTests):
    def unmoved(self, view: View) -> bool:
        return False


class MovedBySplits(Other):
    """What the middle moves in a split is the aircraft's."""

    tests = _MovedBySplits


class _LearnsBursts(SlowTests):
    def step(self, sigma: float, a: float) -> float:
        return inf


class LearnsBursts(Other):
    """A residual is learned in full, however large."""

    tests = _LearnsBursts


class _NoneStands(SlowTests):
    standing = 10**9


class IsolatedBesideStill(Other):
    """A channel is isolated beside two that stand still."""

    tests = _NoneStands


class _AnySlope(SlowTests):
    beyond = inf


class HalvesByAnySlope(Other):
    """A slope that is too steep for any half decides."""

    tests = _AnySlope


class _NoiseInFull(SlowTests):
    whole_of = inf


class NoiseInFull(Other):
    """Whatever a residual is counts in the noise."""

    tests = _NoiseInFull


class _AskedEarly(SlowTests):
    reference_from = 100


class ReferenceAskedEarly(Other):
    """The reference is asked before it is known."""

    tests = _AskedEarly


class PlainPairs(ResettableOracle):
    """Only the mean of a signal with a majority is weighted."""

    def resolve(self, view: View) -> tuple[str, float, set[int]]:
        view.s = replace(self.s, weighted=False)
        return super().resolve(view)


class PlainGoodPairs(ResettableOracle):
    """The mean of the good pair of a 2:2 is not weighted."""

    def resolve(self, view: View) -> tuple[str, float, set[int]]:
        view.before = {}
        return super().resolve(view)
