"""A scene file of this folder by Mitsuba's `path`: one picture, linear RGB, and the processor seconds of drawing it.

    by_mitsuba.py SCENE.toml HEIGHT SPP SEED OUT.npy
"""

import pathlib
import sys
import time

import numpy as np

from ztest import mitsuba
import translate

AT_ONCE = 64  # samples a pixel: more take too much memory


def draw(path, height, spp, seed, out):
    scene = translate.load(path, pathlib.Path(path).parent, int(height))
    start = time.process_time()
    n = -(-int(spp) // AT_ONCE)
    shares = [int(spp) // n + (k < int(spp) % n) for k in range(n)]
    picture = sum(share * mitsuba(scene, share, n * int(seed) + k) for k, share in enumerate(shares)) / int(spp)
    seconds = time.process_time() - start
    np.save(out, picture.astype(np.float32))
    print(seconds)


if __name__ == "__main__":
    draw(*sys.argv[1:])
