"""Called by `cargo xtask bench factors`.

  factors.py compute SCENE.obj OUT.npy   form factors by pyviewfactor, and what they took (compiling left out)
  factors.py errors REFERENCE.npz FACTORS.npz|npy …
"""

import sys
import time

import numpy as np


def read_obj(path):
    vertices, faces = [], []
    for line in open(path):
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(x) for x in words[1:4]])
        elif words[:1] == ["f"]:
            faces.append([int(x) - 1 for x in words[1:]])
    return np.array(vertices), faces


def compute(scene, out):
    import pyvista
    import pyviewfactor

    vertices, faces = read_obj(scene)

    def mesh(faces):
        return pyvista.PolyData(vertices, np.concatenate([[len(f)] + f for f in faces]))

    def factors(faces):
        # The walls of a convex room are in nobody's way: only the cube is looked for.
        cube = [f for f in faces if np.all((vertices[f] > 0.2) & (vertices[f] < 0.8)) and "cube" in scene]
        obstacles = [mesh(cube).triangulate()] if cube else None
        return pyviewfactor.compute_viewfactor_matrix(mesh(faces), obstacles=obstacles, skip_obstruction=not cube)

    factors(faces[:: max(1, len(faces) // 60)])
    cpu, wall = time.process_time(), time.perf_counter()
    f = factors(faces).T
    print(f"cpu {time.process_time() - cpu} wall {time.perf_counter() - wall}")
    np.save(out, f)


def dense(path):
    if path.endswith(".npy"):
        return np.load(path)
    z = np.load(path)
    n = int(z["shape"][0])
    f = np.zeros((n, n))
    rows = np.repeat(np.arange(n), np.diff(z["indptr"]))
    f[rows, z["indices"]] = z["data"]
    return f


def errors(reference, others):
    """Of each: the largest error of a factor, the mean over rows of the sum of errors, the largest distance of a row sum from one."""
    truth = dense(reference)
    for path in others:
        f = dense(path)
        difference = np.abs(f - truth)
        print(f"max {difference.max():.2e} rows {difference.sum(1).mean():.2e} closure {np.abs(f.sum(1) - 1).max():.2e}")


if __name__ == "__main__":
    if sys.argv[1] == "compute":
        compute(*sys.argv[2:])
    else:
        errors(sys.argv[2], sys.argv[3:])
