"""The picture of the rooms in CONTRIBUTING.md, from the import contract and the imports that there are.

python tests/tools/rooms.py    # write it there
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Final

import grimp

ROOT: Final = Path(__file__).parents[2]
PAGE: Final = ROOT / "CONTRIBUTING.md"
BEGIN, END = "<!-- rooms: tests/tools/rooms.py writes this -->\n", "<!-- rooms end -->\n"


def picture() -> str:
    """Return a line for each room, from the commands down, with the rooms below it that it imports."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (rooms,) = (one["layers"] for one in contracts if one.get("containers") == ["rig"])
    graph = grimp.build_graph("rig", cache_dir=None)
    for room in rooms:
        graph.squash_module(f"rig.{room}")
    width = max(map(len, rooms))
    head = f"{'':{width}}  " + " ".join(f"{room:{width}}" for room in rooms[1:]).rstrip()
    lines = [head]
    for room in rooms[:-1]:
        below = graph.find_modules_directly_imported_by(f"rig.{room}")
        marks = [f"{'x' if f'rig.{other}' in below else '':{width}}" for other in rooms[1:]]
        lines.append(f"{room:{width}}  {' '.join(marks)}".rstrip())
    return "```\n" + "\n".join(lines) + "\n```\n"


def page_with(text: str, drawn: str) -> str:
    """Return the page with the picture in its place."""
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}{drawn}{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    PAGE.write_text(page_with(PAGE.read_text(), picture()))
