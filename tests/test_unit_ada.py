"""A unit in Ada, with the records that the rig writes for Ada: it compiles, and flies the bits of that in C."""

import sys
from pathlib import Path

import outside
from unit_files import build, unit, written

import rig

SHORT = ("duration_s=2", "faults.0.start_s=0.5")


@outside.needs("ada")
def test_the_smallest_unit_in_ada_flies_the_bits_of_that_in_c(tmp_path: Path):
    library = build("libfirst_valid_ada.so", RIG=str(Path(sys.executable).with_name("rig")))
    tested = written(tmp_path, {"name": "ada", "path": str(library)})
    flights = [rig.fly(overrides=SHORT, out=tmp_path, unit=one) for one in (unit(tmp_path, "first_valid"), tested)]
    assert flights[0].digest == flights[1].digest
    assert flights[0].digest != rig.fly(overrides=SHORT, out=tmp_path).digest
