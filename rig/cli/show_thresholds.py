"""What ``rig thresholds`` prints for people."""

from __future__ import annotations

from typing import Any

from rig.util.console import Screen


def show(screen: Screen, found: dict[str, Any]) -> None:
    """The thresholds of each signal, what they find, the hold-out check and the remarks."""
    hours, flights = f"{found['hours']:.4g} h", f"{found['flights']} recordings"
    screen.print(f"{found['budget_per_h']:g} false isolations an hour and signal, from {hours} in {flights}")
    for name, signal in found["signals"].items():
        if signal["designs"]:
            _thresholds(screen, name, signal)
    _tradeoffs(screen, found)
    screen.print(f"chosen (>): {found['rule']}", soft_wrap=True)
    _hold_out(screen, found)
    _motion(screen, found)
    for line in found["notes"]:
        screen.print(f"note: {line}", soft_wrap=True)
    screen.print(", ".join(f"{stage} {taken:.2f} s" for stage, taken in found["seconds"].items()))
    screen.print(f"written  {found['out']}", soft_wrap=True)


def _chosen(signal: dict[str, Any], one: dict[str, Any]) -> str:
    chosen = signal["chosen"]
    same = chosen and all(chosen[key] == one[key] for key in ("persistence", "filter_s"))
    return ">" if same else ""


def _thresholds(screen: Screen, name: str, signal: dict[str, Any]) -> None:
    rows = []
    for one in signal["designs"]:
        for level, at in one["levels"].items():
            first = level == next(iter(one["levels"]))
            mark = "*" if one["extrapolation"] > 100.0 else ""
            rows.append(
                (
                    _chosen(signal, one) if first else "",
                    f"{one['filter_s']:g}" if first else "",
                    str(one["persistence"]) if first else "",
                    level,
                    f"{at['upper']:.4g}{mark}",
                    f"{at['point']:.4g}",
                    str(at["clusters"]),
                    f"{at['shape']:.2f}",
                    f"{one['extrapolation']:.3g}{mark}" if first else "",
                )
            )
    heads = ("", "filter, s", "frames", "in use", "threshold", "point", "clusters", "shape", "extrapolation")
    screen.print()
    screen.print(f"{name}: threshold (95 % upper) and point estimate, unit of the signal")
    screen.table(heads, rows)


def _tradeoffs(screen: Screen, found: dict[str, Any]) -> None:
    rows, heads = [], ()
    for name, signal in found["signals"].items():
        for one in signal["designs"]:
            if (of := one["tradeoff"]) is None:
                continue
            twice, faults = of["at_twice_the_threshold"], of["faults"]
            heads = tuple(faults)
            rows.append(
                (
                    _chosen(signal, one),
                    name,
                    f"{one['filter_s']:g}",
                    str(one["persistence"]),
                    _number(of["smallest_offset"]),
                    _number(twice["delay_s"]),
                    *(_right(fault) for fault in faults.values()),
                    f"{of['found_rightly']:.3f}",
                )
            )
    if rows:
        screen.print()
        screen.print("faults injected into the same data: found rightly (offsets in parts of the motion)")
        names = ("", "signal", "filter, s", "frames", "smallest offset", "delay at 2 T, s", *heads, "share")
        screen.table(names, rows)


def _right(fault: dict[str, Any]) -> str:
    of = fault["right"] + fault["wrong"] + fault["missed"]
    return f"{fault['right']}/{of}" + (f" -{fault['wrong']}" if fault["wrong"] else "")


def _hold_out(screen: Screen, found: dict[str, Any]) -> None:
    rows = [
        (name, level, str(one["counted"]), f"{one['expected']:.3g}", "over" if one["significantly_over"] else "")
        for name, signal in found["signals"].items()
        for level, one in signal["hold_out"].items()
    ]
    if rows:
        screen.print()
        screen.print("hold-out: half of the data design, false isolations in the other half, both ways")
        screen.table(("signal", "in use", "counted", "budget allows", ""), rows)


def _motion(screen: Screen, found: dict[str, Any]) -> None:
    rows = [
        (name, f"{of['value']:.4g}", f"{of['rate_per_s']:.4g}", f"{of['noise']:.4g}", "at rest" if of["still"] else "")
        for name, of in ((name, signal["motion"]) for name, signal in found["signals"].items())
    ]
    screen.print()
    screen.print("motion of the data, 95 %: thresholds hold for data that move no more")
    screen.table(("signal", "from its median", "a second", "between channels", ""), rows)


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.3g}"
