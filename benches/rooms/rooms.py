"""Rooms of diffuse surfaces, and what Mitsuba 3.9 says of the irradiance at points of them.

rooms.py make FOLDER [NAME...]   writes NAME.obj, NAME.mtl, NAME.pts and NAME.csv (the reference) for each room, where they are not there yet
rooms.py error REFERENCE.csv MEASURED.csv   mean and largest relative error, the mean of the signed ones, and the largest beyond two standard errors

A sensor's reference is what a path tracer sees of the surface it lies on: E = pi L / rho. Mitsuba (pip install mitsuba==3.9.1 numpy) needs an LLVM newer than 15: on
Debian 12 libllvm19 with DRJIT_LIBLLVM_PATH=/usr/lib/x86_64-linux-gnu/libLLVM-19.so.
"""

import csv
import pathlib
import random
import sys

N_SENSORS = 100
N_PATHS = 1 << 18  # a sensor


class Room:
    def __init__(self, seed):
        self.random = random.Random(seed)
        self.materials = {}  # name: (reflectance, emission)
        self.quads = []  # (material, four corners, counter-clockwise from the front)

    def material(self, name, reflectance, emission=(0, 0, 0)):
        self.materials[name] = (tuple(reflectance), tuple(emission))
        return name

    def quad(self, material, a, b, c, d):
        self.quads.append((material, [a, b, c, d]))

    def box(self, material, low, high, inward=False, without=(), turn=0.0):
        """Faces x0 x1 y0 y1 z0 z1 that are not left out; turned about the vertical through its middle."""
        import math

        (x0, y0, z0), (x1, y1, z1) = low, high
        p = [(x, y, z) for z in (z0, z1) for y in (y0, y1) for x in (x0, x1)]
        if turn:
            cx, cz, c, s = (x0 + x1) / 2, (z0 + z1) / 2, math.cos(turn), math.sin(turn)
            p = [(cx + (x - cx) * c - (z - cz) * s, y, cz + (x - cx) * s + (z - cz) * c) for x, y, z in p]
        faces = {"x0": (0, 4, 6, 2), "x1": (5, 1, 3, 7), "y0": (0, 1, 5, 4), "y1": (2, 6, 7, 3), "z0": (1, 0, 2, 3), "z1": (4, 5, 7, 6)}
        for name, f in faces.items():
            if name not in without:
                corners = [p[i] for i in (reversed(f) if inward else f)]
                self.quad(material, *corners)

    def lamp(self, x, z, y, width, depth, emission):
        name = self.material("lamp", (0, 0, 0), emission)
        a, b = width / 2, depth / 2
        self.quad(name, (x - a, y, z - b), (x + a, y, z - b), (x + a, y, z + b), (x - a, y, z + b))

    def colors(self, n, low, high):
        of = lambda: [round(self.random.uniform(low, high), 3) for _ in range(3)]
        return [self.material(f"m{k}", of()) for k in range(n)]


def partitions():
    room = Room(1)
    walls, other = room.colors(2, 0.45, 0.75)
    room.box(walls, (0, 0, 0), (8, 3, 6), inward=True)
    for x, z0, z1, high in [(2, 0, 4.2, 3), (4, 1.6, 6, 2.2), (6, 0, 3.5, 3)]:
        room.box(other, (x, 0, z0), (x + 0.12, high, z1), without=("y0",))
    room.lamp(1, 3, 2.98, 0.6, 0.6, (12, 11, 9))
    room.lamp(5, 2, 2.98, 0.8, 0.4, (10, 10, 10))
    room.lamp(7, 4.5, 2.98, 0.5, 0.5, (9, 11, 13))
    return room


def boxes(seed=2, n=40, low=0.3, high=0.8, turned=False):
    room = Room(seed)
    names = room.colors(6, low, high)
    room.box(names[0], (0, 0, 0), (6, 3, 5), inward=True)
    r = room.random
    for k in range(n):
        size = [r.uniform(0.2, 0.9), r.uniform(0.2, 1.4), r.uniform(0.2, 0.9)]
        at = [r.uniform(0.3, 5.7 - size[0]), 0 if k % 3 else r.uniform(0, 1.2), r.uniform(0.3, 4.7 - size[2])]
        room.box(names[k % 6], at, [a + s for a, s in zip(at, size)], turn=r.uniform(0, 1.5) if turned else 0)
    room.lamp(3, 2.5, 2.98, 1.2, 0.8, (14, 13, 12))
    return room


def boxes_white():
    return boxes(3, 40, 0.85, 0.9)


def crooked():
    return boxes(4, 60, 0.88, 0.9, turned=True)


def maze():
    room = Room(5)
    names = room.colors(5, 0.5, 0.9)
    room.box(names[0], (0, 0, 0), (8, 2.5, 8), inward=True)
    for i in range(1, 4):
        for j in range(4):
            # Walls of one sheet, along z and along x, most of them as high as the room.
            high = 2.5 if (i + j) % 3 else 1.7
            a, b = 2 * j + (0.6 if (i + j) % 2 else 0), 2 * j + (2 if (i + j) % 2 else 1.3)
            room.quad(names[1 + (i + j) % 4], (2 * i, 0, b), (2 * i, 0, a), (2 * i, high, a), (2 * i, high, b))
            if j % 2:
                room.quad(names[1 + (i * j) % 4], (a, 0, 2 * i), (b, 0, 2 * i), (b, high, 2 * i), (a, high, 2 * i))
    for x, z in [(1, 1), (5, 3), (3, 7), (7, 5)]:
        room.lamp(x, z, 2.48, 0.5, 0.5, (12, 12, 11))
    return room


def l_shaped():
    room = Room(6)
    a, b, c = room.colors(3, 0.4, 0.8)
    # Floor and ceiling of an L: a rectangle 6 x 3 and one 3 x 4 beside it.
    for x0, z0, x1, z1 in [(0, 0, 6, 3), (0, 3, 3, 7)]:
        room.quad(a, (x0, 0, z0), (x0, 0, z1), (x1, 0, z1), (x1, 0, z0))
        room.quad(b, (x0, 2.7, z0), (x1, 2.7, z0), (x1, 2.7, z1), (x0, 2.7, z1))
    ring = [(0, 0), (6, 0), (6, 3), (3, 3), (3, 7), (0, 7)]
    for (x0, z0), (x1, z1) in zip(ring, ring[1:] + ring[:1]):
        room.quad(b, (x0, 0, z0), (x1, 0, z1), (x1, 2.7, z1), (x0, 2.7, z0))
    # A wall across each leg with a door, the doors with a gap of 2 cm below.
    room.box(c, (3, 0, 0), (3.1, 2.7, 1.1), without=("y0", "y1", "z0"))
    room.box(c, (3, 0, 2), (3.1, 2.7, 3), without=("y0", "y1"))
    room.box(c, (3, 2.1, 1.1), (3.1, 2.7, 2), without=("y1", "z0", "z1"))
    room.box(a, (3.03, 0.02, 1.1), (3.07, 2.1, 2))
    room.box(c, (0, 0, 4.5), (1.8, 2.7, 4.6), without=("y0", "y1", "x0"))
    room.box(c, (2.5, 0, 4.5), (3, 2.7, 4.6), without=("y0", "y1", "x1"))
    room.lamp(4.5, 1.5, 2.68, 0.9, 0.3, (14, 14, 14))
    room.lamp(1.5, 6, 2.68, 0.5, 0.5, (8, 7, 6))
    return room


def office():
    room = Room(7)
    walls, wood, metal, cloth, white = room.colors(5, 0.3, 0.8)
    room.box(walls, (0, 0, 0), (10, 2.8, 8), inward=True)
    for i in range(3):
        for j in range(3):
            x, z = 1 + 3 * i, 1 + 2.4 * j
            room.box(wood, (x, 0.72, z), (x + 1.6, 0.75, z + 0.8))
            for dx in (0, 1.55):
                for dz in (0, 0.75):
                    room.box(metal, (x + dx, 0, z + dz), (x + dx + 0.05, 0.72, z + dz + 0.05), without=("y0", "y1"))
            room.box(white, (x + 0.6, 0.75, z + 0.2), (x + 1.0, 0.77, z + 0.4))
            room.box(metal, (x + 0.55, 0.82, z + 0.28), (x + 1.05, 1.15, z + 0.31))
            room.box(metal, (x + 0.78, 0.77, z + 0.28), (x + 0.82, 0.82, z + 0.31), without=("y0", "y1"))
            room.box(cloth, (x + 0.5, 0.42, z + 1.0), (x + 1.0, 0.5, z + 1.5))
            room.box(cloth, (x + 0.5, 0.5, z + 1.44), (x + 1.0, 1.0, z + 1.5), without=("y0",))
            room.box(metal, (x + 0.7, 0, z + 1.2), (x + 0.8, 0.42, z + 1.3), without=("y0", "y1"))
    for k in range(6):
        # Cabinets side by side along a wall: they touch it and each other.
        room.box(white, (9.5, 0, 0.5 + 0.8 * k), (10, 1.2 + 0.2 * (k % 3), 1.3 + 0.8 * k), without=("y0", "x1"))
    for x in (2, 5, 8):
        for z in (2, 6):
            room.lamp(x, z, 2.79, 1.2, 0.3, (11, 11, 10))
    return room


ROOMS = {"partitions": partitions, "boxes": boxes, "boxes-white": boxes_white, "crooked": crooked, "maze": maze, "l-shaped": l_shaped, "office": office}


def write_obj(room, path, only=None):
    with open(path, "w") as out:
        if only is None:
            out.write(f"mtllib {path.stem}.mtl\n")
        n = 1
        for k, (material, corners) in enumerate(room.quads):
            if only in (None, material):
                out.write(f"o quad{k}\nusemtl {material}\n" if only is None else "")
                out.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in corners)
                out.write(f"f {n} {n + 1} {n + 2} {n + 3}\n")
                n += 4


def write(room, folder, name):
    write_obj(room, folder / f"{name}.obj")
    with open(folder / f"{name}.mtl", "w") as out:
        for material, (kd, ke) in room.materials.items():
            text = lambda v: " ".join(map(repr, v))
            out.write(f"newmtl {material}\nillum 1\nKd {text(kd)}\nKs 0 0 0\nKe {text(ke)}\n")


def reference(room, folder, name):
    import mitsuba as mi
    import numpy as np

    mi.set_variant("llvm_ad_rgb")
    import drjit as dr

    scene = {"type": "scene"}
    for material, (kd, ke) in room.materials.items():
        part = folder / f"{name}-{material}.obj"
        write_obj(room, part, material)
        bsdf = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(kd)}}}
        shape = {"type": "obj", "filename": str(part), "face_normals": True, "bsdf": bsdf}
        if any(ke):
            shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": list(ke)}}
        scene[material] = shape
    scene = mi.load_dict(scene)
    corners = [np.array(c, float) for _, c in room.quads]
    areas = np.array([np.linalg.norm(np.cross(c[1] - c[0], c[3] - c[0])) for c in corners])
    choose = np.random.default_rng(1)
    integrator = mi.load_dict({"type": "path", "max_depth": 200, "rr_depth": 8})
    rows, mean = [], 0.0
    tried = 0
    while len(rows) < N_SENSORS and tried < 20 * N_SENSORS:
        tried += 1
        k = choose.choice(len(areas), p=areas / areas.sum())
        material, c = room.quads[k][0], corners[k]
        kd, ke = map(np.array, room.materials[material])
        u, v = choose.uniform(0.02, 0.98, 2)
        p = c[0] + u * (c[1] - c[0]) + v * (c[3] - c[0])
        n = np.cross(c[1] - c[0], c[3] - c[0])
        n /= np.linalg.norm(n)
        if any(ke) or not kd.min() > 0:
            continue

        def look(count, seed):
            sampler = mi.load_dict({"type": "independent"})
            sampler.seed(seed, count)
            o = mi.Point3f(*(p + 1e-3 * n).tolist())
            ray = mi.RayDifferential3f(dr.zeros(mi.Point3f, count) + o, dr.zeros(mi.Vector3f, count) + mi.Vector3f(*(-n).tolist()))
            radiance = integrator.sample(scene, sampler, ray)[0]
            return np.array(radiance).reshape(3, -1).T.astype(float) * np.pi / kd

        # What is inside of a box or covered is dark.
        if look(4096, 7).mean() < max(1e-2 * mean, 1e-4):
            continue
        e = look(N_PATHS, 100 + tried)
        mean = (mean * len(rows) + e.mean()) / (len(rows) + 1)
        rows.append((p, n, e.mean(0), e.std(0) / N_PATHS**0.5))
    with open(folder / f"{name}.pts", "w") as out:
        out.writelines(" ".join(map(repr, [*map(float, p), *map(float, n)])) + "\n" for p, n, _, _ in rows)
    with open(folder / f"{name}.csv", "w") as out:
        out.write("r,g,b,se_r,se_g,se_b\n")
        out.writelines(",".join(repr(float(x)) for x in [*e, *se]) + "\n" for _, _, e, se in rows)


def error(reference, measured):
    import numpy as np

    truth = np.array([[float(x) for x in row.values()] for row in csv.DictReader(open(reference))])
    got = np.array([[float(row[f"irradiance_{c}"]) for c in "rgb"] for row in csv.DictReader(open(measured))])
    e, se = truth[:, :3], truth[:, 3:]
    off = (got - e) / e
    beyond = np.maximum(np.abs(off) - 2 * se / e, 0)
    worst = np.unravel_index(beyond.argmax(), beyond.shape)[0]
    print(f"mean {abs(off).mean():.2%}  signed {off.mean():+.2%}  worst {abs(off).max():.2%}  beyond 2 se {beyond.max():.2%} at {worst + 1}  reference's se {(se / e).mean():.2%}")


if __name__ == "__main__":
    if sys.argv[1] == "make":
        folder = pathlib.Path(sys.argv[2])
        for name in sys.argv[3:] or ROOMS:
            if not (folder / f"{name}.csv").exists():
                room = ROOMS[name]()
                write(room, folder, name)
                reference(room, folder, name)
    else:
        error(*sys.argv[2:4])
