"""A scene file of this folder by LuxCore: one picture, linear RGB of single precision, and the processor seconds of drawing it.

    by_luxcore.py SCENE.toml HEIGHT SPP SEED OUT.npy

Its paths on two threads, of any length, nothing clamped or denoised, a box filter of a pixel, lights chosen as it does by default (pip install pyluxcore numpy).
Where it means something else:
- Facets are Schlick's: their distribution is GGX's, their shadowing is not Smith's, G₁ = cos θ/(cos θ (1 - α²) + α²). So rough metals are darker,
  `metal` by 2 %, and coats, `coated` by 0.3 %; rough glass lets through less inwards and more outwards, and has fireflies.
- The reflectance of its metals, from n and k, goes wrong away from the normal (0.92 for 0.79 of green light on gold at 63°). They are given the n and k with which theirs
  is nearest to the true one: off by 0.03 at most on average, aluminium's. Coats, of k = 0, are right.
- From the third surface on, its weights of sampling lamps and of sampling directions take different probabilities of going on: the walls of `many-lamps` are 1 % too bright.
- Balls are fine meshes with interpolated normals.
- It takes a few samples more than asked for: it is stopped when they are there.
"""

import sys
import time

import numpy as np  # before the next one, which exchanges malloc
import pyluxcore

import scenefile

DEPTH = 1024


def its_reflectance(n, k, cos):
    """As LuxCore has it."""
    sin2 = (1 - cos**2) / n**2
    inner = np.sqrt((1 - sin2 + np.sqrt((1 - sin2) ** 2 + (2 * k**2 * sin2) ** 2)) / 2)
    m2, cross = n**2 + k**2, 2 * n * cos * inner
    p, s = m2 * cos**2 + inner**2, m2 * inner**2 + cos**2
    return ((p - cross) / (p + cross) + (s - cross) / (s + cross)) / 2


def fitted(n, k):
    """The n and k of LuxCore whose reflectance is nearest to that of a metal of n and k: least squares of the angles' flux."""
    cos, m = (np.arange(16) + 0.5) / 16, n + 1j * k
    inner = np.sqrt(1 - (1 - cos**2) / m**2)
    reflectance = (abs((cos - m * inner) / (cos + m * inner)) ** 2 + abs((m * cos - inner) / (m * cos + inner)) ** 2) / 2
    ns, ks = np.meshgrid(np.geomspace(0.05, 100, 120), np.geomspace(0.05, 200, 120))
    error = ((its_reflectance(ns[..., None], ks[..., None], cos) - reflectance) ** 2 * cos).sum(-1)
    best = np.unravel_index(error.argmin(), error.shape)
    return float(ns[best]), float(ks[best])


def surface(name, kind, *values):
    """Properties of a material."""
    m = f"scene.materials.{name}"
    if kind == "matt":
        return {f"{m}.type": "matte", f"{m}.kd": values[0]}
    if kind == "mirror":
        return {f"{m}.type": "mirror", f"{m}.kr": values[0]}
    if kind == "metal":
        n, k, alpha = values
        t = f"scene.textures.{name}"
        if any(k):
            n, k = map(list, zip(*(fitted(*pair) for pair in zip(n, k))))
        fresnel = {f"{t}.type": "fresnelconst", f"{t}.n": n, f"{t}.k": k}
        return fresnel | {f"{m}.type": "metal2", f"{m}.fresnel": name, f"{m}.uroughness": alpha, f"{m}.vroughness": alpha}
    if kind == "coated":
        matt, n, alpha = values
        both = surface(f"{name}-matt", "matt", matt) | surface(f"{name}-coat", "metal", n, [0, 0, 0], alpha)
        return both | {f"{m}.type": "mix", f"{m}.material1": f"{name}-matt", f"{m}.material2": f"{name}-coat", f"{m}.amount": 0.5}
    ior, alpha = values
    glass = {f"{m}.type": "roughglass" if alpha else "glass", f"{m}.kr": [1, 1, 1], f"{m}.kt": [1, 1, 1], f"{m}.interiorior": ior, f"{m}.exteriorior": 1.0}
    return glass | ({f"{m}.uroughness": alpha, f"{m}.vroughness": alpha} if alpha else {})


def properties(of):
    made = pyluxcore.Properties()
    for key, value in of.items():
        made.Set(pyluxcore.Property(key, value))
    return made


def load(path, height, spp, seed):
    """A session, not started, and its width."""
    read = scenefile.Scene(path)
    camera, width = read.camera, round(read.camera["aspect"] * height)
    scene = pyluxcore.Scene()
    aspect, row = width / height, 2 / height
    what = {
        "scene.camera.type": "perspective",
        "scene.camera.lookat.orig": camera["position"],
        "scene.camera.lookat.target": camera["look_at"],
        "scene.camera.up": [0, 1, 0],
        "scene.camera.fieldofview": camera["fov_y"],
        "scene.camera.screenwindow": [-aspect, aspect, -1 - row, 1 - row],  # (A row of pixels lower: its own pictures show one more above.)
        "scene.camera.cliphither": 1e-3,
        "scene.camera.autovolume.enable": False,
    }
    for name, (meaning, emission) in read.materials.items():
        what |= surface(name, *meaning)
        if emission:
            what[f"scene.materials.{name}.emission"] = emission
    if isinstance(read.sky, str):
        # (Column by column. Its maps are mirrored.)
        turn = [0, 0, 1, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1]
        what |= {"scene.lights.sky.type": "infinite", "scene.lights.sky.file": read.sky, "scene.lights.sky.gamma": 1.0, "scene.lights.sky.transformation": turn}
    elif read.sky:
        what |= {"scene.lights.sky.type": "constantinfinite", "scene.lights.sky.color": read.sky}
    for i, (name, points, faces, normals) in enumerate(read.meshes):
        points, faces, normals = (rows and [tuple(row) for row in rows] for rows in (points, faces, normals))
        scene.DefineMesh(f"mesh-{i}", points, faces, normals, None, None, None)
        what |= {f"scene.objects.{i}.shape": f"mesh-{i}", f"scene.objects.{i}.material": name}
    scene.Parse(properties(what))
    config = {
        "renderengine.type": "PATHCPU",
        "sampler.type": "SOBOL",
        "sampler.sobol.adaptive.strength": 0.0,
        "renderengine.seed": seed,
        "native.threads.count": 2,
        "film.width": width,
        "film.height": height,
        "film.filter.type": "NONE",
        "film.imagepipelines.0.0.type": "NOP",
        "path.pathdepth.total": DEPTH,
        "path.pathdepth.diffuse": DEPTH,
        "path.pathdepth.glossy": DEPTH,
        "path.pathdepth.specular": DEPTH,
        "path.clamping.variance.maxvalue": 0.0,
        "batch.haltspp": spp,
    }
    return pyluxcore.RenderSession(pyluxcore.RenderConfig(properties(config), scene)), width


def draw(path, height, spp, seed, out):
    height = int(height)
    pyluxcore.Init(lambda _: None)
    session, width = load(path, height, int(spp), int(seed))
    start = time.process_time()
    session.Start()
    while not session.HasDone():
        time.sleep(0.05)
        session.UpdateStats()
    session.Stop()
    seconds = time.process_time() - start
    pixels = np.empty(width * height * 3, np.float32)
    session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, pixels)
    np.save(out, pixels.reshape(height, width, 3)[::-1])
    print(seconds, flush=True)
    pyluxcore.SetLogHandler(None)  # which would end in a crash


if __name__ == "__main__":
    draw(*sys.argv[1:])
