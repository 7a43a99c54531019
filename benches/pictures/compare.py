"""Pictures beside reference pictures that another renderer (Tungsten) made of the same scene data: ꟻLIP, means, and a picture of the differences.

    compare.py RADIOSA SCENE.gltf REFERENCE.exr PARTS SPP OUT.png [OPTION...]

The picture has 1/PARTS of the reference's pixels a side, whose blocks are averaged. OUT.png shows ours, the reference (both with the reference's exposure) and where we are brighter
(red) or darker (blue), full at a quarter of the reference's value and its mean. (pip install flip-evaluator mitsuba==3.9.1 numpy pillow.)
"""

import pathlib
import subprocess
import sys
import tempfile

import flip_evaluator
import mitsuba as mi
import numpy as np
from PIL import Image

mi.set_variant("scalar_rgb")


def read(path):
    return np.array(mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False), np.float64)


def averaged(picture, parts):
    height, width, _ = picture.shape
    return picture.reshape(height // parts, parts, width // parts, parts, 3).mean((1, 3))


def shown(picture, exposure):
    x = np.clip(picture * exposure, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def main(program, scene, reference, parts, spp, out, *options):
    reference = averaged(read(reference), int(parts))
    height, width, _ = reference.shape
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "picture.exr"
        command = [program, "render", scene, "--method", "path", "--size", f"{width}x{height}", "--spp", spp, "--layers", "none", "--quiet", "-o", file, *options]
        subprocess.run([str(word) for word in command], check=True)
        ours = read(file)
    luminance = lambda picture: picture @ [0.2126, 0.7152, 0.0722]
    exposure = 0.5 / np.quantile(luminance(reference), 0.75)
    pictures = [shown(picture, exposure) for picture in (ours, reference)]
    _, flip, _ = flip_evaluator.evaluate(pictures[1].astype(np.float32), pictures[0].astype(np.float32), "LDR")
    mean = luminance(reference).mean()
    relative = luminance(ours - reference) / (luminance(reference) + mean)
    print(f"ꟻLIP {flip:.4f}, mean {100 * (luminance(ours).mean() / mean - 1):+.2f} %, by channel {np.round(100 * (ours.mean((0, 1)) / reference.mean((0, 1)) - 1), 2)} %")
    print(f"median of pixels {100 * np.median(luminance(ours) / np.maximum(luminance(reference), 1e-6) - 1):+.2f} %, mean of |difference|/(reference + mean) {np.abs(relative).mean():.4f}")
    # By squares of an eighth of the height: where differences are systematic.
    step = height // 8
    squares = relative[: step * (height // step), : step * (width // step)].reshape(height // step, step, width // step, step).mean((1, 3))
    print("mean relative differences of squares, %:")
    print("\n".join(" ".join(f"{100 * v:+6.1f}" for v in row) for row in squares))
    strength = np.clip(relative / 0.25, -1, 1)[..., None]
    colors = 1 - np.abs(strength) * np.where(strength > 0, [0, 1, 1], [1, 1, 0])
    Image.fromarray((255 * np.concatenate([*pictures, colors], 1)).round().astype(np.uint8)).save(out)


if __name__ == "__main__":
    main(*sys.argv[1:])
