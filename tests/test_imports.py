"""What is imported when: a command, a log or a flight does not wait for libraries that only others need."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from test_log_writer import write

from rig.studies.campaign import plan as plan_module

SHOWN = """
import json, sys
said = {}
def step(name, **more):
    said[name] = {"loaded": sorted(sys.modules), **more}
"""
# Each step in the process of those before it.
USERS = """
import rig
step("rig", public=set(rig.__all__) <= set(dir(rig)))
import rig.cli.main
step("commands")
rig.read_log(sys.argv[1])
step("log")
import rig.log.recordings.read
from rig.core.units.conversion import conversion
conversion("s", "s"), conversion("rad/s")
step("recording")
step("degrees", si=conversion("deg").si)
"""
FLIES = """
import rig.flight.loop
step("flight")
import rig.studies.campaign.run_campaign
step("campaign")
import rig.studies.search.run_search, rig.cli.main
step("search")
from pathlib import Path
from rig.show.viewer.stream import open_stream
step("no stream", stream=open_stream("off", "t", 1.0, Path("x")))
"""


@pytest.fixture(scope="module")
def steps(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, object]]:
    """What each step leaves in ``sys.modules``."""
    log, said = tmp_path_factory.mktemp("log") / "a.mcap", {}
    write(log, 250)
    for program in (USERS, FLIES):
        command = [sys.executable, "-c", f"{SHOWN}{program}print(json.dumps(said))", str(log)]
        done = subprocess.run(command, cwd=Path(__file__).parents[1], capture_output=True, text=True, check=False)
        assert done.stderr == ""
        said |= json.loads(done.stdout)
    return said


@pytest.mark.parametrize(
    ("step", "unwanted"),
    [
        ("commands", "numpy numba scipy polars rerun"),
        ("log", "numba pydantic jsbsim"),  # which take longer to be imported than ten minutes of flight to be read
        ("recording", "pint"),
        ("campaign", "scipy.stats scipy.ndimage"),  # the statistics of its report
        ("search", "cma sklearn"),
        ("no stream", "rerun"),
    ],
)
def test_what_a_step_does_not_need_is_not_loaded(steps, step: str, unwanted: str):
    assert set(unwanted.split()) & set(steps[step]["loaded"]) == set()


def test_importing_rig_loads_none_of_its_rooms(steps):
    assert [name for name in steps["rig"]["loaded"] if name.startswith("rig.")] == [] and steps["rig"]["public"]


def test_the_library_of_units_is_loaded_where_a_unit_needs_it(steps):
    assert steps["degrees"]["si"] == "rad" and "pint" in steps["degrees"]["loaded"]


def test_without_a_stream_there_is_none(steps):
    assert steps["no stream"]["stream"] is None


def test_what_decides_nothing_in_a_flight_is_named_as_it_is_and_not_imported_by_one(steps):
    """A renamed room would count as flying, and every change of it as another rig."""
    home = Path(plan_module.__file__).parents[2]
    assert [name for name in (*plan_module.BESIDE, *plan_module.FLIES) if not (home / name).exists()] == []
    beside = {f"rig.{name.removesuffix('.py').replace('/', '.')}" for name in plan_module.BESIDE}
    assert not {n for n in steps["flight"]["loaded"] if any(n == b or n.startswith(f"{b}.") for b in beside)}
