"""Kind ``reader``: every argument, option and key that names something to read, with every hostile thing in its place.

The table is complete: ``missing`` compares it with the commands' own parameters and with the keys of all settings.
"""

from __future__ import annotations

import importlib
import pkgutil
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, Final, get_args

from hostile_cases.case import Case, Draw
from hostile_cases.flags import parameters
from hostile_cases.places import FOLDER_THINGS, NAME, REFUSED, THINGS, not_for
from hostile_cases.store import Store


@dataclass(frozen=True)
class Reader:
    """A command line with X where the name stands, the sound thing that is damaged, and what else it needs."""

    argv: str
    sound: str  # of the store
    needs: tuple[str, ...] = ()  # of the store
    beside: tuple[tuple[str, str], ...] = ()  # files by name, with X in their text
    mark: str = ""  # of a folder: its file that is damaged
    long: bool = False  # sound input keeps it busy for minutes
    executable: bool = False
    named: bool = True  # a refusal names it; else something of the store may be refused before it is read

    @property
    def ending(self) -> str:
        """As the command wants it."""
        return "" if self.mark else Path(self.sound).suffix


RATES, CHAIN, HANDLING, SUITE = "rates.toml", "chain.toml", "handling.toml", "suite.toml"
_FLY, _VOTE = "--out logs", "--config vote.toml --out o.csv"
_OTHER_LOGS: Final = ("flight.ulg", "flight.bin")
_VOTES: Final = ("votes.csv", "votes.parquet", "votes.mcap")
_CAMPAIGN: Final[dict[str, Any]] = {"sound": "camp", "mark": "campaign.json"}
_CELLS: Final[dict[str, Any]] = {"sound": "cells", "mark": "campaign.json"}  # of the campaign `reliability`
_PLANT: Final = "--flights 8 --workers 1 --plant"
_SEARCHED: Final = "plant-search.json"
_SCENARIO: Final = "everything.toml"
_OWN: Final = "aircraft.toml"
_NAMES: Final = 'name = "u"\npath = "X"\n', 'name = "u"\ntransport = "udp"\ncommand = ["X"]\n'
_BESIDE: Final = 'name = "u"\npath = "noise.csv"\n'
_MAPPED: Final = "".join(f'"pitch_rate.{c}" = "X:pitch_rate.{c}"\n' for c in (1, 2))
_MAPPING: Final = f"[default]\nthreshold = 0.1\n[mapping]\n{_MAPPED}"
_BASE: Final = "\n[vary]\nseed = [1]\n"


def _log(argv: str, *needs: str) -> Reader:
    return Reader(argv, "log.mcap", needs)


def _unit(argv: str, *needs: str) -> Reader:
    return Reader(argv, "unit.toml", needs)


def _requirements(argv: str, *needs: str) -> Reader:
    return Reader(argv, HANDLING, needs)


def _tables(argv: str, *needs: str) -> tuple[Reader, ...]:
    return tuple(Reader(argv, sound, needs) for sound in ("in.csv", "in.parquet", "log.mcap"))


def _fly_beside(text: str, sound: str) -> Reader:
    """A flight of a unit whose file has this text."""
    return Reader(f"fly everything.toml {_FLY} --unit u.toml", sound, (_SCENARIO, "noise.csv"), (("u.toml", text),))


# By command and parameter; of an argument its name.
READERS: Final[dict[str, tuple[Reader, ...]]] = {
    "aircraft check name": (Reader("aircraft check X", "own", mark=_OWN, long=True),),
    "aircraft design name": (Reader("aircraft design X", "own", mark=_OWN, long=True),),
    "aircraft list folders": (Reader("aircraft list X", "own", mark=_OWN),),
    "aircraft show name": (Reader("aircraft show X", "own", mark=_OWN),),
    "cost scenario": (Reader("cost X --repeats 1", _SCENARIO, long=True),),
    "campaign compare first": (Reader("campaign compare X camp", **_CAMPAIGN, needs=("camp",)),),
    "campaign compare second": (Reader("campaign compare camp X", **_CAMPAIGN, needs=("camp",)),),
    "campaign fly --unit": (_unit("campaign fly camp --run 0 --unit X", "camp"),),
    "campaign fly folder": (Reader("campaign fly X --run 0", **_CAMPAIGN),),
    "campaign plan --unit": (_unit("campaign plan campaign.toml --unit X", "campaign.toml"),),
    "campaign plan file": (Reader("campaign plan X", "campaign.toml"),),
    "campaign report folder": (Reader("campaign report X", **_CAMPAIGN),),
    "campaign run --unit": (_unit("campaign run campaign.toml --out o --unit X", "campaign.toml"),),
    "campaign run --out": (
        Reader("campaign run campaign.toml --out X --workers 1", **_CAMPAIGN, needs=("campaign.toml",)),
    ),
    "campaign run file": (Reader("campaign run X --out o --runs 1 --workers 1", "campaign.toml"),),
    "campaign sensitivity folder": (Reader("campaign sensitivity X --of delay_s", **_CAMPAIGN),),
    "campaign status folder": (Reader("campaign status X", **_CAMPAIGN),),
    "check --unit": (_unit(f"check {SUITE} --unit X", SUITE),),
    "check suite": (Reader("check X", SUITE, long=True),),
    "diagnose --config": (Reader("diagnose in.csv --config X", "vote.toml", ("in.csv",)),),
    "diagnose recorded": (
        *_tables("diagnose X --config vote.toml", "vote.toml"),
        Reader("diagnose X --config foreign.toml", "foreign.mcap", ("foreign.toml",)),
        *(Reader("diagnose X", sound) for sound in _OTHER_LOGS),
    ),
    "diff a": (_log("diff X log.mcap", "log.mcap"),),
    "diff b": (_log("diff log.mcap X", "log.mcap"),),
    "export log": (_log("export X --to csv"), _log("export X --to parquet"), _log("export X --layout foxglove")),
    "fly --requirements": (_requirements(f"fly everything.toml {_FLY} --requirements X", _SCENARIO),),
    "fly --unit": (_unit(f"fly everything.toml {_FLY} --unit X", _SCENARIO),),
    "fly scenario": (Reader(f"fly X {_FLY}", _SCENARIO),),
    "fmu build scenario": (Reader("fmu build X --out x.fmu", _SCENARIO, long=True),),
    "info log": (_log("info X"), *(Reader("info X --topics", sound) for sound in _OTHER_LOGS)),
    "benchmark --config": (Reader("benchmark --recordings in.csv --config X", "vote.toml", ("in.csv",), long=True),),
    "benchmark --healthy": (Reader("benchmark smoke --healthy X --out o", **_CAMPAIGN, named=False, long=True),),
    "benchmark --recordings": tuple(
        Reader("benchmark --recordings X --config vote.toml", sound, ("vote.toml",), long=True)
        for sound in ("in.csv", "in.parquet")
    ),
    "benchmark --second": (
        Reader(
            "benchmark smoke --healthy camp --second X --out o", **_CAMPAIGN, needs=("camp",), named=False, long=True
        ),
    ),
    "benchmark --out": (
        Reader("benchmark smoke --healthy camp --out X", **_CAMPAIGN, needs=("camp",), named=False, long=True),
    ),
    "benchmark campaign": (Reader("benchmark X --healthy camp --out o", "campaign.toml", ("camp",), long=True),),
    "recover log": (_log("recover X --out r.mcap"),),
    "reliability confirm --aircraft": (
        Reader("reliability confirm cuts --aircraft X", "own", ("cuts",), mark=_OWN, named=False, long=True),
    ),
    "reliability cutsets --aircraft": (
        Reader("reliability cutsets --out o --aircraft X", "own", mark=_OWN, long=True),
    ),
    "study servo --aircraft": (Reader("study servo --aircraft X", "own", mark=_OWN, long=True),),
    "reliability chain file": (Reader("reliability chain X", CHAIN),),
    "reliability confirm folder": (Reader("reliability confirm X", "cuts", mark="cutsets.json", long=True),),
    "reliability cutsets --out": (Reader("reliability cutsets --out X", "cuts", mark="cutsets.json", long=True),),
    "reliability fmea --rates": (Reader("reliability fmea cells --rates X --out f.csv", RATES, ("cells",)),),
    "reliability fmea folders": (
        Reader(f"reliability fmea X --rates {RATES} --out f.csv", **_CELLS, needs=(RATES,)),
        Reader(f"reliability fmea X --rates {RATES} --out f.html", **_CELLS, needs=(RATES,)),
    ),
    "reliability false-isolations --scenario": (
        Reader("reliability false-isolations pitch_rate --scenario X", _SCENARIO, long=True),
    ),
    "reliability plan --rates": (Reader("reliability plan --target 1e-7 --rates X", RATES),),
    "reliability report --cells": (
        Reader(
            f"reliability report cuts --cells X --faults cells --rates {RATES} --signal pitch_rate --out r.html",
            **_CELLS,
            needs=("cells", "cuts", RATES),
        ),
    ),
    "reliability report --faults": (
        Reader(
            f"reliability report cuts --cells cells --faults X --rates {RATES} --signal pitch_rate --out r.html",
            **_CELLS,
            needs=("cells", "cuts", RATES),
        ),
    ),
    "reliability report --rates": (
        Reader(
            "reliability report cuts --cells cells --faults cells --rates X --signal pitch_rate --out r.html",
            RATES,
            ("cells", "cuts"),
        ),
    ),
    "reliability report folder": (
        Reader(
            f"reliability report X --cells cells --faults cells --rates {RATES} --signal pitch_rate --out r.html",
            "cuts",
            ("cells", RATES),
            mark="cutsets.json",
        ),
    ),
    "reliability run --rates": (Reader("reliability run cells --signal pitch_rate --rates X", RATES, ("cells",)),),
    "reliability run folders": (
        Reader(f"reliability run X --signal pitch_rate --rates {RATES}", **_CELLS, needs=(RATES,)),
    ),
    "reliability tree --rates": (
        Reader("reliability tree cells --rates X --signal pitch_rate --out t.xml", RATES, ("cells",)),
    ),
    "reliability tree folders": (
        Reader(f"reliability tree X --rates {RATES} --signal pitch_rate --out t.xml", **_CELLS, needs=(RATES,)),
    ),
    "reliability trials --out": (
        Reader("reliability trials smoke --runs 9 --out X", "trials", mark="trials.json", long=True),
    ),
    "reliability trials campaign": (Reader("reliability trials X --runs 9 --out o", "campaign.toml", long=True),),
    "replay --redundancy": (Reader("replay log.mcap --redundancy X", "redundancy.toml", ("log.mcap",)),),
    "replay --unit": (_unit("replay log.mcap --unit X", "log.mcap"),),
    "replay log": (_log("replay X"), _log("replay X --set redundancy.manager=median --out r.mcap")),
    "report --requirements": (_requirements("report log.mcap --requirements X --out r.html", "log.mcap"),),
    "report log": (_log("report X --out r.html"), _log("report X")),
    "scenario check scenario": (Reader("scenario check X", _SCENARIO),),
    "scenario show scenario": (Reader("scenario show X", _SCENARIO),),
    "score --requirements": (_requirements("score log.mcap --no-baseline --requirements X", "log.mcap"),),
    "score --unit": (_unit("score log.mcap --unit X", "log.mcap"),),
    "score log": (_log("score X --no-baseline"),),
    "search --out": (
        Reader("search worst-pitch-rate --requirement vote --flights 40 --out X", **_CAMPAIGN, long=True),
        Reader(f"search tank.toml {_PLANT}=tank.py:tank --out X", "tanked", ("tank.toml", "tank.py"), mark=_SEARCHED),
    ),
    "search --plant": (Reader(f"search tank.toml {_PLANT}=X:tank --out o", "tank.py", ("tank.toml",)),),
    "search --requirements": (_requirements("search smoke --requirement vote --flights 9 --out o --requirements X"),),
    "search --unit": (
        Reader("search worst-pitch-rate --requirement vote --flights 40 --out o --unit X", "unit.toml", long=True),
    ),
    "search campaign": (
        Reader("search X --requirement vote --flights 9 --out o", "campaign.toml", long=True),
        Reader(f"search X {_PLANT}=tank.py:tank --out o", "tank.toml", ("tank.py",)),
    ),
    "thresholds --config": (
        Reader("thresholds in.csv --config X --budget 1 --out t.toml", "vote.toml", ("in.csv",), long=True),
    ),
    "thresholds --monitored": tuple(
        Reader(
            "thresholds in.csv --config vote.toml --budget 1 --out t.toml --monitored X",
            sound,
            ("in.csv", "vote.toml"),
            named=False,
            long=True,
        )
        for sound in ("in.csv", "in.parquet")
    ),
    "thresholds inputs": tuple(
        Reader("thresholds X --config vote.toml --budget 1 --out t.toml", sound, ("vote.toml",), long=True)
        for sound in ("in.csv", "in.parquet", "log.mcap")
    ),
    "unit check file": (_unit("unit check X"),),
    "view --requirements": (_requirements("view log.mcap --save v.rrd --requirements X", "log.mcap"),),
    "view --config": (Reader("view in.csv --config X --save v.rrd", "vote.toml", ("in.csv",)),),
    "view logs": (
        *(_log("view X --save v.rrd"), _log("view log.mcap X --save v.rrd", "log.mcap")),
        *_tables("view X --config vote.toml --save v.rrd", "vote.toml"),
        *(Reader("view X --save v.rrd", sound) for sound in (*_OTHER_LOGS, *_VOTES)),
    ),
    "vote --config": (Reader("vote in.csv --config X --out o.csv", "vote.toml", ("in.csv",)),),
    "vote --inject": (Reader(f"vote in.csv {_VOTE} --inject X", _SCENARIO, ("in.csv", "vote.toml")),),
    "vote --requirements": (
        _requirements(
            f"vote in.csv {_VOTE} --inject everything.toml --requirements X", "in.csv", "vote.toml", _SCENARIO
        ),
    ),
    "vote recorded": (
        *_tables(f"vote X {_VOTE}", "vote.toml"),
        Reader("vote X --config vote.toml --out o.parquet", "in.csv", ("vote.toml",)),
        Reader("vote X --config foreign.toml --out o.csv", "foreign.mcap", ("foreign.toml",)),
        *(Reader("vote X --out o.csv", sound) for sound in _OTHER_LOGS),
    ),
    "watch log": (_log("watch X --speed 1000"),),
}
# By settings model and key.
KEYS: Final[dict[str, tuple[Reader, ...]]] = {
    "Sensor.noise_file": (
        Reader(f"fly everything.toml {_FLY} --set sensors.pitch_rate.noise_file=X", "noise.csv", (_SCENARIO,)),
    ),
    "Scenario.aircraft": (
        Reader(f"fly everything.toml {_FLY} --set aircraft=X", "own", (_SCENARIO,), mark="gains.toml"),
    ),
    "Scenario.requirements": (
        Reader(f"fly s.toml {_FLY}", HANDLING, beside=(("s.toml", 'duration_s = 0.3\nrequirements = ["X"]\n'),)),
    ),
    "Unit.path": (
        Reader(f"fly everything.toml {_FLY} --unit u.toml", "noise.csv", (_SCENARIO,), (("u.toml", _NAMES[0]),)),
        Reader("unit check u.toml", "noise.csv", (), (("u.toml", f'transport = "fmu"\n{_NAMES[0]}'),)),
    ),
    "Unit.command": (
        Reader(
            f"fly everything.toml {_FLY} --unit u.toml",
            "noise.csv",
            (_SCENARIO,),
            (("u.toml", _NAMES[1]),),
            executable=True,
        ),
    ),
    "Unit.files": (_fly_beside(f'{_BESIDE}files = ["X"]\n', "noise.csv"),),
    "Unit.environment": (_fly_beside(f'{_BESIDE}[environment]\nLD_PRELOAD = "${{folder}}/X"\n', "noise.csv"),),
    "Unit.voter": (_fly_beside(f'{_BESIDE}role = "control-law"\nvoter = "X"\n', "unit.toml"),),
    "Campaign.base": (Reader("campaign plan c.toml", _SCENARIO, beside=(("c.toml", f'base = "X"{_BASE}'),)),),
    "Campaign.requirements": (
        Reader(
            "campaign plan c.toml", HANDLING, beside=(("c.toml", f'base = "f16_adc"\nrequirements = ["X"]{_BASE}'),)
        ),
    ),
    "Case.scenario": (
        Reader(
            "check s.toml",
            _SCENARIO,
            beside=(("s.toml", 'requirements = ["handling"]\n[[cases]]\nscenario = "X"\n'),),
            long=True,
        ),
    ),
    "Case.log": (
        Reader("check s.toml", "log.mcap", beside=(("s.toml", 'requirements = ["handling"]\n[[cases]]\nlog = "X"\n'),)),
    ),
    "Case.campaign": (
        Reader(
            "check s.toml",
            "campaign.toml",
            beside=(("s.toml", 'requirements = ["handling"]\n[[cases]]\ncampaign = "X"\n'),),
            long=True,
        ),
    ),
    "Case.requirements": (
        Reader(
            "check s.toml",
            HANDLING,
            ("log.mcap",),
            (("s.toml", '[[cases]]\nlog = "log.mcap"\nrequirements = ["X"]\n'),),
        ),
    ),
    "_File.requirements": (
        Reader(
            "check s.toml",
            HANDLING,
            ("log.mcap",),
            (("s.toml", 'requirements = ["X"]\n[[cases]]\nlog = "log.mcap"\n'),),
        ),
    ),
    "VoteConfig.mapping": tuple(
        Reader("vote . --config v.toml --out ../tmp/o.csv", sound, beside=(("v.toml", _MAPPING),))
        for sound in ("in.csv", "in.parquet")
    ),
}
# What names no file to read: parameters by their names, and keys of settings.
WRITES: Final = {"out", "write", "save", "screenshot", "page", "plot", "junit", "report", "chain", "svg"}
_PARAMETERS: Final = """
    against base channels checks conditions filters fmu good_before hours kind lane layout levels logs managers
    method persistence point points preset requirement rerun scheduler sensor_class sets signal signals slow_faults
    surface tab threshold
    to tolerance
"""
OTHER_PARAMETERS: Final = {  # other parameters ``name`` read one; files below ``--read`` are those of the commands
    *("aircraft new name", "diagnose --inject", "mcp --read"),
    *("campaign run --of", "campaign run --by", "campaign sensitivity --of"),
    *("campaign plan --until", "campaign run --until"),
    *_PARAMETERS.split(),
}
_KEYS: Final = """
    accuses address after airspeed_errors autopilot_margins base_model below beta_source box_source boxes by cases
    causes channel class_ constants default discrete distribution errors false_isolations_source faults flight_point
    formula from_ held id inputs key kinds kinds_source law logs lost_margins manager manoeuvre_source name
    noise_sha256 of outputs parameters position properties rotation separator set signal signals source start
    stick_margins text time time_column time_unit times title to triads unit vary when without worst_in
"""
TOOLS: Final = "rig.cli.mcp_tools"  # whose keys are arguments of the commands
OTHER_KEYS: Final = set(_KEYS.split())


def missing() -> list[str]:
    """What reads or may read a file, by its type, and is neither in the table nor among what does not."""
    names = [(f"{command} {option or name}", name) for command, option, name, kind in parameters() if _is_text(kind)]
    lacking = [
        key for key, name in names if key not in READERS and name not in WRITES and not {key, name} & OTHER_PARAMETERS
    ]
    gone = [key for key in READERS if key not in dict(names)]
    keys = _keys_of_text()
    return [
        *lacking,
        *(key for key in keys if key not in KEYS and key.partition(".")[2] not in OTHER_KEYS),
        *(f"{key}: is there no more" for key in [*gone, *(key for key in KEYS if key not in keys)]),
    ]


def _is_text(annotation: Any) -> bool:
    inside = get_args(annotation)
    return any(map(_is_text, inside)) if inside else annotation in (str, Path)


def _keys_of_text() -> list[str]:
    """Model and name of every key of all settings that holds a text."""
    import rig
    from rig.core.settings import Settings

    for module in pkgutil.walk_packages(rig.__path__, "rig."):
        if not module.name.endswith(("__main__", "fmu_host", "guard", "host", "warmed")):
            importlib.import_module(module.name)
    return [
        f"{model.__name__}.{name}"
        for model in _below(Settings)
        for name, field in model.model_fields.items()
        if model.__module__.startswith("rig.") and model.__module__ != TOOLS and _is_text(field.annotation)
    ]


def _below(model: Any) -> Iterator[Any]:
    for below in model.__subclasses__():
        yield below
        yield from _below(below)


@cache
def pairs() -> list[tuple[str, int, str]]:
    """(key, number of its reader, thing) of all cases."""
    return [
        (key, number, thing)
        for key, readers in {**READERS, **KEYS}.items()
        for number, one in enumerate(readers)
        for thing in (FOLDER_THINGS if one.mark else THINGS)
        if not not_for(one, thing)
    ]


def reader(draw: Draw, store: Store) -> Case:
    """One reader, one thing: each once before any comes again."""
    return case_of(draw, store, *draw.turn(pairs()))


def case_of(draw: Draw, store: Store, key: str, number: int, thing: str) -> Case:
    """The case of a pair."""
    one = {**READERS, **KEYS}[key][number]
    name = f"odd\udce9{one.ending}" if thing == NAME else f"hostile{one.ending}"
    argv, seed = (
        tuple(name if w == "X" else w.replace("=X", f"={name}") for w in shlex.split(one.argv)),
        draw.rng.random(),
    )

    def make(folder: Path) -> None:
        for needed in one.needs:
            if needed != name:
                store.copy(needed, folder)
        for other, text in one.beside:
            (folder / other).write_text(text.replace("X", name))
        (FOLDER_THINGS if one.mark else THINGS)[thing](folder / name, store.folder / one.sound, one.mark, Random(seed))
        if one.executable and (folder / name).is_file() and not (folder / name).is_symlink():
            (folder / name).chmod(0o755)

    must = "" if thing not in REFUSED else "hostile|/sparse|/pipe" if one.named else "error"  # where a link leads
    may_run = one.sound == "unit.toml"  # names a class, and to name the file is permission
    return draw.case(argv, f"{key}: {thing}", make, leave=may_run, refused=must)
