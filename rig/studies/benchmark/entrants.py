"""The managers that a benchmark compares, and the setting of each that a calibration chooses.

The built-in manager takes part four times: ``cross-channel`` with the thresholds that ``rig thresholds`` designs; the
same with slow-fault tests; with tests and sums of small deviations; and with its built-in settings, the tests among
them where the aircraft or CONFIG has some.  Amounts are in thresholds of the signal in the campaign's scenario.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.baseline_managers.baseline_settings import Baselines
from rig.computer.redundancy.manager_config import PARAMS, SignalConfig, fill
from rig.computer.redundancy.managers import DEFAULT, LEARNERS, MANAGERS, Manager, manager_kind, with_settings
from rig.computer.redundancy.slow_tests_config import SlowTests
from rig.core.errors import BadInput
from rig.core.frame import CHANNELS
from rig.core.text import choices
from rig.core.trust import Trust
from rig.log.recordings.vote_config import RecordedSignal
from rig.scenario.scenario import Scenario
from rig.studies.benchmark.own_class import asks_for_data, calibrated_number

OURS: Final = DEFAULT
TESTS, TESTS_AND_SUMS, BUILT_IN = f"{OURS} tests", f"{OURS} tests and sums", f"{OURS} built-in"
DESIGNED: Final = (OURS, TESTS, TESTS_AND_SUMS)  # rows of the built-in manager that are designed for the rate
UNBOUNDED, BIAS, TUNED = "unbounded", "bias", "tuned"
LEARNED_BIAS, PERSISTENCE = "learned_bias", "persistence"  # settings
VARIANTS: Final[dict[str, dict[str, Any]]] = {  # of baseline managers, named behind one: "cusum 60 guess"
    "guess": {"ties": "guess"},
    UNBOUNDED: {"bounded": False},  # as published; outside the verdict
    "middle": {"vote": "middle"},
    BIAS: {},  # a bias of each channel is learned, up to the largest of a healthy flight
    TUNED: {},  # second_knobs.py chooses the settings that are not calibrated
    "60": {"limit": 60.0},
    "120": {"limit": 120.0},
}
_OF_A_DESIGN: Final = tuple(
    name
    for name in PARAMS.names or ()
    if name.startswith(("threshold", "slow_", "stale_", "filter_", "persistence", "split_"))
)
Values = Mapping[str, Any]  # of settings by name


class Level(NamedTuple):
    """A setting that a calibration chooses for a number of channels in use, in thresholds or in the manager's unit."""

    name: str
    channels: int
    default: float
    least: float = 0.0  # that the setting may have


class Entrant(NamedTuple):
    """One manager with its variant: one row of the benchmark."""

    name: str
    manager: str
    variant: tuple[str, ...] = ()  # of VARIANTS

    @property
    def is_ours(self) -> bool:
        """Return True for each row of the built-in manager."""
        return self.manager == OURS

    @property
    def is_own(self) -> bool:
        """Return True for a class or function of the user."""
        return ":" in self.manager

    @property
    def designed(self) -> bool:
        """Return True if ``rig thresholds`` designs the thresholds of this row."""
        return self.name in DESIGNED


class OfSignal(NamedTuple):
    """A signal of the campaign with its settings before any calibration."""

    name: str
    params: NDArray[np.void]  # (1,) config.PARAMS
    given: RecordedSignal
    baselines: Baselines
    rate_hz: float
    sensor: SlowTests | None = None  # figures of the sensor, of which slow-fault tests are designed; None: unknown

    @property
    def threshold(self) -> float:
        """Return the threshold that is the unit of amounts, in the unit of the signal."""
        return float(self.params["threshold"][0])

    @property
    def fitted(self) -> int:
        """Return the number of channels of the signal."""
        return int(self.params["fitted"][0])


def entrants(managers: str) -> list[Entrant]:
    """Return the rows for names with commas between, the built-in manager first.  BadInput: a name, or one twice."""
    names = [name.strip() for name in managers.split(",") if name.strip()]
    for name in names:
        if names.count(name) > 1:
            raise BadInput(f"--managers: {name}: given more than once")
    others = [_entrant(name) for name in names if name != OURS]
    if not others:
        raise BadInput(f"--managers: name one or more besides {OURS}: {', '.join(MANAGERS[1:])}, or module:name")
    return [*(Entrant(name, OURS) for name in (*DESIGNED, BUILT_IN)), *others]


def _entrant(name: str) -> Entrant:
    if ":" in name:
        calibrated_number(name)
        return Entrant(name, name)
    manager, *variant = name.split()
    if manager not in MANAGERS:
        raise BadInput(f"--managers: unknown manager, {choices(manager, MANAGERS)}")
    for word in variant:
        if word not in VARIANTS:
            raise BadInput(f"--managers: {name}: unknown variant, {choices(word, VARIANTS)}")
        if not _has_variant(manager, word):
            raise BadInput(f"--managers: {name}: {manager} has no variant {word!r}")
        if TUNED in variant and word in (BIAS, "60", "120"):
            raise BadInput(f"--managers: {name}: {TUNED!r} chooses what {word!r} sets; give one of them")
    return Entrant(name, manager, tuple(variant))


def _has_variant(manager: str, word: str) -> bool:
    if word in (BIAS, TUNED):
        return manager in LEARNERS and manager_kind(manager).isolates
    kind = manager_kind(manager).settings
    return kind is not None and set(VARIANTS[word]) <= set(kind.model_fields) - set(kind.levels)


def with_settings_of(signal: OfSignal, entrant: Entrant, settings: Values) -> OfSignal:
    """Return the signal with those of the ``settings`` that a baseline manager's table has; unchanged without one."""
    table = LEARNERS.get(entrant.manager)
    if table is None:
        return signal
    own = getattr(signal.baselines, table).of(signal.name)
    mine = {name: value for name, value in settings.items() if name in type(own).model_fields}
    told = signal.baselines.model_copy(update={table: own.model_copy(update={**mine, "signals": {}})})
    return signal._replace(baselines=told)


def levels(entrant: Entrant, signal: OfSignal) -> list[Level]:
    """Return the settings to calibrate; empty for the built-in manager and for one that isolates no channel."""
    if entrant.is_own:
        number = calibrated_number(entrant.manager)
        return [] if number is None else [Level(number[0], signal.fitted, number[1])]
    kind, level = manager_kind(entrant.manager).settings, manager_kind(entrant.manager).level
    if kind is None:
        return [] if level is None else [Level(level.name, signal.fitted, level.default)]
    chosen = getattr(signal.baselines, entrant.manager).of(signal.name)
    first = float(getattr(chosen, kind.levels[0])) if kind.levels else 0.0
    return [
        Level(name, CHANNELS - i, getattr(chosen, name) or first, _least(kind.model_fields[name].metadata))
        for i, name in enumerate(kind.levels)
        if CHANNELS - i <= signal.fitted
    ]


def _least(bounds: Sequence[object]) -> float:
    return max((float(getattr(bound, "ge", 0.0)) for bound in bounds), default=0.0)


def isolates_no_channel(entrant: Entrant, signal: OfSignal) -> bool:
    """Return True for a manager without a threshold, which is compared by its vote error alone."""
    designs_itself = entrant.is_own and asks_for_data(entrant.manager)
    return not entrant.is_ours and not designs_itself and not levels(entrant, signal)


def manager(entrant: Entrant, signal: OfSignal, values: Values, channels: int | None = None) -> Manager:
    """Return a manager, other than the user's, with calibrated ``values``, for ``channels`` of the signal.

    values : by the names of ``levels``; for the built-in manager fields of PARAMS, in the unit of the signal
    """
    params = signal.params.copy()
    params["fitted"] = channels or signal.fitted
    level = manager_kind(entrant.manager).level
    if level is not None and level.name in values:
        given = signal.given.model_copy(update=_keys_of(entrant, signal, values))
        for name, value in _params_of(signal, given, level.params).items():
            params[name] = value
    for name, value in values.items() if entrant.is_ours else _persistence(values).items():
        params[name] = value
    told = with_settings_of(signal, entrant, values).baselines
    return Manager(entrant.manager, with_settings(params, entrant.manager, told, [signal.name]))


def _persistence(values: Values) -> dict[str, int]:
    """Return the persistence among the settings of a baseline manager, frames; empty: that of the signal."""
    return {PERSISTENCE: values[PERSISTENCE]} if PERSISTENCE in values else {}


def _keys_of(entrant: Entrant, signal: OfSignal, values: Values) -> dict[str, float]:
    """Return the settings of the signal that give a baseline its calibrated level; empty for all others."""
    level = manager_kind(entrant.manager).level
    if level is None or level.name not in values:
        return {}
    amount = values[level.name] * signal.threshold
    return {key: factor * amount for key, factor in level.settings.items()}


def flown_by(
    scenario: Scenario, entrant: Entrant, signal: OfSignal, values: Values, keys: Mapping[str, Any]
) -> Scenario:
    """Return ``scenario`` with this manager; signals other than the calibrated one keep their settings.

    keys : the table of the signal, for the built-in manager as designed
    """
    of = scenario.redundancy
    told: dict[str, Any] = {"manager": entrant.manager}
    name = LEARNERS.get(entrant.manager)
    table = {**keys, **_keys_of(entrant, signal, values), **(_persistence(values) if name else {})}
    if name is not None:
        baseline = getattr(of.baselines, name)
        mine = {key: value for key, value in values.items() if key in type(baseline).model_fields}
        own = baseline.model_copy(update={"signals": {**baseline.signals, signal.name: mine}})
        told["baselines"] = of.baselines.model_copy(update={name: own})
    if table:
        before = getattr(of.signals, signal.name)
        now = SignalConfig(**keys) if keys else before.model_copy(update=table)
        told["signals"] = of.signals.model_copy(update={signal.name: now})
    made = scenario.model_copy(update={"redundancy": of.model_copy(update=told)})
    return made.trusted(Trust(named=entrant.manager) if entrant.is_own else scenario.trust)


def designed_values(signal: OfSignal, settings: RecordedSignal) -> dict[str, float]:
    """Return the fields of PARAMS that a design changes; references and all other fields stay those of the scenario."""
    return _params_of(signal, settings, _OF_A_DESIGN)


def _params_of(signal: OfSignal, settings: RecordedSignal, names: Sequence[str]) -> dict[str, float]:
    made = np.zeros(1, PARAMS)
    fill(made[0], settings, settings.limits, signal.fitted, settings.wraps, signal.rate_hz)
    return {name: made[name][0].item() for name in names}
