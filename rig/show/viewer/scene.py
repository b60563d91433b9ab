"""The aircraft in space: attitude and path in three dimensions, the track from above, the position on Earth.

/pose, /position   Transform3D, GeoPoints, every frame, as in the log
/attitude          the rotation of /pose alone, which carries /aircraft, a figure, over a compass at /horizon
/numbers           attitude, height, speed, load factor and angle of attack in figures
/here              a mark carried by /pose
/path              the path flown so far, thinned
/track             the same from above: x to the east, y to the south, as in images
/map               the same as latitude and longitude
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rig.core.frame import FLIGHT_INDEX, INDEX, Block
from rig.show.viewer import matrix
from rig.show.viewer.style import FIN, FUSELAGE, HORIZON_LINE, Color

TIMELINE: Final = "message_log_time"  # the importer's name for the log time of a message
WORLD: Final = "world"
HORIZON: Final = "horizon"
ABOUT: Final = "/about"  # the flights in words
MARGIN: Final = "/margin"  # an empty text
POINTS: Final = 256  # most points of a path: beyond that every second one is dropped
MARKS_HZ: Final = 10.0  # updates of the mark of the track
NUMBERS: Final = "/numbers"
NUMBERS_HZ: Final = 5.0
_LINE: Final[Any] = rr.Radius.ui_points(1.5)
_MARK: Final[Any] = rr.Radius.ui_points(6.0)


def time_column(nanoseconds: NDArray[Any]) -> rr.TimeColumn:
    """Return simulation time as a column, as in the log."""
    return rr.TimeColumn(TIMELINE, duration=nanoseconds.astype("timedelta64[ns]"))


def send_about(recording: rr.RecordingStream, text: str, time_s: float = 0.0, *, static: bool = False) -> None:
    """Send a Markdown text with the flights and their outcomes; from ``time_s`` on unless ``static``."""
    document = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
    if static:
        rr.log(ABOUT, document, static=True, recording=recording)
        return
    columns = rr.TextDocument.columns(text=[text], media_type=[rr.MediaType.MARKDOWN])
    rr.send_columns(ABOUT, [time_column(np.array([time_s * 1e9]))], columns, recording=recording)


def send_frame(recording: rr.RecordingStream) -> None:
    """Send the legend, and the empty text left of the strips."""
    rr.log(matrix.LEGEND, matrix.legend(), static=True, recording=recording)
    rr.log(MARGIN, rr.TextDocument(" "), static=True, recording=recording)


class Scene:
    """Sends the position and attitude of one flight; ``root`` and ``color`` as of columns.Columns."""

    def __init__(self, recording: rr.RecordingStream, root: str, color: Color) -> None:
        self._recording = recording
        self._root = root
        self._color = color
        self._path = np.empty((0, 5))  # east, north, altitude in m, latitude, longitude in deg
        self._every_ns = 1e9 / MARKS_HZ
        self._next_ns = -np.inf
        self._begun = False

    def send(self, rows: Block, nanoseconds: NDArray[np.float64]) -> None:
        """Send ``rows``, at the times given for them."""
        if not self._begun:
            self._begin()
        self._begun = True
        places = _places(rows)
        self._pose(rows, places, nanoseconds)
        self._grow(places, nanoseconds)
        time = nanoseconds[:1]
        drawn = {"colors": [self._color], "radii": [_LINE]}
        track = self._path[:, :2] * (1, -1)
        self._log("/path", time, rr.LineStrips3D.columns(strips=[self._path[:, :3]], **drawn))
        self._log("/track", time, rr.LineStrips2D.columns(strips=[track], **drawn))
        self._log("/map", time, rr.GeoLineStrings.columns(line_strings=[self._path[:, 3:]], **drawn))

    def _begin(self) -> None:
        """Send a stick figure of an aircraft, 15 m long, x forward, y left, z up; and a mark of constant size."""
        strips = [
            [[8, 0, 0], [-7, 0, 0]],  # fuselage
            [[-2, 5, 0], [1, 0, 0], [-2, -5, 0]],  # wing
            [[-7, 2.5, 0], [-5, 0, 0], [-7, -2.5, 0]],  # tailplane
            [[-5, 0, 0], [-7, 0, 3], [-7, 0, 0]],  # fin
        ]
        colors = [FUSELAGE, self._color, self._color, FIN]
        figure = rr.LineStrips3D(strips, colors=colors, radii=0.15)
        self._static("/aircraft", figure, rr.CoordinateFrame(f"attitude{self._root}"))
        self._static("/horizon", _compass(), rr.CoordinateFrame(HORIZON))
        mark = rr.Points3D([[0, 0, 0]], colors=[self._color], radii=[_MARK])
        self._static("/here", mark, rr.CoordinateFrame(f"aircraft{self._root}"))
        self._static("/path", rr.CoordinateFrame(WORLD))

    def _pose(self, rows: Block, places: NDArray[np.float64], nanoseconds: NDArray[np.float64]) -> None:
        """Send pose, in a world of x east, y north, z up; and position."""
        quaternion = rows["flight"][:, [FLIGHT_INDEX[f"quaternion_{axis}"] for axis in "wxyz"]]
        attitude = east_north_up(quaternion)
        pose = rr.Transform3D.columns(
            translation=places[:, :3],
            quaternion=attitude,
            parent_frame=[WORLD] * len(rows),
            child_frame=[f"aircraft{self._root}"] * len(rows),
        )
        turned = rr.Transform3D.columns(
            quaternion=attitude,
            parent_frame=[HORIZON] * len(rows),
            child_frame=[f"attitude{self._root}"] * len(rows),
        )
        self._log("/pose", nanoseconds, pose)
        self._log("/attitude", nanoseconds, turned)
        self._log("/position", nanoseconds, rr.GeoPoints.columns(positions=places[:, 3:]))
        marks = np.flatnonzero(np.diff(nanoseconds // (1e9 / MARKS_HZ), prepend=-1.0))
        here = places[marks]
        columns = rr.Points2D.columns(
            positions=here[:, :2] * (1, -1),
            colors=[self._color] * len(marks),
            radii=[_MARK] * len(marks),
            labels=[position(latitude, longitude) for latitude, longitude in here[:, 3:]],
        )
        self._log("/track/here", nanoseconds[marks], columns)
        marks = np.flatnonzero(np.diff(nanoseconds // (1e9 / NUMBERS_HZ), prepend=-1.0))
        texts = numbers(rows[marks])
        kinds = [rr.MediaType.MARKDOWN] * len(texts)
        self._log(NUMBERS, nanoseconds[marks], rr.TextDocument.columns(text=texts, media_type=kinds))

    def _grow(self, places: NDArray[np.float64], nanoseconds: NDArray[np.float64]) -> None:
        """Lengthen the path by these places; halve its points and its rate when it has too many."""
        slots = nanoseconds // self._every_ns
        new = np.flatnonzero(np.diff(slots, prepend=self._next_ns))
        self._next_ns = slots[-1]
        path = np.concatenate([self._path, places[new]])
        while len(path) >= POINTS:
            path = path[::2]
            self._every_ns *= 2
            self._next_ns = nanoseconds[-1] // self._every_ns
        self._path = path

    def _log(self, path: str, nanoseconds: NDArray[np.float64], columns: Any) -> None:
        rr.send_columns(self._root + path, [time_column(nanoseconds)], columns, recording=self._recording)

    def _static(self, path: str, *what: Any) -> None:
        rr.log(self._root + path, *what, static=True, recording=self._recording)


def _places(rows: Block) -> NDArray[np.float64]:
    """Return (n, 5) east, north, altitude in m, latitude and longitude in deg."""
    names = ("east_m", "north_m", "altitude_m", "latitude_rad", "longitude_rad")
    places = rows["flight"][:, [FLIGHT_INDEX[name] for name in names]]
    places[:, 3:] = np.degrees(places[:, 3:])
    return places


def _compass() -> rr.LineStrips3D:
    """Return the horizon as a circle with its four directions named."""
    turn = np.linspace(0.0, 2 * np.pi, 73)
    circle = 12.0 * np.column_stack([np.sin(turn), np.cos(turn), 0 * turn])
    spokes = [np.array([0.85 * circle[i], circle[i]]) for i in (0, 18, 36, 54)]
    return rr.LineStrips3D(
        [circle, *spokes],
        colors=[HORIZON_LINE],
        radii=rr.Radius.ui_points(1.0),
        labels=["", "N", "E", "S", "W"],
        show_labels=True,
    )


def position(latitude: float, longitude: float) -> str:
    """Return a position in degrees: 36.1234° N 115.0000° W."""
    return f"{abs(latitude):.4f}° {'S' if latitude < 0 else 'N'} {abs(longitude):.4f}° {'W' if longitude < 0 else 'E'}"


def numbers(rows: Block) -> list[str]:
    """Return the true flight condition in figures, a Markdown text for each row."""
    names = ("pitch_angle", "roll_angle", "heading", "angle_of_attack", "angle_of_sideslip")
    angles = np.degrees(rows["truth"][:, [INDEX[name] for name in names]])
    angles[:, 2] %= 360.0
    flown = rows["flight"][:, [FLIGHT_INDEX[name] for name in ("altitude_m", "true_airspeed_m_s", "mach")]]
    load = rows["truth"][:, INDEX["normal_load_factor"]]
    return [
        f"**pitch** {pitch:.1f}°, **roll** {roll:.1f}°, **heading** {heading:.1f}°\n\n"
        f"**altitude** {altitude:.0f} m, **airspeed** {speed:.0f} m/s, **Mach** {mach:.2f}\n\n"
        f"**load factor** {n_z:.2f} g, **angle of attack** {alpha:.1f}°, **sideslip** {beta:.1f}°"
        for (pitch, roll, heading, alpha, beta), (altitude, speed, mach), n_z in zip(angles, flown, load, strict=True)
    ]


def east_north_up(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return attitude of an aircraft with forward-left-up axes in an east-north-up world, (n, 4) as x, y, z, w.

        q_enu_flu = q_enu_ned * q_ned_frd * q_frd_flu,  q_enu_ned = (0, 1, 1, 0)/sqrt 2,  q_frd_flu = (0, 1, 0, 0)

    quaternion : (n, 4) as w, x, y, z, from forward-right-down to north-east-down.  The sign is free.
    """
    w, x, y, z = quaternion.T
    return np.sqrt(0.5) * np.column_stack([x + y, x - y, w - z, w + z])
