"""Design every bundled aircraft twice: both times the bytes of the files in aircraft/; ``make designs``.

Some minutes, so no part of the suite.  Names as arguments: these aircraft alone.
"""

import difflib
import subprocess
import sys
import tempfile
from pathlib import Path

from rig.scenario import aircraft

FILES = ("gains.toml", "references.toml")


def design(name: str) -> dict[str, str]:
    """What ``rig aircraft design`` writes now, by file name."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "rig", "aircraft", "design", name, "--out", f"{folder}/{FILES[0]}"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return {file: (Path(folder) / file).read_text() for file in FILES}


def difference(name: str) -> str:
    """Empty when both designs are what the files hold; else what moved."""
    once, again = design(name), design(name)
    if once != again:
        return f"{name}: two designs in a row differ"
    moved = []
    for file, text in once.items():
        kept = (aircraft.folder(name) / file).read_text()
        moved += difflib.unified_diff(kept.splitlines(), text.splitlines(), f"{name}/{file}", "now", "", "", 0, "")
    return "\n".join(moved)


def main() -> None:
    """Exit code 1 and the differences when there are any."""
    found = {name: difference(name) for name in sys.argv[1:] or aircraft.names()}
    for name, moved in found.items():
        print(f"{name}: {'differs' if moved else 'as kept'}", moved, sep="\n" if moved else "")
    sys.exit(any(found.values()))


if __name__ == "__main__":
    main()
