"""Kinds of faults of the data link between the lanes, with ``[computers] count`` of 2 or more.

A fault acts on one direction, ``ccdl.A-B`` from A to B, or on a node, ``ccdl.A``: all messages that leave lane A.
It affects every message of that direction: the lane's own samples, and the samples that it relays.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from rig.world.faults.effects import Act, Effect
from rig.world.faults.fault_settings import Placed, quantity
from rig.world.faults.places import Point, Site, one_way_links
from rig.world.faults.servo_parts import LinkPart


class _OnLink(Placed):
    """A fault of a link."""

    sites: ClassVar[tuple[Site, ...]] = ("ccdl",)
    changes_samples, takes_channels = False, True

    @property
    def targets(self) -> list[Point]:
        """One record for each way."""
        return [Point(way) for way in one_way_links(self.signal)]


class LinkLoss(_OnLink):
    """No message arrives. Causes: a broken wire, a failed transmitter.

    The receiver uses the last message for `max_age_frames`. Then the samples of the sender are missing.
    """

    act = Effect(Act.SET, 1.0, part=LinkPart.SILENT)
    sentence = "silent from {at} on"
    example = "f16_link_loss"

    kind: Literal["link_loss"]


class LinkFrozen(_OnLink):
    """The last message is repeated. Cause: a buffer that is no longer filled.

    The frame number in the message shows its age, so the effect is that of a lost message.
    """

    act = Effect(Act.SET, 1.0, part=LinkPart.FROZEN)
    sentence = "last message repeated from {at} on"
    example = "f16_link_frozen"

    kind: Literal["link_frozen"]


class LinkCorrupt(_OnLink):
    """Messages are damaged, and the checksum shows it. Causes: crosstalk, a bad contact.

    The samples of the sender are missing at once.
    """

    act = Effect(Act.SET, 1.0, part=LinkPart.DAMAGED)
    sentence = "messages damaged from {at} on"
    example = "f16_link_corrupt"

    kind: Literal["link_corrupt"]


class LinkByzantine(_OnLink):
    """Every sample has an offset, and the checksum is correct. Cause: a transmitter that reads the wrong memory.

    A node may transmit different values to different receivers (a Byzantine fault).
    """

    act = Act.SET
    sizes = ("offset",)
    sentence = "wrong samples transmitted from {at} on"
    example = "f16_link_byzantine"

    kind: Literal["link_byzantine"]
    offset_thresholds: float = quantity("thresholds", "added to every transmitted sample")
    different: bool = quantity(
        "", "true: added to the samples for lanes A and C, subtracted from the samples for B and D", False
    )
    ramp_s: float = quantity("s", "the offset grows linearly from zero over this time", 0.0, ge=0)

    @property
    def effect(self) -> Effect:
        """An offset in thresholds of each signal's monitor."""
        return Effect(Act.SET, self.offset_thresholds, part=LinkPart.OFFSET, different=self.different)
