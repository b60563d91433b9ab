"""``rig thresholds``: parse, call, print."""

from __future__ import annotations

from contextlib import nullcontext
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rig.cli.common import Json, emit
from rig.cli.working import working
from rig.errors import BadInput

if TYPE_CHECKING:
    from rig.recordings.alignment import AlignOptions
    from rig.thresholds.design import Grid

MOST_FRAMES = 10_000
Budget = Annotated[float, typer.Option(metavar="X", help="False isolations an hour and signal.", show_default=False)]
Out = Annotated[
    Path, typer.Option(metavar="FILE", help="What to write: CONFIG with the thresholds, TOML.", show_default=False)
]
Plot = Annotated[Path | None, typer.Option(metavar="FILE", help="The trade-off as a page: .html.", show_default=False)]
Config = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Settings of rig vote; logs of ours may do without.", show_default=False),
]


def thresholds(
    inputs: Annotated[
        list[Path],
        typer.Argument(metavar="INPUT...", help="Recordings, folders of them, logs, a campaign.", show_default=False),
    ],
    budget: Budget,
    out: Out,
    config: Config = None,
    persistence: Annotated[str, typer.Option(help="Frames to try.")] = "8,12,24,48",
    levels: Annotated[str, typer.Option(help="Channels in use to design for.")] = "4,3,2",
    filters: Annotated[str, typer.Option("--filter", help="Low-pass of the comparison to try, s.")] = "0,0.1",
    align: Annotated[bool, typer.Option("--align", help="Take constant delays and offsets off the channels.")] = False,
    align_from: Annotated[
        float | None, typer.Option(help="Begin of the stretch to find them in, s.", show_default="first row")
    ] = None,
    align_to: Annotated[float | None, typer.Option(help="Its end, s.", show_default="6 s after its begin")] = None,
    align_matrix: Annotated[
        bool, typer.Option("--align-matrix", help="Take misalignments off the triads of CONFIG too.")
    ] = False,
    repair_time: Annotated[bool, typer.Option("--repair-time", help="Drop rows whose time repeats.")] = False,
    keep: Annotated[
        bool, typer.Option("--keep", help="Design with flights too in which a channel stands out.")
    ] = False,
    outlier: Annotated[
        bool, typer.Option("--outlier", help="Write them as outlier thresholds, beside the thresholds that there are.")
    ] = False,
    monitored: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Data to be monitored: does it move more? Repeatable.", show_default=False),
    ] = None,
    plot: Plot = None,
    seed: Annotated[int, typer.Option(metavar="N", help="Of the bootstrap.", min=0)] = 0,
    as_json: Json = False,
) -> None:
    """Design thresholds from a budget of false isolations, by healthy data."""
    from rig.cli.show_thresholds import show
    from rig.recordings.alignment import AlignOptions
    from rig.thresholds.design import Grid
    from rig.util.console import console

    if not (isfinite(budget) and budget > 0):
        raise BadInput(f"--budget: false isolations an hour, above 0, got {budget}")
    frames, counts = _numbers("--persistence", persistence, 1, MOST_FRAMES), _numbers("--levels", levels, 2, 4)
    grid = Grid(budget, frames, counts, _seconds("--filter", filters), seed)
    reading = repair_time, _aligned(align, AlignOptions(align_from, align_to, align_matrix))
    with working("reading", not as_json):
        found = _design(inputs, config, (out, plot), grid, reading, (keep, outlier), monitored or [])
    emit(as_json, found, lambda: show(console(), found))


def _aligned(align: bool, options: AlignOptions) -> AlignOptions | None:  # as the option is given
    """What --align asks for."""
    if not align and any((options.from_s is not None, options.to_s is not None, options.matrix)):
        raise BadInput("--align-from, --align-to and --align-matrix need --align")
    return options if align else None


def _numbers(option: str, text: str, least: int, most: int) -> list[int]:
    """Whole numbers between commas."""
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isascii() and part.isdecimal() and least <= int(part[:9]) <= most for part in parts):
        raise BadInput(f"{option}: whole numbers from {least} to {most} with commas between, got {text!r}")
    return sorted({int(part) for part in parts})


def _seconds(option: str, text: str) -> list[float]:
    try:
        found = sorted({float(part) for part in text.split(",")})
    except ValueError:
        found = [-1.0]
    if not all(isfinite(value) and 0 <= value <= 1e3 for value in found):
        raise BadInput(f"{option}: seconds from 0 to 1000 with commas between, got {text!r}")
    return found


def _design(
    inputs: list[Path],
    config: Path | None,
    outputs: tuple[Path, Path | None],
    grid: Grid,
    reading: tuple[bool, Any],
    choices: tuple[bool, bool],
    monitored: list[Path],
) -> dict[str, Any]:
    """Read, design, write; the summary, and the seconds of each step."""
    from rig.recordings.settings import VoteConfig
    from rig.thresholds.config import recorded_toml, scenario_toml, start
    from rig.thresholds.data import load, of_scenario, recordings
    from rig.thresholds.healthy import beyond, envelope
    from rig.thresholds.report import remarks, summary, write_picture
    from rig.thresholds.run import design
    from rig.util.files import replaced, write_text

    (out, page), (keep, outlier) = outputs, choices
    with replaced(out) as part, replaced(page) if page else nullcontext() as page_part:
        clock = perf_counter()
        if config is None:
            using, raw, source = of_scenario(recordings(inputs, VoteConfig())), None, str(inputs[0])
        else:
            (using, raw), source = start(config), str(config)
        data = load(inputs, using, source, *reading)
        read_s, clock = perf_counter() - clock, perf_counter()
        signals = design(data, grid, keep)
        if monitored:
            other = load(monitored, using, source, *reading)
            of = {name: envelope(flights, other.settings[name].wraps) for name, flights in other.signals.items()}
            data.notes.extend(beyond({name: signal.motion for name, signal in signals.items()}, of))
        found = summary(data, grid, signals)
        chosen = {name: made for name, signal in signals.items() if (made := signal.design) is not None}
        head = remarks(data, grid, signals)
        if raw is None:
            text = scenario_toml(chosen, data.settings, head, outlier)
        else:
            text = recorded_toml(raw, chosen, data.settings, data.rate_hz, data.referenced, head, outlier)
        if page_part is not None:
            write_picture(page_part, found)
        write_text(part, text)
    return {"out": str(out), **found, "seconds": {"read": read_s, "design": perf_counter() - clock}}
