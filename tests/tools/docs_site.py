"""Hooks of mkdocs.yml: pages from beside docs/, the version, and nothing loaded from another host.

Run by ``make docs``.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from posixpath import relpath
from typing import Any, Final

from mkdocs.exceptions import PluginError  # pyright: ignore[reportMissingImports]  # of the group docs
from mkdocs.structure.files import File  # pyright: ignore[reportMissingImports]

ROOT: Final = Path(__file__).parents[2]
PAGES: Final = {"project/contributing.md": "CONTRIBUTING.md", "project/changelog.md": "CHANGELOG.md"}
FUNCTION: Final = re.compile(r"(?<!<msup>)<mi>(sin|cos|tan|log|ln|exp|min|max)</mi>")
EQUATION: Final = re.compile(r'<math display="block".*?</math>', re.S)
LOADED: Final = re.compile(r"<(?:script|img|iframe|link)\b[^>]*\b(?:src|href)=[\"']?(?:https?:)?//[^>]*>", re.I)


def on_config(config: Any) -> Any:
    """Show the version of the project beside its name."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    config.site_name = f"{config.site_name} {version}"
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that are beside docs/, their links as seen from their place in it."""
    for name, source in PAGES.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        text = re.sub(r"\]\(docs/([^)#]+)", lambda link, name=name: f"]({relpath(link[1], Path(name).parent)}", text)
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Escape dimensions, as ``f8[16][4]``: to Markdown they are links."""
    return re.sub(r"(\w\[\d+\])\[", r"\1\\[", markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Set thin spaces around the names of functions in equations, and let wide equations scroll in their place."""
    html = FUNCTION.sub(r'<mrow><mspace width="0.167em"/><mi>\1</mi><mspace width="0.167em"/></mrow>', html)
    return EQUATION.sub(r'<div class="equation">\g<0></div>', html)


def on_post_build(config: Any) -> None:
    """Raise PluginError if a page loads a script, style, picture or frame from another host."""
    for page in Path(config.site_dir).rglob("*.html"):
        found = [tag for tag in LOADED.findall(page.read_text(encoding="utf-8")) if 'rel="canonical"' not in tag]
        if found:
            raise PluginError(f"{page}: loads from another host: {found[0][:200]}")
