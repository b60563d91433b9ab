"""The table of the commands of ``rig``: name, panel of the help, where each is, and what it is for."""

from __future__ import annotations

from typing import Final

from rig.cli.on_demand import Entry

FLY, LOOK, SCORE = "Fly", "View and report", "Score and replay"
RECORDED, MANY, REFERENCE = "Recorded data", "Many flights", "Reference"
COMMANDS: Final = (  # in the order of the help; its panels stand in the order of their first command
    Entry("fly", FLY, "fly:fly", "Fly one scenario, log each frame, and print the outcome."),
    Entry(
        "mcp",
        FLY,
        "mcp:mcp",
        "Serve tools to an agent over standard input and output (Model Context Protocol): fly, explain, score and "
        "others.",
    ),
    Entry(
        "view",
        LOOK,
        "view:view",
        "Show flights or votes in Rerun: in a window, or by --save, --serve or --screenshot.",
    ),
    Entry(
        "report",
        LOOK,
        "score:report",
        "Write the report of a flight as one HTML page that opens offline and can be printed.",
    ),
    Entry("watch", LOOK, "view:watch", "Play a log back in the terminal: channels, votes and events. Ctrl-C ends it."),
    Entry(
        "info",
        LOOK,
        "replay:info",
        "Print the scenario, outcome, events and versions of a log, and whether the file is complete.",
    ),
    Entry(
        "score",
        SCORE,
        "score:score",
        "Score a flight against the true values: detected and missed faults, false isolations, votes and transients.",
    ),
    Entry(
        "replay",
        SCORE,
        "replay:replay",
        "Run the redundancy manager and the actuator monitors again on the recorded inputs, and compare each frame.",
    ),
    Entry("diff", SCORE, "replay:diff", "Compare two logs field by field, and print the largest differences."),
    Entry(
        "diagnose",
        RECORDED,
        "diagnose:diagnose",
        "Find out which sensor of a recording was wrong, since when, and whether the manager would have isolated it.",
    ),
    Entry(
        "vote",
        RECORDED,
        "recordings:vote",
        "Vote recorded channels with the redundancy manager, and print which channels it isolates.",
    ),
    Entry(
        "thresholds",
        RECORDED,
        "recordings:thresholds",
        "Design thresholds from healthy recordings, so that false isolations stay within an hourly rate.",
    ),
    Entry(
        "export",
        RECORDED,
        "replay:export",
        "Write a log as a table with the column names of rig vote, or write a viewer's layout for the log.",
    ),
    Entry(
        "recover",
        RECORDED,
        "replay:recover",
        "Recover a log that was cut off: keep each complete chunk, and write a new summary.",
    ),
    Entry(
        "check",
        MANY,
        "check:check",
        "Check the scenarios, logs and campaigns of a suite against requirements and reference decisions.",
    ),
    Entry(
        "search",
        MANY,
        "search:search",
        "Find clusters of flights that violate a requirement, confirm them on new seeds, and minimise their scenarios.",
    ),
    Entry(
        "benchmark",
        MANY,
        "benchmark:benchmark",
        "Compare redundancy managers at one false-isolation rate and with the same faults.",
    ),
    Entry(
        "signals",
        REFERENCE,
        "catalogue:signals",
        "List the signals and discretes with symbol, unit, range and number of channels.",
    ),
    Entry(
        "cost",
        REFERENCE,
        "fly:cost",
        "Measure the time of a frame with logging, and print its ratio to bare JSBSim in the same process.",
    ),
    Entry("scenario", FLY, "catalogue:scenario_app", "List, show and check scenarios."),
    Entry(
        "aircraft",
        FLY,
        "aircraft:aircraft_app",
        "List, show and make aircraft, check them, and design their control laws.",
    ),
    Entry("campaign", MANY, "campaign:app", "Plan, fly, report and compare campaigns of many flights."),
    Entry("faults", REFERENCE, "catalogue:faults_app", "List and show the kinds of faults."),
    Entry("study", MANY, "studies:study", "Reproduce published results."),
    Entry(
        "unit",
        FLY,
        "unit:unit_app",
        "Print the interface records (ICD) of a unit under test, and test a unit against them.",
    ),
    Entry(
        "fmu",
        FLY,
        "fmu:fmu_app",
        "Build the aircraft, with its sensors and faults, as an FMU for another simulation tool.",
    ),
    Entry(
        "reliability",
        MANY,
        "safety:reliability_app",
        "Compute the probability of failure per flight hour, from failure rates and flown faults.",
    ),
)
