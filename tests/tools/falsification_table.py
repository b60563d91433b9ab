"""The automatic transmission of the ARCH-COMP falsification benchmarks: simulations until a violation.

    python tests/tools/falsification_table.py [--repetitions 20] [--simulations 300] [--only AT1,AT2]

Writes docs/results/falsification.md; with --only it prints the rows and writes nothing.  Each repetition has another
seed, and ends at its first violation.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from statistics import mean, median
from typing import Final

from rig.core.interrupt import Stop
from rig.studies.search.plants.plant_file import PlantPlan, read_plan
from rig.studies.search.plants.plant_rounds import PlantFolder, Simulated, Simulating, first_violation
from rig.studies.search.plants.plant_space import space_of
from rig.studies.search.plants.plant_subject import PlantSubject
from rig.studies.search.plants.plant_workers import Here
from rig.studies.search.plants.run_plant_search import PlantAsked, first_columns, simulate_all
from rig.studies.search.rounds import Draw

ROOT: Final = Path(__file__).parents[2]
PLANTS: Final = ROOT / "docs/examples/plants"
PAGE: Final = ROOT / "docs/results/falsification.md"
FREE_PIECES: Final = 20  # of a signal in instance 1; in instance 2 they are those of the plan
METHODS: Final = ("regions", "random")
HEAD: Final = """# Falsification benchmarks

This page shows how many simulations the [search over a plant](../how-to/search-any-plant.md) takes until a requirement
of the automatic transmission and of the F-16 of the ARCH-COMP falsification category is violated. Beside it: uniform
random inputs.

Sources: B. Hoxha, H. Abbas, G. Fainekos, *Benchmarks for temporal logic requirements for automotive systems*, ARCH 2014
(model, requirements); G. Ernst and others, *ARCH-COMP 2020 category report: Falsification*, EPiC Series in Computing,
volume 74, 2020, pp. 140-152 (rules). We wrote the model from its published equations and tables:
`docs/examples/plants/automatic_transmission.py`.

- **Instance 1** leaves the inputs free. We chose {free} constant pieces of 2.5 s for throttle and brake.
- **Instance 2** lets them change every 5 s: 10 pieces.
- {repetitions} repetitions of at most {simulations} simulations, seeds 0 to {last}. *Mean* and *median* are of the
  repetitions with a violation.
- Again: `python tests/tools/falsification_table.py --repetitions {repetitions}`. It took {minutes:.0f} minutes on one
  core.
"""
TAIL: Final = """
## F16

The F-16 with ground collision avoidance dives; its autopilot levels the wings and pulls. `always[0, 15] altitude > 0`
is searched over the initial roll, pitch and yaw angles. The code is not part of the rig:
[what is needed](../how-to/search-any-plant.md#a-plant-whose-code-is-elsewhere).

Sources: P. Heidlauf, A. Collins, M. Bolender, S. Bak, *Verification challenges in F-16 ground collision avoidance and
other automated maneuvers*, ARCH 2018 (model; Python code: github.com/stanleybak/AeroBenchVVPython); the benchmark files
of the category, `models/F16/README.txt`, as in github.com/MoonLightSuite/arch-comp-benchmarks (ranges, requirement).

The public set-ups differ in the initial altitude: 2338 ft in these files, 2330 ft in the example of the tool
Psy-TaLiRo, 4040 ft in older ones. We ran commit afa9f0a (29 October 2020) with its Morelli model, the gains `old` and
its step of 1/30 s, from the mode `roll`. Three seeds, 0 to 2, at most 300 simulations; each cell lists the number of
the first simulation that violates, by seed:

| initial altitude | falsified | first violation | random: falsified | first violation |
|---|---|---|---|---|
| 2330 ft | 3 of 3 | 49, 33, 33 | 2 of 3 | none, 62, 63 |
| 2338 ft | 3 of 3 | 74, 32, 43 | 0 of 3 | - |

- The search with seed 0 from 2330 ft took 45 s with one worker. 116 of its 300 simulations violate; the lowest altitude
  is -8.5 ft. All 116 have a roll angle of 0.866 rad or more and a pitch angle in the lowest 1 % of its range. At the
  corners of the ranges, the yaw angle makes no difference.
- **The violations depend on the step.** The autopilot changes its mode only at the steps, and one step later the
  aircraft is about 20 ft lower. With a step of 1/300 s, five flights from 2330 ft at the lowest pitch angle and roll
  angles of 0.85 to 0.89 rad stay above the ground by 0.2 ft or more.
- From 4040 ft, the aircraft stays above 1700 ft at the corners of the ranges.
- Three seeds are few, and this is the Python code: the category simulates the Simulink model.

## What it shows

- `AT2` and `AT6a` to `AT6c` have a slope, and the search follows it.
- **Where the search is behind:** `AT1` needs full throttle for 20 s, a corner of the space to which robustness leads
  slowly. `AT51` to `AT54` compare the gear: robustness shows no direction there, and the search takes about one and a
  half to five times as many simulations as random inputs. Its first signals have few parts, which change gears seldom.
  With the most parts first (5 repetitions), `AT53` takes 1 simulation in place of 5 in instance 1, but `AT6a` takes 72
  in place of 21; so the few parts come first.
- **Published results of other tools are not listed.** We could not confirm the figures, and those tools simulate the
  Simulink model.
- The other models of the category are not here.
"""


class _Found(Exception):
    """A violation, with which a repetition ends."""


def plan_of(instance: int) -> PlantPlan:
    """Return the plan with the inputs of an instance."""
    plan = read_plan(PLANTS / "automatic_transmission.toml")
    if instance == 2:
        return plan
    free = {name: of.model_copy(update={"pieces": FREE_PIECES}) for name, of in plan.signals.items()}
    return plan.model_copy(update={"signals": free})


def simulations_until(plan: PlantPlan, asked: PlantAsked, runner: Here) -> int | None:
    """Return the number of the first simulation that violates; None: none does."""
    space, stop = space_of(plan), Stop()
    columns = first_columns(space, runner, asked.seed, stop)
    subject = PlantSubject(plan.chosen(asked.requirements), columns, plan.rate_hz, plan.duration_s)
    results: list[Simulated] = []

    def told(_: Sequence[Draw], found: Sequence[Simulated]) -> None:
        results.extend(found)
        if first_violation(results):
            raise _Found

    with suppress(_Found):
        simulate_all(Simulating(space, subject, runner, PlantFolder(None, {}), stop), asked, told)
    return first_violation(results)


def row(plan: PlantPlan, name: str, repetitions: int, simulations: int, runner: Here) -> list[str]:
    """Return the cells of a requirement: for each method how often it was violated, mean and median."""
    cells = [name]
    for method in METHODS:
        every = [
            simulations_until(plan, PlantAsked(simulations, (name,), method, seed), runner)
            for seed in range(repetitions)
        ]
        found = [count for count in every if count is not None]
        cells += [f"{len(found)} of {repetitions}"]
        cells += [f"{mean(found):.1f}", f"{median(found):g}"] if found else ["-", "-"]
    return cells


def main() -> int:
    """Measure all rows; write the page, or print the rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=20)
    parser.add_argument("--simulations", type=int, default=300)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    sys.path.insert(0, str(PLANTS))
    from automatic_transmission import transmission  # pyright: ignore[reportMissingImports]

    began, runner = time.perf_counter(), Here(transmission, 60.0)
    lines = []
    for instance in (1, 2):
        plan = plan_of(instance)
        lines += ["", f"## Instance {instance}", ""]
        lines += [
            "| requirement | falsified | mean | median | random: falsified | mean | median |",
            "|---|" + "---|" * 6,
        ]
        for each in plan.requirements:
            if not given.only or each.id in given.only.split(","):
                cells = row(plan, each.id, given.repetitions, given.simulations, runner)
                lines.append(f"| {' | '.join(cells)} |")
                print(instance, lines[-1], f"{time.perf_counter() - began:.0f} s", flush=True)
    if not given.only:
        took = (time.perf_counter() - began) / 60.0
        about = {"repetitions": given.repetitions, "simulations": given.simulations, "last": given.repetitions - 1}
        head = HEAD.format(free=FREE_PIECES, minutes=took, **about)
        PAGE.write_text("\n".join([head.rstrip(), *lines, ""]) + TAIL)
    return 0


if __name__ == "__main__":
    sys.exit(main())
