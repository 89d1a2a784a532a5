"""The files that list all runs of a sweep: an index, their times, and a page for people."""

from __future__ import annotations

import csv
import html
import io
import json
from pathlib import Path
from typing import Any

from .sweep_files import replace

#: Columns of the index after those of the parameters.
RESULTS = [
    "folder", "status", "steps", "frames", "energy", "kinetic_energy", "crossings", "obstacle_crossings", "warnings",
    "message",
]


def measured(runs: list[dict[str, Any]], names: list[str]) -> list[str]:
    """Returns the columns of forces and strains at the end of the runs, in the order in which they first occur."""
    known = {*names, *RESULTS}
    return list(dict.fromkeys(column for run in runs for column in run if column not in known))


def write_index(folder: Path, names: list[str], runs: list[dict[str, Any]], seconds: list[float]) -> None:
    """Writes `index.csv`, which depends on the scenes alone, and `times.csv`, which does not."""
    if taken := set(names) & set(RESULTS):
        raise ValueError(f"a parameter has the name of a column of results: {', '.join(sorted(taken))}")
    _write_rows(folder / "index.csv", names + RESULTS + measured(runs, names), runs)
    times = [{"folder": run["folder"], "seconds": time} for run, time in zip(runs, seconds)]
    _write_rows(folder / "times.csv", ["folder", "seconds"], times)


def _write_rows(path: Path, columns: list[str], rows: list[dict[str, Any]]) -> None:
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    replace(path, text.getvalue())


def write_parquet(path: Path, names: list[str], runs: list[dict[str, Any]]) -> None:
    """Writes the index as Parquet. Parameters that are lists or tables are written as JSON."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise ImportError("parquet=True needs pyarrow: pip install pyarrow") from error

    def plain(value: Any) -> Any:
        return json.dumps(value) if isinstance(value, (list, dict)) else value

    columns = {name: [plain(run.get(name)) for run in runs] for name in names + RESULTS + measured(runs, names)}
    part = path.with_suffix(".part")
    pyarrow.parquet.write_table(pyarrow.table(columns), part)
    part.replace(path)


STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em; }
table { border-collapse: collapse; }
th, td { padding: 0.2em 0.8em; border-bottom: 1px solid #ddd; text-align: left; font-variant-numeric: tabular-nums; }
th { position: sticky; top: 0; background: #fff; }
tr.failed { background: #fee; }
"""


def write_page(path: Path, names: list[str], runs: list[dict[str, Any]], seconds: list[float]) -> None:
    """Writes a page with parameters, results, times and failures."""
    failed = sum(run["status"] != "done" for run in runs)
    total = sum(seconds)
    results = [name for name in RESULTS if name != "message"]
    columns = names + results + measured(runs, names) + ["seconds", "message"]
    head = "".join(f"<th>{html.escape(name.replace('_', ' '))}</th>" for name in columns)
    body = "\n".join(_row(columns, run, time) for run, time in zip(runs, seconds))
    slowest = max(seconds, default=0.0)
    replace(
        path,
        f"""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>Sweep {html.escape(path.parent.name)}</title>
<style>{STYLE}</style>
<h1>Sweep {html.escape(path.parent.name)}</h1>
<p>{len(runs)} runs, {failed} failed. {total:.1f} s in all, {slowest:.1f} s the slowest. Energies are in J.</p>
<table>
<tr>{head}</tr>
{body}
</table>
</html>
""",
    )


def _row(columns: list[str], run: dict[str, Any], seconds: float) -> str:
    cells = {**run, "seconds": f"{seconds:.2f}"}
    name = html.escape(str(run["folder"]))
    texts = [f'<a href="{name}/">{name}</a>' if column == "folder" else _text(cells.get(column)) for column in columns]
    kind = ' class="failed"' if run["status"] != "done" else ""
    return f"<tr{kind}>{''.join(f'<td>{text}</td>' for text in texts)}</tr>"


def _text(value: Any) -> str:
    if value is None:
        return ""
    return html.escape(f"{value:.6g}" if isinstance(value, float) else str(value))
