#!/usr/bin/env python3
"""Makes scenes of garments in motion, drawn from a seed.

    python3 scenes/family/make.py --sample 34 --seed 1 -o out/family
    cloth run out/family/00-skirt-denim-twirl-1000/scene.toml -o out/twirl

Garments, fabrics of the library and motions are dealt from shuffled packs: each garment meets each motion before one
does so again. Of 17 scenes, 12 have about 1,000 vertices, 4 have 4,000, and one has 16,000. run.py runs such a sample.
"""

import argparse
from pathlib import Path
from random import Random

from garments import GARMENTS
from motions import MOTIONS, Scene

FABRICS = ["single-jersey", "cotton-shirting", "denim", "stretch-denim", "wool-coating", "wool-suiting", "silk-satin",
           "canvas", "polyester-faille", "velvet"]
SIZES = [1000] * 12 + [4000] * 4 + [16000]


def sample(count, seed, garments, fabrics, motions, vertices, duration, dt):
    """Yields names and scenes: tables and meshes by file name."""
    draw = Random(seed)
    pairs, cloths = [], []
    for number in range(count):
        if not pairs:
            pairs = [(kind, motion) for kind in garments for motion in motions]
            draw.shuffle(pairs)
        if not cloths:
            cloths = draw.sample(fabrics, len(fabrics))
        (kind, motion), fabric = pairs.pop(), cloths.pop()
        size = vertices or SIZES[number % len(SIZES)]
        own = Random(f"{seed}/{number}")
        scene = Scene(fabric)
        MOTIONS[motion](scene, own, kind, own.uniform(0.8, 1.15), size, duration)
        name = f"{number:02}-{kind}-{fabric}-{motion}-{size}"
        yield name, {"scene.toml": scene.text(f"{kind} of {fabric}: {motion}", dt, duration), **scene.meshes}


def arguments(description):
    """Returns a parser with the options of a sample."""
    parser = argparse.ArgumentParser(description=description)
    choice = lambda names: lambda text: [one for one in text.split(",") if one in names or parser.error(
        f"expected some of {', '.join(names)}, got {one}")]
    parser.add_argument("--sample", type=int, default=34, metavar="N", help="number of scenes; default 34")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="default 1")
    parser.add_argument("--garments", type=choice(GARMENTS), default=list(GARMENTS), metavar="A,B",
                        help=f"default {','.join(GARMENTS)}")
    parser.add_argument("--motions", type=choice(MOTIONS), default=list(MOTIONS), metavar="A,B",
                        help=f"default {','.join(MOTIONS)}")
    parser.add_argument("--fabrics", type=lambda text: text.split(","), default=FABRICS, metavar="A,B",
                        help="fabrics of the library; default all")
    parser.add_argument("--vertices", type=int, metavar="V", help="vertices of each scene; default 1,000, some more")
    parser.add_argument("--duration", type=float, default=0.5, metavar="SECONDS", help="default 0.5")
    parser.add_argument("--dt", type=float, default=0.01, metavar="SECONDS", help="step; default 0.01")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/family"), metavar="FOLDER",
                        help="default out/family")
    return parser


def write(options):
    """Writes the scenes of a sample. Returns their folders."""
    folders = []
    for name, files in sample(options.sample, options.seed, options.garments, options.fabrics, options.motions,
                              options.vertices, options.duration, options.dt):
        folder = options.output / name
        folder.mkdir(parents=True, exist_ok=True)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        folders.append(folder)
    return folders


if __name__ == "__main__":
    for made in write(arguments(__doc__.split("\n")[0]).parse_args()):
        print(made)
