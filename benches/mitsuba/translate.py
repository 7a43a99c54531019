"""A scene file of Radiosa as a scene of Mitsuba 3: what the scenes of this folder use, and where both mean the same. Anything else is an error.

Where conventions differ:
- Facets are shadowed as Smith has it, towards light and viewer independently, `shadowing = "smith"`: Mitsuba knows no other. (Its Λ of Beckmann's distribution is an
  approximation good to 0.35 %, so facets are GGX here.)
- A coat is a conductor without absorption, whose Fresnel equations are those of a dielectric, mixed half and half with what is matt: `specular = 0.5`.
- Mitsuba's spots fall off linearly between two angles, those here are hard: both angles are the same but for rounding.
- Mitsuba's environment maps have rows from pole to pole, the first and the last at the poles, Radiosa's are the middles of equal bands: `make.py` writes either. Both
  have the map's middle ahead, Mitsuba along +z.
- Texture coordinates count from the upper left corner in both, with `flip_tex_coords` off.
"""

import pathlib
import tomllib

import mitsuba as mi

from scenefile import known, moved, polygons


def rgb(value):
    return {"type": "rgb", "value": [float(v) for v in value] if isinstance(value, list) else [float(value)] * 3}


def texture(textures, table, folder):
    known(table, "texture", "uv_scale")
    of = known(textures[table["texture"]], "file", "checker", "filter", "color_space")
    u, v = table.get("uv_scale", (1, 1))
    if "checker" in of:
        squares = of["checker"].get("squares", 1)
        to_uv = mi.ScalarTransform3f().scale([u * squares / 2, v * squares / 2])
        return {"type": "checkerboard", "color0": rgb(of["checker"]["even"]), "color1": rgb(of["checker"]["odd"]), "to_uv": to_uv}
    assert of["color_space"] == "linear"
    to_uv = mi.ScalarTransform3f().scale([u, v])
    return {"type": "bitmap", "filename": str(folder / of["file"]), "filter_type": of.get("filter", "bilinear"), "raw": True, "to_uv": to_uv}


def facets(m):
    """Reflection by facets, of a metal or a coat."""
    assert m["shadowing"] == "smith"
    fresnel = known(m["fresnel"], "ior", "n", "k")
    n, k = (fresnel["ior"], 0) if "ior" in fresnel else (fresnel["n"], fresnel["k"])
    return {"type": "roughconductor", "distribution": "ggx", "alpha": m["alpha"], "eta": rgb(n), "k": rgb(k)}


def bsdf(material, textures, folder):
    material = known(material, "lambert", "mirror", "cook_torrance", "glass", "emission")
    if "glass" in material:
        m = known(material["glass"], "ior", "alpha", "shadowing")
        glass = {"type": "dielectric", "int_ior": m["ior"], "ext_ior": 1.0}
        if "alpha" in m:
            assert m["shadowing"] == "smith"
            glass |= {"type": "roughdielectric", "distribution": "ggx", "alpha": m["alpha"]}
        return glass
    if "mirror" in material:
        one = {"type": "conductor", "material": "none", "specular_reflectance": rgb(material["mirror"])}
    elif "cook_torrance" in material:
        m = known(material["cook_torrance"], "diffuse", "specular", "alpha", "shadowing", "fresnel")
        one = facets(m)
        if m.get("diffuse", 0) != 0:
            assert m["specular"] == 0.5
            matt = {"type": "diffuse", "reflectance": rgb([2 * d for d in m["diffuse"]])}
            one = {"type": "blendbsdf", "weight": 0.5, "matt": matt, "coat": one}
    else:
        matt = material["lambert"]
        one = {"type": "diffuse", "reflectance": texture(textures, matt, folder) if isinstance(matt, dict) else rgb(matt)}
    return {"type": "twosided", "bsdf": one}


def scene(path, folder):
    """The scene of a file as a dictionary, and its camera's width over height. `folder` holds what it refers to, and takes meshes."""
    path = pathlib.Path(path)
    toml = tomllib.loads(path.read_text())
    known(toml, "about", "camera", "material", "texture", "shape", "light", "environment")
    textures, materials = toml.get("texture", {}), toml["material"]
    out = {"type": "scene", "integrator": {"type": "path", "max_depth": -1, "rr_depth": 8}}

    def placed(name, shape):
        material = materials[name]
        shape["bsdf"] = bsdf(material, textures, folder)
        if "emission" in material:
            shape["emitter"] = {"type": "area", "radiance": rgb(material["emission"])}
        out[f"shape-{len(out)}"] = shape

    flat = {}
    for shape in toml["shape"]:
        known(shape, "name", "material", "transform", "quad", "polygons", "mesh", "box", "sphere")
        transform = shape.get("transform", {})
        if "sphere" in shape:
            ball = known(shape["sphere"], "center", "radius")
            placed(shape["material"], {"type": "sphere", "center": moved(transform, ball.get("center", [0, 0, 0])), "radius": ball["radius"]})
        else:
            for polygon in polygons(shape):
                flat.setdefault(shape["material"], []).append([(moved(transform, p), uv) for p, uv in polygon])
    for name, faces in flat.items():
        file = folder / f"{path.stem}-{name}.obj"
        with open(file, "w") as obj:
            n = 1
            for face in faces:
                obj.writelines(f"v {p[0]!r} {p[1]!r} {p[2]!r}\nvt {uv[0]} {uv[1]}\n" for p, uv in face)
                obj.writelines(f"f {n}/{n} {i}/{i} {i + 1}/{i + 1}\n" for i in range(n + 1, n + len(face) - 1))
                n += len(face)
        placed(name, {"type": "obj", "filename": str(file), "face_normals": True, "flip_tex_coords": False})

    for name, light in toml.get("light", {}).items():
        known(light, "point", "spot", "distant", "unit", "intensity")
        assert light["unit"] == "physical"
        strength = rgb(light["intensity"])
        if "point" in light:
            one = {"type": "point", "position": light["point"], "intensity": strength}
        elif "spot" in light:
            s = known(light["spot"], "position", "look_at", "cutoff")
            up = [1, 0, 0] if s["position"][::2] == s["look_at"][::2] else [0, 1, 0]
            to_world = mi.ScalarTransform4f().look_at(origin=s["position"], target=s["look_at"], up=up)
            one = {"type": "spot", "to_world": to_world, "intensity": strength, "cutoff_angle": s["cutoff"], "beam_width": s["cutoff"] * (1 - 1e-5)}
        else:
            one = {"type": "directional", "direction": [-x for x in light["distant"]["to_light"]], "irradiance": strength}
        out[f"light-{name}"] = one
    if "environment" in toml:
        e = known(toml["environment"], "map", "radiance")
        if "map" in e:
            file = folder / e["map"].replace(".exr", "-from-pole-to-pole.exr")
            out["sky"] = {"type": "envmap", "filename": str(file), "to_world": mi.ScalarTransform4f().rotate([0, 1, 0], 180)}
        else:
            out["sky"] = {"type": "constant", "radiance": rgb(e["radiance"])}

    camera = known(next(iter(toml["camera"].values())), "position", "look_at", "fov_y", "aspect")
    out["sensor"] = {
        "type": "perspective",
        "fov_axis": "y",
        "fov": camera["fov_y"],
        "near_clip": 1e-3,
        "to_world": mi.ScalarTransform4f().look_at(origin=camera["position"], target=camera["look_at"], up=[0, 1, 0]),
    }
    return out, camera.get("aspect", 4 / 3)


def load(path, folder, height):
    """The prepared scene with a film of that height, box filter, and independent samples."""
    out, aspect = scene(path, folder)
    film = {"type": "hdrfilm", "width": round(aspect * height), "height": height, "rfilter": {"type": "box"}, "component_format": "float32"}
    out["sensor"] |= {"film": film, "sampler": {"type": "independent"}}
    return mi.load_dict(out)
