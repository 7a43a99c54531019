"""`radiosa render --method path` beside Mitsuba 3.9's `path`, pixel by pixel.

    ztest.py RADIOSA FOLDER [SCENE...]

Each program draws a scene RUNS times with other random numbers. The spread of the runs tells each pixel's standard error, and Welch's t-test says whether the two means differ;
its t is given as the z of a normal distribution with the same probability. A scene passes when the standard error of the difference is at most 1 % of the luminance on 95 % of
the pixels, and |z| of every channel is below the bound that Šidák's correction of 1 % for all values gives, on 99.75 % of the pixels. A twin that reflects 2 % more must fail.

Mitsuba (pip install mitsuba==3.9.1 numpy scipy) needs an LLVM newer than 15: on Debian 12 libllvm19 with DRJIT_LIBLLVM_PATH=/usr/lib/x86_64-linux-gnu/libLLVM-19.so.
"""

import os
import pathlib
import subprocess
import sys
import tomllib

import mitsuba as mi
import numpy as np
import scipy.stats

mi.set_variant("llvm_ad_rgb")

import translate

RUNS = 40
ROUNDING = 2e-5  # of sums of single-precision numbers, relative
SIGNIFICANCE = 0.01

# Rows of pixels, and samples a pixel and run of Radiosa and of Mitsuba.
SCENES = {
    "cornell-box": (18, 1024, 3072),
    "metal": (24, 160, 576),
    "coated": (24, 96, 384),
    "rough-glass": (18, 320, 2048),
    "glass": (24, 160, 832),
    "mirrors": (24, 288, 960),
    "many-lamps": (12, 1792, 11264),
    "sky": (24, 128, 512),
    "textured": (24, 128, 640),
    "delta-lights": (24, 128, 1024),
}
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def radiosa(program, path, size, spp, seed, changes=()):
    out = path.with_name(f"{path.stem}-radiosa.exr")
    command = [program, "render", path, "--method", "path", "--size", f"{size[0]}x{size[1]}", "--spp", spp, "--seed", seed]
    command += ["--threads", 2, "--layers", "none", "-q", "-o", out]
    command += [word for change in changes for word in ("--set", change)]
    subprocess.run([str(word) for word in command], check=True)
    return read(out)


def read(path):
    return np.array(mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False), np.float64)


def mitsuba(scene, spp, seed):
    return np.array(mi.render(scene, spp=spp, seed=seed), np.float64)[..., :3]


class Runs:
    """Mean and variance of the mean of all runs, by channel and of luminance, and processor seconds."""

    def __init__(self, draw):
        before = os.times()
        pictures = np.array([draw(seed) for seed in range(RUNS)])
        self.seconds = sum(os.times()[:4]) - sum(before[:4])
        self.mean, self.variance = pictures.mean(0), pictures.var(0, ddof=1) / RUNS
        luminance = pictures @ LUMINANCE
        self.luminance, self.luminance_variance = luminance.mean(0), luminance.var(0, ddof=1) / RUNS

    def cost(self):
        """Processor seconds × relMSE, the mean of Var/(L² + ε) over pixels and channels, ε = ½ (mean luminance)²."""
        return self.seconds * np.mean(self.variance / (self.mean**2 + 0.5 * self.luminance.mean() ** 2))


def z_of(ours, theirs):
    """z of each value's difference."""
    a, b, va, vb = ours.mean, theirs.mean, ours.variance, theirs.variance
    variance = va + vb + (ROUNDING * (np.abs(a) + np.abs(b)) / 2) ** 2 + 1e-60
    freedom = np.maximum(variance**2 * (RUNS - 1) / (va**2 + vb**2 + 1e-200), RUNS - 1)
    t = (a - b) / np.sqrt(variance)
    return np.sign(t) * scipy.stats.norm.isf(np.maximum(scipy.stats.t.sf(np.abs(t), freedom), 1e-300))


def bound(n):
    return scipy.stats.norm.isf((1 - (1 - SIGNIFICANCE) ** (1 / n)) / 2)


def report(name, ours, theirs):
    """Prints a line, and says whether the scene's pixels pass and whether their noise is low enough."""
    z = z_of(ours, theirs)
    share = np.mean(np.all(np.abs(z) < bound(z.size), -1))
    error = np.sqrt(ours.luminance_variance + theirs.luminance_variance) / np.maximum((ours.luminance + theirs.luminance) / 2, 1e-30)
    clean = np.mean(error <= 0.01)
    mean = ours.mean.mean() / theirs.mean.mean() - 1
    of_mean = np.sqrt((ours.variance + theirs.variance).sum()) / theirs.mean.sum()
    print(
        f"{name:20} {100 * share:7.2f} %  {np.sqrt(np.mean(z**2)):6.3f}  {np.abs(z).max():6.2f} ({bound(z.size):.2f})  {100 * mean:+7.3f} ± {100 * of_mean:.3f} %"
        f"   {100 * clean:6.2f} %   {ours.seconds:6.1f} {theirs.seconds:6.1f} s   {ours.cost():.1e} {theirs.cost():.1e}  {ours.cost() / theirs.cost():.2f}",
        flush=True,
    )
    return share >= 0.9975, clean >= 0.95


def twin(path):
    """What makes every matt surface of a scene reflect 2 % more."""
    materials = tomllib.loads(path.read_text())["material"]
    matt = {name: m["lambert"] for name, m in materials.items() if isinstance(m.get("lambert"), list)}
    return [f"material.{name}.lambert={[1.02 * c for c in color]}" for name, color in matt.items()]


if __name__ == "__main__":
    program, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    good = True
    print("scene                   pass     rms z   max z (bound)  difference of the means  noise <= 1 %   processor        s × relMSE, ours over theirs", flush=True)
    for name in sys.argv[3:] or SCENES:
        path = folder / f"{name}.toml"
        height, mine, yours = SCENES[name]
        scene = translate.load(path, folder, height)
        size = mi.traverse(scene)["sensor.film.size"]
        size = (int(size[0]), int(size[1]))
        theirs = Runs(lambda seed: mitsuba(scene, yours, seed))
        ours = Runs(lambda seed: radiosa(program, path, size, mine, seed))
        np.savez(folder / f"{name}.npz", ours=ours.mean, theirs=theirs.mean, ours_variance=ours.variance, theirs_variance=theirs.variance)
        passes, is_clean = report(name, ours, theirs)
        good &= passes and is_clean
        if name == "cornell-box":
            changes = twin(path)
            passes, _ = report("  twin, 2 % more", Runs(lambda seed: radiosa(program, path, size, mine, seed, changes)), theirs)
            good &= not passes
    sys.exit(0 if good else "not every scene is as it should be")
