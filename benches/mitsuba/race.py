"""Processor seconds × relMSE of `radiosa render --method path` and of Mitsuba 3.9's `path`, both at two threads, whole processes, interleaved.

    race.py RADIOSA FOLDER SECONDS TURNS [SCENE...]
    race.py draw SCENE.toml HEIGHT SPP SEED OUT.npy      one picture by Mitsuba, in a process of its own

relMSE is the mean over pixels and channels of (L - R)²/(R² + ε), ε = ½ (mean luminance)², less what the reference's own variance adds to it. Each program is judged by the other's
reference, of ten times as much work in eight runs whose spread tells that variance. `ztest.py` says that both mean the same picture.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time

import mitsuba as mi
import numpy as np

from ztest import mitsuba, radiosa
import translate

SCENES = {"cornell-box": 512, "metal": 256, "rough-glass": 256, "glass": 256, "many-lamps": 256, "sky": 256, "coated": 256, "mirrors": 256}
RACE = ["cornell-box", "metal", "rough-glass", "many-lamps", "sky", "coated"]
REFERENCES = 8


def draw(path, height, spp, seed, out):
    """Of at most 64 samples a pixel at once: more take too much memory."""
    scene = translate.load(path, pathlib.Path(path).parent, int(height))
    start = time.process_time()
    n = -(-int(spp) // 64)
    shares = [int(spp) // n + (k < int(spp) % n) for k in range(n)]
    picture = sum(share * mitsuba(scene, share, n * int(seed) + k) for k, share in enumerate(shares)) / int(spp)
    np.save(out, picture)
    print(time.process_time() - start)


class Program:
    def __init__(self, name, radiosa_program, path, height, size):
        self.name, self.program, self.path, self.height, self.size = name, radiosa_program, path, height, size

    def picture(self, spp, seed):
        """A picture, and what the whole process took and the drawing alone."""
        before = os.times()
        if self.name == "Radiosa":
            picture = radiosa(self.program, self.path, self.size, spp, seed)
            after = os.times()
            whole = sum(after[2:4]) - sum(before[2:4])
            return picture, whole, whole
        with tempfile.NamedTemporaryFile(suffix=".npy") as file:
            command = [sys.executable, __file__, "draw", self.path, self.height, spp, seed, file.name]
            said = subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout
            after = os.times()
            return np.load(file.name), sum(after[2:4]) - sum(before[2:4]), float(said.split()[-1])

    def samples_in(self, seconds):
        """About how many samples a pixel take that long."""
        few = [self.picture(n, 1)[1] for n in (4, 36)]
        a_sample = max((few[1] - few[0]) / 32, 1e-4)
        return max(int((seconds - few[0]) / a_sample), 4)


def relmse(picture, reference, variance):
    epsilon = 0.5 * (reference @ [0.2126, 0.7152, 0.0722]).mean() ** 2
    return (((picture - reference) ** 2 - variance) / (reference**2 + epsilon)).mean()


def race(program, folder, seconds, turns, name):
    path = folder / f"{name}.toml"
    height = SCENES[name]
    _, aspect = translate.scene(path, folder)
    both = [Program(who, program, path, height, (round(aspect * height), height)) for who in ("Radiosa", "Mitsuba")]
    spp = [one.samples_in(seconds) for one in both]
    runs = [[], []]
    for turn in range(turns):
        for k, one in enumerate(both):
            runs[k].append(one.picture(spp[k], 100 + turn))
    references = []
    for k, one in enumerate(both):
        pictures = np.array([one.picture(-(-10 * spp[k] // REFERENCES), 1000 + seed)[0] for seed in range(REFERENCES)])
        references.append((pictures.mean(0), pictures.var(0, ddof=1) / REFERENCES))
    products = []
    for k, one in enumerate(both):
        reference, variance = references[1 - k]
        errors = [relmse(picture, reference, variance) for picture, _, _ in runs[k]]
        whole, drawing = (np.median([run[i] for run in runs[k]]) for i in (1, 2))
        products.append((np.mean(errors) * whole, np.mean(errors) * drawing))
        print(f"{name:12} {one.name:8} {spp[k]:6} samples  {whole:6.1f} s ({drawing:6.1f} s)  relMSE {np.mean(errors):.2e}  product {products[k][0]:.4f} ({products[k][1]:.4f})", flush=True)
    print(f"{name:12} Radiosa over Mitsuba {products[0][0] / products[1][0]:.2f} ({products[0][1] / products[1][1]:.2f})", flush=True)


if __name__ == "__main__":
    if sys.argv[1] == "draw":
        draw(*sys.argv[2:])
    else:
        program, folder, seconds, turns = sys.argv[1], pathlib.Path(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
        print(f"two threads, about {seconds} s of processor time, {turns} turns; in brackets Mitsuba without starting Python and reading the scene")
        for name in sys.argv[5:] or RACE:
            race(program, folder, seconds, turns, name)
