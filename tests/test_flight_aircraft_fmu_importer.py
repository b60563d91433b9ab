"""The FMU of an aircraft in an importer that is not FMPy: libcosim, in C++, by its package for Python."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from fmu_master import INPUTS, OUTPUTS

from rig.core.frame import CHANNELS
from rig.flight.aircraft_fmu.aircraft_archive import build
from rig.flight.loop import fly_rows
from rig.scenario.scenario import load

needs_libcosim = pytest.mark.skipif(
    any(find_spec(name) is None for name in ("libcosimpy", "pythonfmu")), reason="no libcosimpy or pythonfmu"
)


@pytest.mark.long
@needs_libcosim
@pytest.mark.parametrize(
    ("name", "sets"),
    [
        ("f16_altitude_step_turbulence", ()),
        ("f16_elevator_coil_hardover", ("faults.0.start_s=3",)),
        ("b737_rudder_oscillation", ("faults.0.start_s=3",)),
    ],
)
def test_every_output_in_libcosim_has_the_bits_of_the_flight(tmp_path: Path, name: str, sets: tuple[str, ...]):
    from libcosimpy.CosimEnums import CosimVariableType  # pyright: ignore[reportMissingImports]
    from libcosimpy.CosimExecution import CosimExecution  # pyright: ignore[reportMissingImports]
    from libcosimpy.CosimManipulator import CosimManipulator  # pyright: ignore[reportMissingImports]
    from libcosimpy.CosimObserver import CosimObserver  # pyright: ignore[reportMissingImports]
    from libcosimpy.CosimSlave import CosimLocalSlave  # pyright: ignore[reportMissingImports]

    sets = (*sets, "duration_s=10")
    build(name, tmp_path / "aircraft.fmu", "2", sets)
    rows = fly_rows(load(name, sets))
    execution = CosimExecution.from_step_size(step_size=10_000_000)  # ns
    at = execution.add_local_slave(CosimLocalSlave(fmu_path=str(tmp_path / "aircraft.fmu"), instance_name="aircraft"))
    given, seen = CosimManipulator.create_override(), CosimObserver.create_last_value()
    assert execution.add_manipulator(given) and execution.add_observer(seen)
    variables = execution.slave_variables(at)
    of = {variable.name.decode(): variable for variable in variables}
    surfaces = [of[name].reference for name in INPUTS]
    reads = {
        CosimVariableType.REAL: seen.last_real_values,
        CosimVariableType.INTEGER: seen.last_integer_values,
        CosimVariableType.BOOLEAN: seen.last_boolean_values,
    }
    wrong = set[str]()
    for k in range(len(rows) - 1):
        given.slave_real_values(at, surfaces, rows["surface"][k].tolist())
        assert execution.step()
        for base, (field, where) in OUTPUTS.items():
            many = [f"{base}[{c + 1}]" for c in range(CHANNELS)] if f"{base}[1]" in of else [base]
            values = reads[CosimVariableType(of[many[0]].type)](at, [of[one].reference for one in many])
            wanted = np.atleast_1d(rows[field][k + 1][where])
            if np.array(values).astype(wanted.dtype).tobytes() != wanted.tobytes():
                wrong.add(f"{k + 1}: {base}")
    assert len(rows) == 1000 and wrong == set()
