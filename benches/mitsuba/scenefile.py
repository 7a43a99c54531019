"""A scene file of Radiosa as those read it who translate it for another program. Anything not known is an error."""

import math
import pathlib
import tomllib

FACES = [(0, 4, 6, 2), (5, 1, 3, 7), (0, 1, 5, 4), (2, 6, 7, 3), (1, 0, 2, 3), (4, 5, 7, 6)]
UPRIGHT = [(0, 1), (1, 1), (1, 0), (0, 0)]


def known(table, *keys):
    unknown = set(table) - set(keys)
    if unknown:
        raise ValueError(f"{sorted(unknown)} cannot be translated")
    return table


def rgb(value):
    return [float(v) for v in value] if isinstance(value, list) else [float(value)] * 3


def moved(transform, p):
    known(transform, "rotate", "translate")
    if "rotate" in transform:
        r = known(transform["rotate"], "axis", "degrees")
        assert r["axis"] == [0, 1, 0]
        c, s = math.cos(math.radians(r["degrees"])), math.sin(math.radians(r["degrees"]))
        p = [c * p[0] + s * p[2], p[1], c * p[2] - s * p[0]]
    return [a + b for a, b in zip(p, transform.get("translate", [0, 0, 0]))]


def polygons(shape):
    """Polygons of a shape, each a list of corners with texture coordinates."""
    if "quad" in shape:
        return [list(zip(shape["quad"], UPRIGHT))]
    if "polygons" in shape:
        return [[(p, (0, 0)) for p in polygon] for polygon in shape["polygons"]]
    if "mesh" in shape:
        mesh = known(shape["mesh"], "positions", "faces")
        return [[(mesh["positions"][i], (0, 0)) for i in face] for face in mesh["faces"]]
    box = known(shape["box"], "min", "max", "inward")
    corner = lambda i: [box["max" if i >> axis & 1 else "min"][axis] for axis in range(3)]
    order = reversed if box.get("inward") else iter
    return [[(corner(i), (0, 0)) for i in order(face)] for face in FACES]


def ball(center, radius, n=128):
    """Corners, triangles and normals of a sphere: its outline is off by 3·10⁻⁴ of the radius at most."""
    at = lambda j, i: j * 2 * n + i % (2 * n)
    angles = [(j * math.pi / n, i * math.pi / n) for j in range(n + 1) for i in range(2 * n)]
    normals = [[math.sin(y) * math.cos(x), math.cos(y), math.sin(y) * math.sin(x)] for y, x in angles]
    faces = [(at(j, i), at(j + 1, i + 1), at(j + 1, i)) for j in range(1, n) for i in range(2 * n)]
    faces += [(at(j, i), at(j, i + 1), at(j + 1, i + 1)) for j in range(n - 1) for i in range(2 * n)]
    return [[c + radius * v for c, v in zip(center, normal)] for normal in normals], faces, normals


def meaning(material):
    """What kind a material is, and what tells it: ("matt", reflectance), ("mirror", reflectance), ("metal", n, k, alpha), ("coated", reflectance below, n, alpha): half and half,
    ("glass", ior, alpha or None)."""
    known(material, "lambert", "mirror", "cook_torrance", "glass", "emission")
    if "glass" in material:
        m = known(material["glass"], "ior", "alpha", "shadowing")
        return "glass", m["ior"], m.get("alpha")
    if "mirror" in material:
        return "mirror", rgb(material["mirror"])
    if "cook_torrance" not in material:
        if isinstance(material["lambert"], dict):
            raise ValueError("textures cannot be translated")
        return "matt", rgb(material["lambert"])
    m = known(material["cook_torrance"], "diffuse", "specular", "alpha", "shadowing", "fresnel")
    fresnel = known(m["fresnel"], "ior", "n", "k")
    n, k = (fresnel["ior"], 0) if "ior" in fresnel else (fresnel["n"], fresnel["k"])
    if m.get("diffuse", 0 if k else 0.5) == 0:
        assert m.get("specular", 1) == 1
        return "metal", rgb(n), rgb(k), m["alpha"]
    assert m["specular"] == 0.5 and not k
    return "coated", [2 * d for d in m["diffuse"]], rgb(n), m["alpha"]


class Scene:
    """`camera` (with "aspect"), `sky` (None, a colour or a file), `materials` by name, each a `meaning` and what it emits, and `meshes`: (material's name, corners, triangles,
    their corners' normals or None if flat)."""

    def __init__(self, path):
        path = pathlib.Path(path)
        toml = known(tomllib.loads(path.read_text()), "about", "camera", "material", "shape", "environment")
        self.camera = {"aspect": 4 / 3} | known(next(iter(toml["camera"].values())), "position", "look_at", "fov_y", "aspect")
        sky = known(toml.get("environment", {}), "map", "radiance")
        self.sky = str(path.parent / sky["map"]) if "map" in sky else rgb(sky["radiance"]) if sky else None
        self.materials = {name: (meaning(m), rgb(m["emission"]) if "emission" in m else None) for name, m in toml["material"].items()}
        self.meshes, flat = [], {}
        for shape in toml["shape"]:
            known(shape, "name", "material", "transform", "quad", "polygons", "mesh", "box", "sphere")
            move = lambda p: moved(shape.get("transform", {}), p)
            if "sphere" in shape:
                sphere = known(shape["sphere"], "center", "radius")
                self.meshes.append((shape["material"], *ball(move(sphere.get("center", [0, 0, 0])), sphere["radius"])))
                continue
            points, faces = flat.setdefault(shape["material"], ([], []))
            for polygon in polygons(shape):
                first = len(points)
                points += [move(p) for p, _ in polygon]
                faces += [(first, i, i + 1) for i in range(first + 1, first + len(polygon) - 1)]
        self.meshes += [(name, *mesh, None) for name, mesh in flat.items()]
