"""Draw docs/figures/creatures.png: a row a class, its template and six of its poses, by the package's own renderer.

Usage: python docs/draw_creatures.py [file]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from nonrigid.benchmark.datasets.creatures import Creatures
from nonrigid.benchmark.render import Image, View, render, save_png
from nonrigid.geometry.mesh import Mesh

VIEW = View(azimuth=40.0, elevation=10.0)
POSES = slice(1, 7)
SIZE = 150


def main() -> None:
    """Write the picture, with few shades, so that it stays small."""
    rows = []
    for creature in Creatures(vertices=10_000).classes():
        shapes: list[Mesh] = [creature.template()]
        shapes += [creature.posed(name).mesh for name in creature.pose_names[POSES]]
        rows.append(np.hstack([on_white(render(shape, view=VIEW, size=SIZE)) for shape in shapes]))
    place = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "figures" / "creatures.png"
    save_png(np.vstack(rows), place)


def on_white(image: Image) -> Image:
    """Return an image without its transparency, in few shades."""
    share = image[..., 3:] / 255.0
    return np.asarray((share * image[..., :3] + (1.0 - share) * 255.0) // 8 * 8 + 7, dtype=np.uint8)


if __name__ == "__main__":
    main()
