"""Plain rooms (crates/radiosa/examples/diffuse_room.rs) by Mitsuba 3.9.1's `path`, and what pictures of them are compared with.

    paths.py prepare ROOM.toml ROOM.json               the room and its meshes beside it, as Mitsuba reads them fastest
    paths.py draw ROOM.json WxH SPP SEED OUTPUT.exr    one picture
    paths.py mask ROOM.json WxH MASK.png
    paths.py reference ROOM.toml WxH NOISE MASK.png OUTPUT.exr RADIOSA    by `radiosa render --method path`: two halves whose difference tells the noise, until it is
                                                       below NOISE; prints it

References are Radiosa's because its paths need less time for them; that Mitsuba's pictures have the same means says that both mean the same.

The mask is white where a pixel and its eight neighbours, at 4 x 4 points each, see surfaces of one material that turn by less than 15 degrees and do not step back, none of them
emissive: it leaves out silhouettes, edges, lamps, the sky, and meshes finer than pixels. The noise is relMSE as `picture_error --epsilon mean` has it.
"""

import json
import pathlib
import subprocess
import sys

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")

AT_ONCE = 64  # samples a pixel: more take too much memory
SIDE = 4  # points along a side of a pixel
TURN = 0.966  # cosine of 15 degrees
STEP = 0.02  # of the distance from the eye
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def prepare(room, out):
    sys.path.append(str(pathlib.Path(__file__).parent.parent / "mitsuba"))
    import translate

    scene, _ = translate.scene(room, pathlib.Path(out).parent)
    for shape in scene.values():
        if isinstance(shape, dict) and shape["type"] == "obj":
            del shape["flip_tex_coords"]
            file = shape["filename"].replace(".obj", ".ply")
            mi.load_dict({"type": "obj", "filename": shape["filename"], "face_normals": True}).write_ply(file)
            shape |= {"type": "ply", "filename": file}
    pathlib.Path(out).write_text(json.dumps(scene, default=lambda transform: {"matrix": np.array(transform.matrix).tolist()}))


def load(path, size):
    scene = json.loads(pathlib.Path(path).read_text(), object_hook=lambda o: mi.ScalarTransform4f(o["matrix"]) if "matrix" in o else o)
    width, height = map(int, size.split("x"))
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}, "component_format": "float32"}
    scene["sensor"] |= {"film": film, "sampler": {"type": "independent"}}
    return mi.load_dict(scene)


def picture(scene, spp, seed):
    n = -(-spp // AT_ONCE)
    shares = [spp // n + (k < spp % n) for k in range(n)]
    return sum(share * np.array(mi.render(scene, spp=share, seed=1000 * seed + k), np.float64)[..., :3] for k, share in enumerate(shares)) / spp


def write(picture, path):
    mi.Bitmap(picture.astype(np.float32)).write(str(path))


def seen(scene):
    """Of each point of each pixel: material (0 for none and for lamps), normal, place, and the distance from the eye."""
    width, height = scene.sensors()[0].film().size()
    x, y = np.meshgrid((np.arange(width * SIDE) + 0.5) / (width * SIDE), (np.arange(height * SIDE) + 0.5) / (height * SIDE))
    place = mi.Point2f(x.ravel().astype(np.float32), y.ravel().astype(np.float32))
    ray, _ = scene.sensors()[0].sample_ray(0, 0, place, mi.Point2f(0.5))
    hit = scene.ray_intersect(ray)
    of = np.zeros(len(x.ravel()))
    for k, shape in enumerate(scene.shapes()):
        if not shape.is_emitter():
            of[np.array(hit.is_valid() & (hit.shape == mi.ShapePtr(shape)))] = k + 1
    points = lambda v: np.array(v).T.reshape(height * SIDE, width * SIDE, 3)
    return of.reshape(height * SIDE, -1), points(hit.n), points(hit.p), np.array(hit.t).reshape(height * SIDE, -1)


def mask(scene):
    of, n, p, t = seen(scene)
    reach = 3 * SIDE
    height, width = of.shape[0] // SIDE, of.shape[1] // SIDE
    good = np.zeros((height, width), bool)
    middle = lambda v: v[SIDE + SIDE // 2 : -SIDE : SIDE, SIDE + SIDE // 2 : -SIDE : SIDE]
    inside = middle(of) > 0
    for j in range(reach):
        for i in range(reach):
            there = lambda v: v[j : j + (height - 2) * SIDE : SIDE, i : i + (width - 2) * SIDE : SIDE]
            inside &= there(of) == middle(of)
            # (A side of a surface is as good as the other.)
            inside &= np.abs((there(n) * middle(n)).sum(-1)) > TURN
            inside &= np.abs(((there(p) - middle(p)) * middle(n)).sum(-1)) < STEP * middle(t)
    good[1:-1, 1:-1] = inside
    return good


def noise_of(halves, good):
    """relMSE of the mean of two independent pictures, and the mean."""
    mean = (halves[0] + halves[1]) / 2
    epsilon = 0.5 * (mean @ LUMINANCE).mean() ** 2
    return ((halves[0] - halves[1]) ** 2 / (mean**2 + epsilon))[good].mean() / 4, mean


def reference(room, size, noise, good, out, radiosa):
    """Halves that grow round by round, of seeds that no race has."""
    sums, rounds, is_at, one = [0, 0], 0, np.inf, str(pathlib.Path(out).with_suffix(".part.exr"))
    while is_at > noise:
        for k in range(2):
            words = [radiosa, "render", room, "--method", "path", "--spp", 32, "--size", size, "--threads", 2, "--layers", "none", "-q"]
            subprocess.run([str(word) for word in words + ["--seed", 1000 + 2 * rounds + k, "-o", one]], check=True)
            bitmap = mi.Bitmap(one).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
            sums[k] = sums[k] + np.array(bitmap, np.float64)
        rounds += 1
        is_at, mean = noise_of([s / rounds for s in sums], good)
        print(f"{is_at:.3e}", flush=True)
        write(mean, out)


if __name__ == "__main__":
    what, room, *rest = sys.argv[1:]
    if what == "prepare":
        prepare(room, *rest)
    elif what == "draw":
        size, spp, seed, out = rest
        write(picture(load(room, size), int(spp), int(seed)), out)
    elif what == "mask":
        size, out = rest
        mi.Bitmap((255 * mask(load(room, size))).astype(np.uint8)[..., None]).write(out)
    else:
        size, noise, good, out, radiosa = rest
        reference(room, size, float(noise), np.atleast_3d(np.array(mi.Bitmap(good)))[..., 0] > 0, out, radiosa)
