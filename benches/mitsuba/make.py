"""Makes in FOLDER the scenes of this folder and what they refer to: textures, a sky, some hundred lamps.

    make.py FOLDER
"""

import pathlib
import random
import shutil
import sys

import mitsuba as mi
import numpy as np


def write(picture, path):
    mi.Bitmap(np.ascontiguousarray(picture, np.float32)).write(str(path))


def sky(y, x):
    """A sky without edges, that of a map is a function which both programs interpolate alike: blue above, brown below, a hazy sun. From the angle from +y and that about it,
    0 in the middle of the map, growing to its right."""
    direction = np.stack([np.sin(y) * np.sin(x), np.cos(y), -np.sin(y) * np.cos(x)], -1)
    up = direction[..., 1:2]
    above = np.array([0.25, 0.4, 0.7]) + np.array([0.5, 0.4, 0.2]) * np.exp(-3 * np.maximum(up, 0))
    below = np.array([0.2, 0.16, 0.12])
    share = 1 / (1 + np.exp(-up / 0.05))
    sun = np.array([-0.5, 0.6, 0.62]) / np.linalg.norm([-0.5, 0.6, 0.62])
    glow = np.exp((direction @ sun - 1) / 0.15**2)[..., None]
    return share * above + (1 - share) * below + glow * np.array([30, 26, 20])


def make_sky(folder, width=1024, height=512):
    x = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    of_rows = lambda rows: sky(*np.meshgrid(rows * np.pi, x, indexing="ij"))
    write(of_rows((np.arange(height) + 0.5) / height), folder / "sky.exr")
    write(of_rows(np.arange(height) / (height - 1)), folder / "sky-from-pole-to-pole.exr")


def make_textures(folder):
    choose = np.random.default_rng(1)
    write(choose.uniform(0.1, 0.8, (6, 8, 3)), folder / "tiles.exr")
    # No two of its corners alike, and no symmetry.
    v, u = np.mgrid[0:16, 0:16] / 15
    write(np.stack([0.1 + 0.7 * u, 0.1 + 0.7 * v, 0.5 - 0.3 * u * v], -1), folder / "slopes.exr")


def make_lamps(folder):
    """A room lit by 480 small triangles of twelve colours in a layer below its ceiling."""
    choose = random.Random(2)
    text = """about = "A room lit by 480 small triangles."

[camera.main]
position = [0, 1.4, 2.9]
look_at = [0, 0.7, 0]
fov_y = 55

[material.walls]
lambert = [0.6, 0.55, 0.5]

[material.block]
lambert = [0.3, 0.45, 0.6]

[[shape]]
material = "walls"
box = { min = [-3, 0, -3], max = [3, 3, 3], inward = true }

[[shape]]
material = "block"
box = { min = [-0.6, 0, -0.5], max = [0.6, 0.9, 0.5] }
transform = { rotate = { axis = [0, 1, 0], degrees = 30 }, translate = [-0.7, 0, -0.6] }

[[shape]]
material = "block"
sphere = { center = [1.1, 0.5, 0.3], radius = 0.5 }
"""
    for k in range(12):
        color = [round(choose.uniform(20, 100), 2) for _ in range(3)]
        positions = []
        for _ in range(40):
            middle = [choose.uniform(-2.5, 2.5), choose.uniform(2.1, 2.6), choose.uniform(-2.5, 2.5)]
            for _ in range(3):
                positions.append([round(m + choose.uniform(-0.07, 0.07), 4) for m in middle])
        faces = [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(40)]
        text += f"\n[material.lamp-{k}]\nlambert = 0\nemission = {color}\n"
        text += f'\n[[shape]]\nmaterial = "lamp-{k}"\nmesh = {{ positions = {positions}, faces = {faces} }}\n'
    (folder / "many-lamps.toml").write_text(text)


if __name__ == "__main__":
    folder = pathlib.Path(sys.argv[1])
    mi.set_variant("scalar_rgb")
    here = pathlib.Path(__file__).parent
    for scene in [*here.glob("*.toml"), here.parent.parent / "scenes/cornell-box.toml"]:
        shutil.copy(scene, folder)
    make_sky(folder)
    make_textures(folder)
    make_lamps(folder)
