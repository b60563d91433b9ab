"""The names of before 1.0 and those of now: the one table that tells old files and reads old logs."""

from __future__ import annotations

from typing import Final

# Of a unit's records, as their layout was hashed: the name now, and the one of then.
IN_LAYOUT: Final = {
    "decided_by": "resolver",
    "DecidedBy": "Resolver",
    "tie_break": "resolvers",
    "split_persistence": "singular_persistence",
    "equalise_bound": "bias_bound",
    "equalise_gain": "bias_gain",
    "slow_faults": "lasting",
    "slow_faults_config": "lasting_config",
    "role": "form",
    "Role": "Form",
    "autopilot_command": "demand",
}
