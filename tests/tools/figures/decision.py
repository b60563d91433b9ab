"""The picture of a decision: from the samples of one frame to vote, isolation or split."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from figures.svg import box, line, svg, text

_ARROW: Final = 'marker-end="url(#decision-soft)"'
_FIRST: Final = (
    ("Majority", ("all compared", "channels agree")),
    ("One differs", ("it agrees with no", "other: suspect")),
    ("No majority (split)", ("2:2, 1:1, 1:1:1, 1:1:1:1", "counts freeze")),
    ("Last channel", ("its monitor or reference", "contradicts it: suspect")),
)
_THEN: Final = (
    ("Vote", ("mean of the middle two,", "or the middle one"), "f-pale"),
    ("After 8 such frames", ("isolated; one agreeing", "frame resets the count"), "f-band"),
    ("Tie-break rules", ("in-line monitors, lane,", "reference, trend, ..."), "f-pale"),
    ("After 8 such frames", ("isolated; the signal", "is lost"), "f-band"),
)


def decision() -> str:
    """Return the picture."""
    decided = ("A rule decides for 10 frames", "the manager isolates the channels", "on the wrong side")
    open_end = ("No rule decides: unresolved", "vote: last value plus the mean change", "of the middle samples")
    unit = ("LRU failure", "a channel differs on 4 signals of its box", "for 8 frames: isolated on the whole box")
    common = (
        "Common mode",
        "two references contradict all channels for",
        "10 frames: reported, or all isolated if set",
    )
    parts = [
        *box(170, 12, 360, 46, ("Samples of the channels in use", "invalid, out of range or not finite: a miscompare")),
        line([(350, 58), (350, 72)], "soft", _ARROW),
        *box(170, 74, 360, 46, ("The manager compares every pair", "agree: difference of at most the threshold")),
        *_columns(),
        line([(410, 312), (290, 344)], "soft", _ARROW),
        line([(450, 312), (540, 344)], "soft", _ARROW),
        *box(130, 346, 260, 64, decided, "f-band"),
        *box(414, 346, 274, 64, open_end),
        text(12, 446, "In every frame as well:", "soft"),
        *box(12, 456, 330, 64, unit, "f-band"),
        *box(358, 456, 330, 64, common, "f-band"),
    ]
    described = (
        "A flow chart. The manager compares every pair of valid samples. With a majority it votes. A channel that "
        "agrees with no other is suspect, and is isolated after 8 frames. Without a majority the miscompare counts "
        "freeze and the tie-break rules follow in order. If a rule decides for 10 frames, the manager isolates the "
        "channels on the wrong side; otherwise the split stays unresolved and no channel is isolated. A last channel "
        "is isolated after 8 frames if its in-line monitor or its reference contradicts it, and the signal is lost. "
        "Two rules run beside this in every frame: an LRU failure, and a common mode."
    )
    return svg("decision", 534, "From the samples to a decision", described, parts)


def _columns() -> Iterable[str]:
    for i, ((head, words), (then, lines, colour)) in enumerate(zip(_FIRST, _THEN, strict=True)):
        x = 8 + 173 * i
        yield line([(350, 120), (x + 82, 144)], "soft", _ARROW)
        yield from box(x, 146, 165, 68, (head, *words), "f-quiet")
        yield line([(x + 82, 214), (x + 82, 242)], "soft", _ARROW)
        yield from box(x, 244, 165, 68, (then, *lines), colour)
