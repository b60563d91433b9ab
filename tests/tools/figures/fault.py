"""The two pictures of the concepts: the loop of one frame, and a fault from onset to isolation."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from math import degrees
from typing import Final, NamedTuple

import numpy as np

import rig
from figures.svg import Floats, Panel, box, line, svg, text
from rig.core.frame import INDEX, Block, State

SCENARIO: Final = "f16_pitch_rate_hardover"
Q, ALPHA, FAULTY = INDEX["pitch_rate"], INDEX["angle_of_attack"], 2  # FAULTY: channel 3 is the third


class Flown(NamedTuple):
    """Two flights of one fault: by the built-in manager, and by the mean of the four samples."""

    rows: Block
    mean: Block
    rate_hz: float
    onset: int  # frame
    threshold: float  # of isolation, deg/s
    persistence: int  # frames


def flown() -> Flown:
    """Fly both; SystemExit if the fault is not isolated as the picture shows it."""
    scenario = rig.load(SCENARIO).resolved()
    signal = scenario["redundancy"]["signals"]["pitch_rate"]
    with tempfile.TemporaryDirectory() as logs:
        flights = [
            rig.fly(SCENARIO, overrides=[f"redundancy.manager={manager}", "duration_s=22"], out=logs)
            for manager in ("cross-channel", "mean")
        ]
        rows, mean = (flight.rows for flight in flights)  # read from the logs
    onset = round(scenario["faults"][0]["start_s"] * scenario["rate_hz"])
    counted = rows["state"][onset : isolated(rows), Q, FAULTY] == State.SUSPECT
    if len(mean) == len(rows) or len(counted) + 1 != signal["persistence"] or not counted.all():
        raise SystemExit(f"{SCENARIO}: {flights[0].conclusion}; {flights[1].conclusion}")
    threshold = degrees(signal["threshold"])
    return Flown(rows, mean, scenario["rate_hz"], onset, threshold, signal["persistence"])


def isolated(rows: Block) -> int:
    """Return the frame in which channel 3 is isolated."""
    return int(np.argmax(rows["state"][:, Q, FAULTY] == State.FAILED))


def fault(flights: Flown) -> str:
    """Return the picture of the fault: channels and voted value, miscompare count, and the aircraft by both voters."""
    rows, onset, out = flights.rows, flights.onset, isolated(flights.rows)
    ms = 1000.0 / flights.rate_hz
    shown = slice(onset - 4, onset + 14)
    time = (np.arange(shown.start, shown.stop) - onset) * ms
    channels, voted = (np.degrees(rows[name][shown, Q]) for name in ("channels", "voted"))
    span = float(time[0]), float(time[-1])
    above = Panel(78, 240, span, (-2.0, 2.0))
    below = Panel(280, 350, span, (0.0, 8.0))
    stop, delay = channels[-1, FAULTY], (out - onset) * ms
    parts = [
        text(16, 26, "Hardover: one of four pitch-rate gyros runs to the end of its range", bold=True),
        text(16, 46, "Pitch rate of an F-16 in level flight, deg/s", "soft"),
        *_band(above, time, voted, flights.threshold),
        *above.axes([], (-1, 0, 1)),
        *(line(above.steps(time, channels[:, c]), f"c{c + 1}") for c in (0, 1, 3)),
        line(above.steps(time[:5], channels[:5, FAULTY]), "c3", 'stroke-width="2.5"'),
        line([above.at(0, channels[3, FAULTY]), (above.at(0, 0)[0], above.top - 8)], "c3", _ARROW),
        line(above.steps(time, voted), "vote", 'stroke-width="3"'),
        text(above.at(0, 0)[0] + 10, above.top - 4, f"channel 3: {stop:.1f} deg/s", "c3"),
        text(above.right + 14, above.at(0, 0)[1] - 2, "voted value", "vote", bold=True),
        text(above.right + 14, above.at(0, 0)[1] + 16, "channels", "soft"),
        *(text(above.right + 76 + 16 * i, above.at(0, 0)[1] + 16, str(c), f"c{c}") for i, c in enumerate((1, 2, 4))),
        text(above.right + 14, above.at(0, flights.threshold)[1] - 22, "isolation threshold:", "soft"),
        text(above.right + 14, above.at(0, flights.threshold)[1] - 5, f"voted ± {flights.threshold:.2f} deg/s", "soft"),
        line([above.at(0, 0), above.at(0, -2.0)], "onset", _DOTS),
        line([below.at(0, 8), below.at(0, 0)], "onset", _DOTS),
        text(above.at(0, 0)[0] - 8, above.bottom - 8, "onset", anchor="end"),
        text(16, 266, "Miscompare count of channel 3, frames", "soft"),
        *below.axes((-40, 0, 40, 80, 120), (0, 4, 8), "ms after onset"),
    ]
    for count in range(1, flights.persistence + 1):
        (left, top), (right, bottom) = below.at((count - 1) * ms, count), below.at((count - 0.2) * ms, 0)
        size = f'width="{right - left:.1f}" height="{bottom - top:.1f}"'
        role = "bad" if count == flights.persistence else "onset"
        parts.append(f'<rect class="f-{role}" x="{left:.1f}" y="{top:.1f}" {size}/>')
    x = above.at(delay, 0)[0]
    parts += [
        line([(x, above.top), (x, below.bottom)], "bad", 'stroke-dasharray="6 4"'),
        text(
            x + 8, above.bottom - 8, f"isolated in frame {flights.persistence}, after {delay:.0f} ms", "bad", bold=True
        ),
        text(below.right + 14, below.top + 5, f"persistence: {flights.persistence} frames", "soft"),
        *_aircraft(flights),
    ]
    return svg("fault", 562, "A gyro that runs to its stop", _described(flights, stop, delay), parts)


_DOTS: Final = 'stroke-dasharray="2 3"'
_ARROW: Final = 'stroke-width="2.5" marker-end="url(#fault-c3)"'


def _band(panel: Panel, time: Floats, voted: Floats, threshold: float) -> Iterable[str]:
    edges = [*panel.steps(time, voted + threshold), *reversed(panel.steps(time, voted - threshold))]
    yield f'<path class="f-band" d="M{"L".join(f"{x:.1f} {y:.1f}" for x, y in edges)}z"/>'


def _aircraft(flights: Flown) -> Iterable[str]:
    """Yield the plot of the angle of attack, with the built-in manager and with the averaging voter."""
    panel = Panel(420, 524, (-0.2, 1.6), (-26.0, 6.0))
    yield text(
        16, 406, "The aircraft: angle of attack, deg, with the built-in manager and with an averaging voter", "soft"
    )
    yield from panel.axes((0, 0.4, 0.8, 1.2, 1.6), (-20, -10, 0), "s after onset")
    looks = ("vote", 'stroke-width="3"'), ("bad", 'stroke-dasharray="6 4"')
    for rows, (role, more) in zip((flights.rows, flights.mean), looks, strict=True):
        time = (rows["frame"] - flights.onset) / flights.rate_hz
        chosen = (time >= panel.x[0]) & (time <= panel.x[1])
        alpha = np.degrees(rows["truth"][chosen, ALPHA])
        yield line([panel.at(*point) for point in zip(time[chosen][::2], alpha[::2], strict=True)], role, more)
    end = (float(flights.mean["frame"][-1]) - flights.onset) / flights.rate_hz
    x, y = panel.at(end, float(np.degrees(flights.mean["truth"][-1, ALPHA])))
    yield line([(x - 5, y - 5), (x + 5, y + 5)], "bad", 'stroke-width="2.5"')
    yield line([(x - 5, y + 5), (x + 5, y - 5)], "bad", 'stroke-width="2.5"')
    yield text(panel.right + 14, panel.at(0, 2.8)[1] + 4.5, "built-in manager", "vote", bold=True)
    yield text(x - 20, panel.bottom - 4, f"averaging voter: lost after {end:.2f} s", "bad", anchor="end", bold=True)


def _described(flights: Flown, stop: float, delay: float) -> str:
    end = (float(flights.mean["frame"][-1]) - flights.onset) / flights.rate_hz
    return (
        f"Channel 3 of the pitch rate jumps to {stop:.1f} deg/s. The voted value stays with channels 1, 2 and 4. "
        f"Channel 3 differs from all others by more than the isolation threshold of {flights.threshold:.2f} deg/s, "
        f"its miscompare count rises to {flights.persistence} frames, and it is isolated after {delay:.0f} ms. "
        f"With the mean of the four samples as the voted value, the aircraft departs and is lost after {end:.2f} s."
    )


def architecture(flights: Flown) -> str:
    """Return the picture of the loop, with the numbers of the first faulty frame."""
    row = flights.rows[flights.onset]
    samples, voted = np.degrees(row["channels"][Q]), np.degrees(row["voted"][Q])
    elevator, truth = np.degrees(row["surface"][0]), np.degrees(row["truth"][Q])
    arrow = 'marker-end="url(#architecture-soft)"'
    parts = [
        text(
            16,
            26,
            f"One frame of {1000.0 / flights.rate_hz:.0f} ms: the pitch rate, deg/s, at the onset of a fault",
            bold=True,
        ),
        '<rect class="s-line" x="12" y="44" width="676" height="262" rx="8"/>',
        '<rect class="s-soft" x="452" y="58" width="224" height="236" rx="6" stroke-dasharray="5 4"/>',
        text(664, 80, "flight computer (or yours)", "soft", anchor="end"),
        *box(26, 92, 104, 190, ("JSBSim", "nonlinear", "aircraft,", "wind, gusts")),
        *box(190, 92, 94, 76, ("sensors", "4 per signal")),
        *box(316, 92, 68, 76, ("faults",)),
        *box(466, 92, 196, 76, ("redundancy manager", "votes, monitors, isolates")),
        *box(466, 226, 196, 56, ("control law", "reads voted values alone")),
        *box(200, 226, 168, 56, ("servos", "lag, or 4 channels")),
        line([(130, 130), (188, 130)], "soft", arrow),
        text(158, 122, "true", "soft", anchor="middle"),
        text(158, 147, f"{truth:.2f}", anchor="middle"),
        line([(564, 168), (564, 224)], "soft", arrow),
        text(574, 192, "voted value", "soft"),
        text(574, 210, f"{voted:.2f}", bold=True),
        line([(466, 254), (370, 254)], "soft", arrow),
        text(412, 246, f"{elevator:.2f}°", anchor="middle"),
        text(412, 272, "elevator", "soft", anchor="middle"),
        line([(200, 254), (132, 254)], "soft", arrow),
        text(166, 272, "surfaces", "soft", anchor="middle"),
        text(142, 328, "every field of every frame", "soft"),
    ]
    outputs = (
        ("log (MCAP)", "score, report, replay"),
        ("live stream", "Rerun"),
        ("summary", "printed at the end"),
    )
    for i, words in enumerate(outputs):
        x = 26 + 222 * i
        parts += [line([(x + 102, 306), (x + 102, 340)], "soft", arrow), *box(x, 342, 204, 52, words)]
    for channel, sample in enumerate(samples):
        y = 103 + 18 * channel
        parts += [line([(284, y), (314, y)], f"c{channel + 1}"), line([(384, y), (464, y)], f"c{channel + 1}")]
        role = "bad" if channel == FAULTY else "ink"
        parts += [
            f'<rect class="f-ground" x="396" y="{y - 8}" width="46" height="16"/>',
            text(440, y + 4.5, f"{sample:.2f}", role, anchor="end", bold=channel == FAULTY),
            f'<rect class="f-ground" x="293" y="{y - 8}" width="12" height="16"/>',
            text(299, y + 4.5, str(channel + 1), f"c{channel + 1}", anchor="middle"),
        ]
    described = (
        "JSBSim computes the true state. Four sensors measure each signal, and faults act on their samples. "
        "The redundancy manager turns four channels into one voted value. The control law reads voted values alone. "
        "It commands the servos, which move the surfaces of the aircraft. Log, live stream and summary get every "
        f"frame. In the frame that is shown channel 3 reads {samples[FAULTY]:.2f} deg/s, and the voted value is "
        f"{voted:.2f} deg/s."
    )
    return svg("architecture", 408, "The loop of one frame", described, parts)
