"""Requirements in the report of a flight: their verdicts, and the picture of their robustness over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Self

import numpy as np
import plotly.graph_objects as go

from rig.core.errors import BadInput
from rig.core.palette import series_colour
from rig.log import LogFile
from rig.scenario.scenario import Scenario
from rig.show.pages.flight_figures import DOTTED
from rig.show.pages.lines import Line, line
from rig.show.pages.page import lay_out
from rig.verdict.requirements.measure import recorder_of
from rig.verdict.requirements.requirement import load_requirements
from rig.verdict.requirements.requirement_recorder import Verdict

CUT: Final = 3.0  # the picture clips robustness here
MOST: Final = 12  # lines


@dataclass(frozen=True, slots=True)
class Robustness:
    """Verdicts, and lines by requirement and signal."""

    verdicts: tuple[Verdict, ...] = ()
    lines: tuple[tuple[str, Line], ...] = ()
    remark: str = ""  # requirements that are not measured, with the reason

    @classmethod
    def of(cls, log: LogFile, scenario: Scenario, names: Sequence[str]) -> Self:
        """Measure a log against the requirements ``names`` (sets and files) and those of the scenario.

        The page flies nothing: ``rig score`` measures requirements that need the baseline.  BadInput: unknown name.
        """
        asked = load_requirements(names)
        try:
            every = load_requirements([*names, *(scenario.requirements or ())])
            remark = ""
        except BadInput as error:
            every, remark = asked, f"requirements of the scenario not measured: {error}"
        alone = [each for each in every if not each.names_baseline]
        if late := [each.id for each in every if each.names_baseline]:
            told = f"measured by rig score, which flies the fault-free baseline: {', '.join(late)}"
            remark = f"{remark}; {told}" if remark else told
        if not alone:
            return cls(remark=remark)
        recorder = recorder_of(scenario, alone, baseline=False, lines=True)
        for block in log.blocks():
            recorder.record(block)
        verdicts = recorder.finish()
        time_s = np.arange(log.frames) / log.rate_hz
        drawn = [
            (f"{id_} {signal}".rstrip(), line(time_s, np.clip(values, -CUT, CUT)))
            for (id_, signal), values in recorder.lines().items()
        ]
        return cls(verdicts, tuple(drawn[:MOST]), remark)

    def figures(self) -> dict[str, go.Figure]:
        """Return the picture by the id of its element; empty if there is no line."""
        if not any(one.drawn for _, one in self.lines):
            return {}
        figure = go.Figure()
        for i, (name, one) in enumerate(self.lines):
            about = {"name": name, "mode": "lines", "line": {"color": series_colour(i), "width": 1.2}}
            figure.add_scatter(x=one.time_s, y=one.values, hovertemplate="%{x:.2f} s: %{y:.3g}", **about)
        figure.add_hline(y=0.0, line=DOTTED)
        lay_out(figure, "robustness of each requirement", 320)
        figure.update_xaxes(title="time, s")
        figure.update_yaxes(title="robustness", range=[-1.1 * CUT, 1.1 * CUT])
        return {"requirements": figure}
