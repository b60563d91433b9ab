"""Kinds of faults of the data link between the lanes, which ``[computers] count`` of 2 or more has.

A fault sits on one way, ``ccdl.A-B`` from A to B, or on a node, ``ccdl.A``: on all that leaves lane A.  It is in all
that goes that way: the lane's own samples, and what it relays of others'.
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
    """Nothing arrives. A broken wire, a dead transmitter.

    The receiver reads the last message for ``max_age_frames``, then the sender's samples are missing.
    """

    act = Effect(Act.SET, 1.0, part=LinkPart.SILENT)
    sentence = "silent from {at} on"
    example = "f16_link_loss"

    kind: Literal["link_loss"]


class LinkFrozen(_OnLink):
    """The last message arrives again and again. A buffer that is no longer filled.

    The number of its frame shows its age, so it is as good as none.
    """

    act = Effect(Act.SET, 1.0, part=LinkPart.FROZEN)
    sentence = "last message repeated from {at} on"
    example = "f16_link_frozen"

    kind: Literal["link_frozen"]


class LinkCorrupt(_OnLink):
    """What arrives is damaged, and its checksum shows it. Crosstalk, a bad contact.

    The sender's samples are missing at once.
    """

    act = Effect(Act.SET, 1.0, part=LinkPart.DAMAGED)
    sentence = "messages damaged from {at} on"
    example = "f16_link_corrupt"

    kind: Literal["link_corrupt"]


class LinkByzantine(_OnLink):
    """Every sample that goes this way is off, and the checksum is right. A transmitter that reads the wrong memory.

    A node may tell each receiver something else: that parts lanes that believe what arrives.
    """

    act = Act.SET
    sizes = ("offset",)
    sentence = "wrong samples transmitted from {at} on"
    example = "f16_link_byzantine"

    kind: Literal["link_byzantine"]
    offset_thresholds: float = quantity("thresholds", "added to every sample that is told")
    different: bool = quantity("", "to lanes A and C it is added, from what B and D are told it is taken away", False)
    ramp_s: float = quantity("s", "it grows linearly from nothing over this time", 0.0, ge=0)

    @property
    def effect(self) -> Effect:
        """Off by so many thresholds of each signal's monitor."""
        return Effect(Act.SET, self.offset_thresholds, part=LinkPart.OFFSET, different=self.different)
