"""Runs all functions of the generated module on the inputs in a folder.

NAME.inputs has a row for each input: points, velocities, parameters, rest shape. Results go to FUNCTION.numbers, flags
to FUNCTION.flags.
"""

import os
import re
import sys
from pathlib import Path

import numpy as np
import warp as wp

import energies

wp.config.quiet = True
# Unoptimised kernels compile in a third of the time. Numbers do not depend on the level.
wp.config.optimization_level = 2 if "ALL_ELEMENTS" in os.environ else 0
FOLDER = Path(sys.argv[1])
#: Types of arguments and results. Kernels name them by their number.
TYPES = []


def number_of(of_type):
    if of_type not in TYPES:
        TYPES.append(of_type)
    return TYPES.index(of_type)


def size_of(of_type):
    return int(np.prod(getattr(of_type, "_shape_", 1)))


class Job:
    """A function, and the kernel that calls it. `point` is the number of a point for functions of one point."""

    def __init__(self, element, function, columns, point=None):
        self.element, self.function = element, function
        self.name = function.key + ("" if point is None else f"_{point}")
        self.outputs, arguments = {}, []
        for name, of_type in function.input_types.items():
            if name == "point":
                arguments.append(str(point))
            elif name == "stored" and not function.key.endswith("_rest"):
                arguments.append("kept[i]")
            elif isinstance(of_type, wp.array):
                size = re.search(rf"^ *{name}: array of (\d+)", function.func.__doc__, re.MULTILINE)
                self.outputs[name] = (of_type.dtype, int(size[1]))
                arguments.append(f"{name}[i]")
            else:
                numbers = ", ".join(f"n[i, {columns[name] + k}]" for k in range(size_of(of_type)))
                arguments.append(f"T{number_of(of_type)}({numbers})" if hasattr(of_type, "_shape_") else numbers)
        self.returned = function.func.__annotations__["return"]
        self.call = f"energies.{function.key}({', '.join(arguments)})"

    def kernel(self):
        real = f"T{number_of(real_of(self.element)[1])}"
        arrays = {"n": real, "kept": real} | {name: f"T{number_of(of[0])}" for name, of in self.outputs.items()}
        arguments = "".join(f"{name}: wp.array2d(dtype={of_type}), " for name, of_type in arrays.items())
        return (
            f"@wp.kernel(enable_backward=False)\ndef k_{self.name}({arguments}"
            f"returned: wp.array(dtype=T{number_of(self.returned)})):\n"
            f"    i = wp.tid()\n    returned[i] = {self.call}\n\n\n"
        )

    def run(self, kernel, rows, kept):
        """Writes all results; returns the first array."""
        dtype, real = real_of(self.element)
        outputs = [wp.zeros((len(rows), size), dtype=of_type) for of_type, size in self.outputs.values()]
        returned = wp.zeros(len(rows), dtype=self.returned)
        wp.launch(kernel, len(rows), inputs=[wp.array(rows, dtype=real), kept, *outputs, returned])
        if self.returned is wp.int32:
            returned.numpy().astype(np.uint32).tofile(FOLDER / f"{self.name}.flags")
        tables = [one.numpy() for one in outputs] + ([] if self.returned is wp.int32 else [returned.numpy()])
        tables = [table.reshape(len(rows), -1).astype(dtype) for table in tables]
        np.hstack([np.zeros((len(rows), 0), dtype), *tables]).tofile(FOLDER / f"{self.name}.numbers")
        return outputs[0] if outputs else None


def real_of(element):
    return (np.float64, wp.float64) if element.endswith("f64") else (np.float32, wp.float32)


def columns_of(functions, about):
    """Returns the first column of each argument."""
    moving = next(functions[name] for name in ("hessian_vector", "force", "residual") if name in functions)
    groups = {"points": 0, "v": about["coordinates"], "parameters": 2 * about["coordinates"]}
    groups["rest"] = groups["parameters"] + about["parameters"]
    columns, left = {}, about["coordinates"]
    for name, of_type in moving.input_types.items():
        if isinstance(of_type, wp.array):
            continue
        group = "points" if left > 0 else "v" if name.startswith("v_") else "parameters"
        left -= size_of(of_type)
        columns[name], groups[group] = groups[group], groups[group] + size_of(of_type)
    for name, of_type in functions["rest"].input_types.items() if "rest" in functions else ():
        if name not in columns and not isinstance(of_type, wp.array):
            columns[name], groups["rest"] = groups["rest"], groups["rest"] + size_of(of_type)
    return columns


def jobs():
    for element, about in energies.ELEMENTS.items():
        found = {name: getattr(energies, name) for name in dir(energies) if name.startswith(f"{element}_")}
        functions = {name.removeprefix(f"{element}_"): function for name, function in found.items()}
        columns = columns_of(functions, about)
        for name in sorted(functions, key=lambda name: name != "rest"):
            points = range(about["coordinates"] // 3) if name == "vertex" else [None]
            yield from (Job(element, functions[name], columns, point) for point in points)


wp.set_device("cpu")
all_jobs = list(jobs())
text = "".join(job.kernel() for job in all_jobs)
types = "".join(f"T{number} = TYPES[{number}]\n" for number in range(len(TYPES)))
head = "import warp as wp\n\nimport energies\nfrom __main__ import TYPES\n\n"
(FOLDER / "kernels.py").write_text(f"{head}{types}\n\n{text}")
import kernels  # noqa: E402

stored = {}
for job in all_jobs:
    about = energies.ELEMENTS[job.element]
    dtype, real = real_of(job.element)
    size = 2 * about["coordinates"] + about["parameters"] + about["rest"]
    rows = np.fromfile(FOLDER / f"{job.element}.inputs", dtype=dtype).reshape(-1, size)
    kept = stored.setdefault(job.element, wp.zeros((len(rows), max(1, about["stored"])), dtype=real))
    first = job.run(getattr(kernels, f"k_{job.name}"), rows, kept)
    if job.name.endswith("_rest"):
        stored[job.element] = first
print(f"{len(all_jobs)} functions of {len(energies.ELEMENTS)} elements")
