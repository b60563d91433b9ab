"""Fault trees beside their chains: `python tests/tools/safety_cases.py` prints a table for a release.

Beside ours stand the digits of SCRAM, where it is installed.
"""

import shutil
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from test_safety_tree import CASES, HOURS, ORDER_DECIDES, TWINS, model, scram

from rig.studies.safety.mode_tree import mode_chain, mode_tree
from rig.studies.safety.signal_chain import transitions
from rig.studies.safety.signal_tree import signal_tree
from rig.studies.safety.tree_result import solve


def main() -> None:
    """Print tree, SCRAM, chain, difference and direct sum of every case."""
    trees = {name: (signal_tree(of), transitions(of)) for name, of in CASES.items()}
    trees |= {
        f"order, {rate:g} an hour": (signal_tree(of), transitions(of))
        for rate in (1e-5, 1e-4, 1e-3, 2e-3)
        for of in [model(per_hour=rate, beta=0.01, **ORDER_DECIDES)]
    }
    trees["stuck together"] = mode_tree(TWINS), mode_chain(TWINS)
    print(f"{'case':22} {'hours':>5} {'tree':>12} {'SCRAM':>12} {'chain':>12} {'differs':>10} {'direct sum':>11}")
    with tempfile.TemporaryDirectory() as folder:
        for name, (tree, chain) in trees.items():
            for at in solve(tree, chain, HOURS, {}).at:
                other = f"{scram(tree, at.hours, Path(folder)):.6g}" if shutil.which("scram") else "-"
                print(
                    f"{name:22} {at.hours:5g} {at.tree:12.6g} {other:>12} {at.chain:12.6g} {100 * at.differs:+9.4f}% "
                    f"{100 * at.sum_differs:+10.2f}%"
                )


if __name__ == "__main__":
    main()
