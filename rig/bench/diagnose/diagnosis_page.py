"""The page of a diagnosis: the result, a paragraph for each quantity with plots of its signals, injected faults."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from rig.bench.diagnose.diagnosis import Diagnosis
from rig.bench.diagnose.diagnosis_figures import points, signal_figures
from rig.bench.diagnose.paragraphs import paragraph
from rig.show.pages.page import write_page


def write(path: Path, found: Diagnosis) -> None:
    """Write the page; below 5 MB for logs of any length."""
    summary = found.summary
    lines = sum(2 * len(one.instances) + 1 for one in found.quantities.values() for _ in one.signals)
    figures: dict[str, go.Figure] = {}
    quantities: list[dict[str, Any]] = []
    for name, one in found.quantities.items():
        pairs: list[list[str]] = []
        labels = [instance.label for instance in one.instances]
        for a, (signal, verdict) in enumerate(one.signals.items()):
            if one.shown is not None:
                drawn = dict(signal_figures(signal, verdict, a, one.shown, labels, points(lines), found.zero_s))
                figures |= drawn
                pairs.append(list(drawn))
        quantities.append(
            {"name": name, "text": paragraph(one, found.zero_s).removeprefix(f"{name}: "), "pairs": pairs}
        )
    facts = {key: summary[key] for key in ("file", "title", "remarks", "warnings", "not_compared", "injected")}
    write_page(path, "diagnosis.html", figures, {}, quantities=quantities, threshold_of=found.threshold_of, **facts)
