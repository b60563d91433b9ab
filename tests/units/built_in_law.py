"""The rig's own control law as one outside: from rig_law_input alone, with a state of its own."""

from typing import Any

from rig.computer.control.autopilot import Control
from rig.computer.control.law import control_law
from rig.core.frame import nested, new_block
from rig.core.kernels import bind
from rig.scenario.scenario import Scenario
from rig.unit.unit_records import OF_LAW

flown: list[Scenario] = []  # by a test, which puts it there


class BuiltIn:
    def __init__(self, config: Any) -> None:
        (scenario,) = flown
        limits = scenario.airframe.surface_limits
        self.law = Control(scenario.control, scenario.gains, scenario.rate_hz, limits)
        self.law.reset(config["trim_surface"])
        self.rows = new_block(2)
        parts = nested(self.rows)
        self.bus, self.fcc = parts["bus"][0], parts["fcc"][0]
        self.fly = bind(control_law, self.bus, self.fcc, self.law.data)

    def step(self, asked: Any) -> Any:
        for name in OF_LAW:
            self.rows[name][0] = asked[name]
        self.fly(self.bus, self.fcc, self.law.data)
        return self.fcc["surface"]


class Stronger(BuiltIn):
    def step(self, asked: Any) -> Any:
        return super().step(asked) * [1.01, 1.0, 1.0, 1.0]
