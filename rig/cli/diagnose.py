"""``rig diagnose``: which sensor of a recording was wrong, since when, and would the manager have isolated it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

from rig.cli.common import Json, arg, emit, names, opt, takes_options
from rig.cli.printing import line, table
from rig.cli.working import working
from rig.core.column import Column
from rig.core.outputs import require_apart, require_page


@dataclass(frozen=True, kw_only=True)
class DiagnoseOptions:
    """The options of ``rig diagnose``."""

    recorded: Annotated[
        Path, arg("FILE", "Log of PX4, ArduPilot, ROS 2 or MDF 4, CSV, Parquet, MCAP, or a folder of tables.")
    ]
    config: Annotated[
        Path | None,
        opt("FILE", "Configuration, as for rig vote.", show_default="the preset, or as in the flight's log"),
    ] = None
    preset: Annotated[
        str | None,
        opt("NAME", "Preset for a log of another system: px4, ardupilot or ros2-imu.", show_default="by its format"),
    ] = None
    page: Annotated[Path | None, opt("FILE", "Page with the paragraphs and plots, .html.")] = None
    inject: Annotated[
        str | None,
        opt("KIND,KIND...", "Also try faults on copies of the log: step, freeze, drift, noise, or all."),
    ] = None
    as_json: Json = False


@takes_options
def diagnose(options: DiagnoseOptions) -> None:
    """Find out which sensor of a recording was wrong, since when, and whether the manager would have isolated it."""
    from rig.bench.diagnose.diagnose_run import diagnose_file

    require_apart({"--page": options.page}, [options.recorded, options.config])
    require_page("--page", options.page)
    kinds = () if options.inject is None else tuple(names("--inject", options.inject))
    with working("reading", not options.as_json):
        found = diagnose_file(options.recorded, options.config, options.preset, inject=kinds)
        if options.page is not None:
            from rig.bench.diagnose.diagnosis_page import write

            write(options.page, found)
    summary = {**found.summary, **({"page": str(options.page)} if options.page is not None else {})}
    emit(options.as_json, summary, lambda: _show(summary))


_INJECTED: Final = (
    *(Column("signal"), Column("fault"), Column("size", lambda row: _size(row)), Column("tried"), Column("correct")),
    *(
        Column("one of two", "one_of"),
        Column("missed"),
        Column("wrong"),
        Column("late", "delay_s", ".2f", "s", worth=5),
    ),
)


def _size(row: dict[str, Any]) -> str:
    """Return the size of an injected fault with its unit."""
    return "" if row["size"] is None else f"{row['size']:g} {row['unit']}".rstrip()


def _show(summary: dict[str, Any]) -> None:
    """Print the result, a paragraph for each quantity, and the table of injected faults."""
    line(f"{summary['file']}: {summary['title']}", style="bold")
    for remark in summary["remarks"]:
        line(remark)
    for quantity in summary["quantities"].values():
        line()
        line(quantity["text"])
    for name, reason in summary["not_compared"].items():
        line()
        line(f"{name}: not compared: {reason}")
    if summary["injected"]:
        line()
        line("faults tried on copies of this log: how many of them are detected")
        table(summary["injected"], _INJECTED)
    for warning in summary["warnings"]:
        line(f"warning: {warning}", style="yellow")
    if "page" in summary:
        line(f"written  {summary['page']}")
