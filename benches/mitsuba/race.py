"""Processor seconds × relMSE of path tracers: `radiosa render --method path`, Mitsuba's `path`, Blender's Cycles and LuxCore's paths, each at two threads, interleaved.

    race.py RADIOSA FOLDER SECONDS TURNS [PROGRAM...] [SCENE...]

Each program draws TURNS pictures with seeds of their own, each of about SECONDS of processor time. Of its pictures P, their mean P̄ and their variance Var P (of one picture):

    relMSE = mean of Var P/(R² + ε) over pixels and channels,   ε = ½ (mean luminance of R)²,   R the mean of all pictures of Radiosa and Mitsuba
    bias²  = mean of ((P̄ - R)² - Var(P̄ - R))/(R² + ε)

relMSE is that of noise alone, so bias² says what a program draws otherwise than R, and so does the mean of its pictures over R's. (R is half Radiosa's and half Mitsuba's:
theirs is a quarter of that of their difference, and `ztest.py` says that there is none. What Cycles and LuxCore mean otherwise is in `by_cycles.py` and `by_luxcore.py`.)

Seconds are those of whole processes, in brackets without starting Python and reading the scene. RADIOSA_BPY and RADIOSA_LUXCORE name the Python that has bpy and the one that
has pyluxcore, both with numpy; else it is python3. A program that is not there is left out.
"""

import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

from ztest import LUMINANCE, radiosa
import translate

SCENES = {"cornell-box": 512, "metal": 256, "rough-glass": 256, "glass": 256, "many-lamps": 256, "sky": 256, "coated": 256, "mirrors": 256}
RACE = ["cornell-box", "metal", "rough-glass", "many-lamps", "sky", "coated"]
JUDGES = ["Radiosa", "Mitsuba"]
# Script, Python, and what it has to import.
OTHERS = {
    "Mitsuba": ("by_mitsuba.py", sys.executable, "mitsuba"),
    "Cycles": ("by_cycles.py", os.environ.get("RADIOSA_BPY", "python3"), "bpy"),
    "LuxCore": ("by_luxcore.py", os.environ.get("RADIOSA_LUXCORE", "python3"), "pyluxcore"),
}


def is_there(name):
    if name == "Radiosa":
        return True
    _, python, module = OTHERS[name]
    try:
        subprocess.run([python, "-c", f"import numpy, {module}"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        print(f"{name} is left out: {python} has no {module}", flush=True)
        return False
    return True


class Program:
    def __init__(self, name, radiosa_program, path, height, size):
        self.name, self.program, self.path, self.height, self.size = name, radiosa_program, path, height, size

    def picture(self, spp, seed):
        """A picture, and what the whole process took and the drawing alone."""
        before = os.times()
        seconds = lambda: sum(os.times()[2:4]) - sum(before[2:4])
        if self.name == "Radiosa":
            picture = radiosa(self.program, self.path, self.size, spp, seed)
            return picture, seconds(), seconds()
        script, python, _ = OTHERS[self.name]
        with tempfile.NamedTemporaryFile(suffix=".npy") as file:
            command = [python, pathlib.Path(__file__).with_name(script), self.path, self.height, spp, seed, file.name]
            said = subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout
            return np.load(file.name).astype(np.float64), seconds(), float(said.split()[-1])

    def samples_in(self, seconds):
        """About how many samples a pixel take that long: from one sample's time, and that of enough to take a tenth of it longer."""
        n, start = 4, self.picture(1, 1)[1]
        while (took := self.picture(n, 1)[1] - start) < seconds / 10:
            n *= 4
        return max(round(1 + (n - 1) * (seconds - start) / took), 1)


def race(program, folder, seconds, turns, names, scene):
    path, height = folder / f"{scene}.toml", SCENES[scene]
    _, aspect = translate.scene(path, folder)
    programs = [Program(name, program, path, height, (round(aspect * height), height)) for name in names]
    spp = {one.name: one.samples_in(seconds) for one in programs}
    runs = {name: [] for name in names}
    for turn in range(turns):
        for one in programs:
            runs[one.name].append(one.picture(spp[one.name], 100 + turn))

    pictures = {name: np.array([picture for picture, _, _ in of]) for name, of in runs.items()}
    mean = {name: of.mean(0) for name, of in pictures.items()}
    variance = {name: of.var(0, ddof=1) for name, of in pictures.items()}
    reference = sum(mean[name] for name in JUDGES) / len(JUDGES)
    variance_of_reference = sum(variance[name] for name in JUDGES) / (turns * len(JUDGES) ** 2)
    scale = reference**2 + 0.5 * (reference @ LUMINANCE).mean() ** 2
    product = {}
    for name in names:
        relmse = (variance[name] / scale).mean()
        # (A judge's mean less R is half of the difference to the other's.)
        of_difference = variance_of_reference + (0 if name in JUDGES else variance[name] / turns)
        bias = (((mean[name] - reference) ** 2 - of_difference) / scale).mean()
        light = (pictures[name] @ LUMINANCE).mean((1, 2)) / (reference @ LUMINANCE).mean() - 1
        whole, drawing = (np.median([run[i] for run in runs[name]]) for i in (1, 2))
        product[name] = np.array([relmse * whole, relmse * drawing])
        print(
            f"{scene:12} {name:8} {spp[name]:6} samples  {whole:6.1f} s ({drawing:6.1f} s)  relMSE {relmse:.2e}  product {product[name][0]:.4f} ({product[name][1]:.4f})"
            f"   mean {100 * light.mean():+6.2f} ± {100 * light.std(ddof=1) / turns**0.5:.2f} %  bias² {bias:+.1e}",
            flush=True,
        )
    for name in names[1:]:
        whole, drawing = product["Radiosa"] / product[name]
        print(f"{scene:12} Radiosa over {name} {whole:.2f} ({drawing:.2f})", flush=True)


if __name__ == "__main__":
    program, folder, seconds, turns, *rest = sys.argv[1:]
    chosen = [name for name in rest if name in OTHERS] or list(OTHERS)
    names = JUDGES + [name for name in chosen if name not in JUDGES and is_there(name)]
    print(f"two threads, about {seconds} s of processor time, {turns} turns; in brackets without starting Python and reading the scene", flush=True)
    for scene in [name for name in rest if name not in OTHERS and name != "Radiosa"] or RACE:
        race(program, pathlib.Path(folder), float(seconds), int(turns), names, scene)
