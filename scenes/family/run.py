#!/usr/bin/env python3
"""Runs scenes of garments in motion, drawn from a seed, and tells what their steps cost.

    python3 scenes/family/run.py --sample 34 --seed 1 -o out/family
    python3 scenes/family/run.py --sample 34 --seed 1 --against OTHER_CLOTH --error -o out/family

Writes family.csv, family.json and family.svg to the output folder, and prints a table. With --against, each scene runs
with both programs in turn, and a second table has the ratios. With --error, `cloth bench --error` adds the distance of
0.1 s of each scene from a reference with a sixteenth of the step. The exit status is 1 if a run was refused, ended
early or has a crossing.
"""

import csv
import json
import re
import resource
import subprocess
import sys
from math import exp, log
from pathlib import Path

from make import arguments, write

PHASES = ["assembly", "factorisation", "solve", "line_search", "collision", "contact", "preparation", "ledger"]


def seconds(duration):
    return duration["secs"] + 1e-9 * duration["nanos"]


def run(program, scene, threads):
    """Runs a scene. Returns its figures and what is wrong with it."""
    folder = scene.parent / "out"
    # That of an earlier run would count if the scene is refused.
    (folder / "run.json").unlink(missing_ok=True)
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    command = [program, "run", scene, "-o", folder, "--overwrite", "--threads", str(threads)]
    done = subprocess.run([*command, "--check-crossings"], capture_output=True, text=True)
    if done.returncode == 2:
        # A program of an earlier version.
        done = subprocess.run(command, capture_output=True, text=True)
    user = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    if not (folder / "run.json").exists():
        return None, done.stderr.strip() or f"no results, exit status {done.returncode}"
    record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    summary = record["summary"]
    steps, solves = max(summary["steps"], 1), max(summary["solves"], 1)
    time = seconds(summary["stepping_time"])
    figures = {
        "vertices": summary["vertices"], "steps": summary["steps"], "rejected": summary["rejected"],
        "solves/step": summary["solves"] / steps,
        "local/step": summary["local_solves"] / steps,
        # A solve of a subset counts by its part of the vertices.
        "work/step": (summary["solves"] + summary["local_vertices"] / max(summary["vertices"], 1)) / steps,
        "CG/solve": summary["iterations"] / solves,
        "energies/step": summary.get("energies", 0) / steps,
        "searches/step": summary["contact"]["searches"] / steps,
        "pairs": summary["contact"]["active"] / max(summary["contact"]["systems"], 1),
        "ms/step": 1e3 * time / steps, "µs/vertex/step": 1e6 * time / steps / max(summary["vertices"], 1),
        "user s": user,
    }
    known = {phase: seconds(summary["phases"].get(phase, {"secs": 0, "nanos": 0})) for phase in PHASES}
    known["other"] = time - sum(known.values())
    figures |= {f"{phase} %": 100 * part / time for phase, part in known.items()}
    wrong = []
    if not record["finished"] or done.returncode != 0:
        wrong.append(done.stderr.strip() or f"exit status {done.returncode}")
    crossed = summary["crossings"] + summary["obstacle_crossings"] + summary.get("crossed_frames", 0)
    if crossed:
        wrong.append(f"{crossed} crossings")
    return figures, "; ".join(wrong)


def error(program, scene, threads):
    """Returns the local error of a scene, as `cloth bench --error` has it."""
    command = [program, "bench", "--error", scene, "--json", "--threads", str(threads)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        return {}, done.stderr.strip()
    found = json.loads(done.stdout)
    return {"RMS mm": 1e3 * found["rms"], "largest mm": 1e3 * found["largest"]}, ""


def shown(value):
    """Returns a text, a whole number, or a number with three digits."""
    if isinstance(value, str):
        return value
    return f"{value:.{0 if value >= 100 or value == int(value) else 1 if value >= 10 else 2}f}"


def table(rows):
    """Returns rows of equal keys as aligned columns."""
    cells = [list(rows[0])] + [[shown(value) for value in row.values()] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells)]
    align = lambda row: "  ".join([row[0].ljust(widths[0])] + [c.rjust(w) for c, w in zip(row[1:], widths[1:])])
    return "\n".join(map(align, cells)) + "\n"


def median(values):
    ordered = sorted(values)
    return (ordered[len(ordered) // 2] + ordered[(len(ordered) - 1) // 2]) / 2


def ratios(rows):
    """Returns each figure over that of the other program, the geometric mean and the median of all scenes."""
    keys = ["solves/step", "work/step", "CG/solve", "ms/step", "user s", "RMS mm", "largest mm"]
    keys = [key for key in keys if all(key in row and key in row["against"] for row in rows)]
    ratio = lambda row, key: max(row[key], 1e-9) / max(row["against"][key], 1e-9)
    found = [{"scene": row["scene"], **{key: ratio(row, key) for key in keys},
              "rejected": f"{row['against']['rejected']} → {row['rejected']}"} for row in rows]
    of_all = lambda name, mean: {"scene": name, **{key: mean([one[key] for one in found]) for key in keys},
                                 "rejected": ""}
    geometric = lambda values: exp(sum(map(log, values)) / len(values))
    return [*found, of_all("geometric mean", geometric), of_all("median", median)]


def plot(rows):
    """Returns an SVG: for each scene, a bar of the time per vertex and step, divided by phases."""
    colours = ["#4c72b0", "#dd8452", "#55a868", "#c44e52", "#8172b3", "#937860", "#da8bc3", "#8c8c8c", "#000000"]
    phases = [*PHASES, "other"]
    key = "µs/vertex/step"
    rows = sorted(rows, key=lambda row: row[key])
    scale, high = 560 / max(row[key] for row in rows), 18
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" width="1000" height="{high * len(rows) + 60}" '
             'font-family="sans-serif" font-size="11"><rect width="100%" height="100%" fill="white"/>',
             f'<text x="10" y="16" font-size="13">{key}, by phase; solves and CG iterations a step</text>']
    for number, (phase, colour) in enumerate(zip(phases, colours)):
        left = 10 + 108 * number
        parts += [f'<rect x="{left}" y="24" width="10" height="10" fill="{colour}"/>',
                  f'<text x="{left + 14}" y="33">{phase.replace("_", " ")}</text>']
    for number, row in enumerate(rows):
        top, left = 44 + high * number, 290
        parts.append(f'<text x="10" y="{top + 11}">{row["scene"]}</text>')
        for phase, colour in zip(phases, colours):
            width = scale * row[key] * row[f"{phase} %"] / 100
            parts.append(f'<rect x="{left:.1f}" y="{top}" width="{width:.1f}" height="{high - 4}" fill="{colour}"/>')
            left += width
        iterations = row["solves/step"] * row["CG/solve"]
        parts.append(f'<text x="{left + 5:.1f}" y="{top + 11}">{row["solves/step"]:.1f}, {iterations:.0f}</text>')
    return "\n".join([*parts, "</svg>"]) + "\n"


def save(folder, rows):
    (folder / "family.json").write_text(json.dumps(rows, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")
    keys = list(dict.fromkeys(key for row in rows for key in row if key != "against"))
    with open(folder / "family.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, keys, restval="", extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
    (folder / "family.svg").write_text(plot(rows), encoding="utf-8")


def measured(options, folder):
    """Runs one scene with each program. Returns its figures, and what is wrong."""
    scene, row, complaints = folder / "scene.toml", {"scene": folder.name}, []
    against = {}
    for program, figures in [(options.against, against)] * bool(options.against) + [(options.program, row)]:
        found, wrong = run(program, scene, options.threads)
        if found and options.error:
            distances, failed = error(program, scene, options.threads)
            found, wrong = {**found, **distances}, "; ".join(filter(None, [wrong, failed]))
        figures |= found or {}
        if wrong and figures is row:
            complaints.append(re.sub(r"\s+", " ", wrong))
    return (row | ({"against": against} if against else {})), complaints


def main():
    parser = arguments(__doc__.split("\n")[0])
    parser.add_argument("--program", default="cloth", metavar="CLOTH", help="default: cloth on the path")
    parser.add_argument("--against", metavar="CLOTH", help="another program, to compare with in turn")
    parser.add_argument("--error", action="store_true", help="also measure the local error, which takes much longer")
    parser.add_argument("--threads", type=int, default=1, help="default 1")
    options = parser.parse_args()
    rows, failures = [], 0
    for number, folder in enumerate(write(options)):
        row, complaints = measured(options, folder)
        failures += bool(complaints)
        said = f"{row['ms/step']:.1f} ms a step" if "ms/step" in row else "refused"
        print(f"{number + 1}/{options.sample} {folder.name}: {'; '.join([said, *complaints])}", file=sys.stderr)
        if "ms/step" in row:
            rows.append(row)
            save(options.output, rows)
    hidden = ("against", "steps", "searches/step")
    if rows:
        print(table([{key: value for key, value in row.items() if key not in hidden} for row in rows]))
    compared = [row for row in rows if "against" in row]
    if compared:
        print(table(ratios(compared)))
    print(f"{len(rows)} scenes, {failures} with a fault; figures in {options.output}/family.csv, .json and .svg")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
