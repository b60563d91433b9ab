"""Hooks of mkdocs.yml: README and CONTRIBUTING become pages, and the site may load nothing from another host.

Run by ``make docs``.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

from mkdocs.exceptions import PluginError  # pyright: ignore[reportMissingImports]  # of the group docs
from mkdocs.structure.files import File  # pyright: ignore[reportMissingImports]

ROOT: Final = Path(__file__).parents[2]
PAGES: Final = {"index.md": "README.md", "contributing.md": "CONTRIBUTING.md"}
LOADED: Final = re.compile(r"<(?:script|img|iframe|link)\b[^>]*\b(?:src|href)=[\"']?(?:https?:)?//[^>]*>", re.I)


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that lie beside docs/, their links as seen from within it."""
    for name, source in PAGES.items():
        text = (ROOT / source).read_text(encoding="utf-8").replace("](docs/", "](")
        for page, path in PAGES.items():
            text = text.replace(f"]({path}", f"]({page}")
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Escape dimensions, as ``f8[16][4]``: to the API reference they are links."""
    return re.sub(r"(\w\[\d+\])\[", r"\1\\[", markdown)


def on_post_build(config: Any) -> None:
    """PluginError: a page loads a script, style, picture or frame from another host."""
    for page in Path(config.site_dir).rglob("*.html"):
        found = [tag for tag in LOADED.findall(page.read_text(encoding="utf-8")) if 'rel="canonical"' not in tag]
        if found:
            raise PluginError(f"{page}: loads from another host: {found[0][:200]}")
