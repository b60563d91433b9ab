"""Run the code cells of a notebook in this process and keep what they show: ``python tests/tools/notebook.py FILE``.

No Jupyter: a cell's last expression is shown as text, as the HTML of ``_repr_html_``, or as a picture of a figure.
"""

from __future__ import annotations

import ast
import base64
import io
import json
import sys
from contextlib import chdir, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

DPI = 70  # of pictures


def code_cells(notebook: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the code cells of a notebook, in order."""
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def run(source: str, names: dict[str, Any]) -> list[dict[str, Any]]:
    """Run one cell among ``names``, which it adds to; return its outputs in the notebook's format."""
    body, printed, value = ast.parse(source), io.StringIO(), None
    last = body.body.pop() if body.body and isinstance(body.body[-1], ast.Expr) else None
    with redirect_stdout(printed):
        exec(compile(body, "cell", "exec"), names)  # the cells of our own page
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    text = printed.getvalue()
    stream = [{"output_type": "stream", "name": "stdout", "text": text.splitlines(keepends=True)}] if text else []
    return stream if value is None else [*stream, _shown(value)]


def _shown(value: Any) -> dict[str, Any]:
    data: dict[str, Any] = {"text/plain": repr(value).splitlines(keepends=True)}
    if hasattr(value, "savefig"):
        picture = io.BytesIO()
        value.savefig(picture, format="png", dpi=DPI, metadata={"Software": None})
        data["image/png"] = base64.b64encode(picture.getvalue()).decode()
    elif hasattr(value, "_repr_html_"):
        data["text/html"] = value._repr_html_().splitlines(keepends=True)
    return {"output_type": "execute_result", "execution_count": None, "metadata": {}, "data": data}


def execute(notebook: dict[str, Any]) -> None:
    """Run all code cells in the current folder and put their outputs into ``notebook``."""
    names: dict[str, Any] = {}
    for count, cell in enumerate(code_cells(notebook), 1):
        cell["outputs"], cell["execution_count"] = run("".join(cell["source"]), names), count
        for output in cell["outputs"]:
            if "execution_count" in output:
                output["execution_count"] = count


def main(path: Path) -> None:
    """Execute the notebook at ``path``, in a folder of its own, and write it."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    with TemporaryDirectory() as folder, chdir(folder):
        execute(notebook)
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
