"""Writes a plain room (crates/radiosa/examples/diffuse_room.rs) for POV-Ray 3.7 with radiosity: povray.py SCENE.toml OUTPUT.pov ASPECT COUNT ERROR_BOUND LIGHTS

A flat lamp is a grid of LIGHTS x LIGHTS spotlights of cosine power (radius and falloff of 90 degrees, tightness 1) that fade by the square of the distance: together
L A cos cos'/d^2, reflected by rho/pi. What is seen of it is a skin that radiosity does not see, so that its light is not counted twice; what the lamp reflects is done by
a second skin behind.
"""

import math
import pathlib
import sys
import tomllib

UNIT = 100  # POV-Ray's in a metre: its smallest distances are absolute
SKIN = 1e-4  # metres
LARGEST = 0.3  # side of a lamp in metres: rays that gather radiosity take a lamp for a point at its centre, which may be hidden by what hides little of the whole
FADE = 0.1  # distance in units below which light fades no more


def vector(v):
    return "<" + ",".join(f"{x * UNIT:.9g}" for x in v) + ">"


def color(c):
    return "rgb <" + ",".join(f"{v:.7g}" for v in c) + ">"


def difference(a, b):
    return [x - y for x, y in zip(a, b)]


def along(a, t, b):
    return [x + t * y for x, y in zip(a, b)]


def area_vector(corners):
    """Along the normal, as long as the polygon is large."""
    sums = [0.0] * 3
    for k in range(1, len(corners) - 1):
        a, b = difference(corners[k], corners[0]), difference(corners[k + 1], corners[0])
        sums = along(sums, 0.5, [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
    return sums


def mesh2(positions, faces, look):
    triangles = [(f[0], f[k], f[k + 1]) for f in faces for k in range(1, len(f) - 1)]
    return (
        f"mesh2 {{ vertex_vectors {{ {len(positions)}, {', '.join(map(vector, positions))} }}"
        f" face_indices {{ {len(triangles)}, {', '.join(f'<{a},{b},{c}>' for a, b, c in triangles)} }} {look} }}"
    )


def matt(rgb):
    return f"texture {{ pigment {{ {color(rgb)} }} finish {{ ambient 0 diffuse 1 }} }}"


def faded(strength):
    """The colour of a light of that intensity, W/sr: reflected by rho, not rho/pi, and POV-Ray fades by 2/(1 + (d/FADE)^2)."""
    return [s * UNIT * UNIT / (2 * math.pi * FADE * FADE) for s in strength]


def lamps(corners, emission, lights):
    """A parallelogram, in parts that are not too large, or a disc of many corners."""
    normal = area_vector(corners)
    area = math.hypot(*normal)
    normal = [x / area for x in normal]
    centre = [sum(p[i] for p in corners) / len(corners) for i in range(3)]
    if len(corners) == 4:
        side1, side2 = difference(corners[1], corners[0]), difference(corners[3], corners[0])
        if math.dist(corners[2], along(along(corners[0], 1, side1), 1, side2)) > 1e-3 * math.sqrt(area):
            raise ValueError("a lamp is no parallelogram")
        n1, n2 = (math.ceil(math.hypot(*side) / LARGEST) for side in (side1, side2))
        lights = max(2, math.ceil(lights / max(n1, n2)))
        for i in range(n1 * n2):
            middle = along(along(centre, (i % n1 + 0.5) / n1 - 0.5, side1), (i // n1 + 0.5) / n2 - 0.5, side2)
            yield lamp(middle, normal, [x / n1 for x in side1], [x / n2 for x in side2], [e * area / (n1 * n2) for e in emission], lights, "")
    elif len(corners) > 8:
        side1 = difference(corners[0], centre)
        side1 = [2 * math.sqrt(area / math.pi) * x / math.hypot(*side1) for x in side1]
        side2 = [normal[1] * side1[2] - normal[2] * side1[1], normal[2] * side1[0] - normal[0] * side1[2], normal[0] * side1[1] - normal[1] * side1[0]]
        yield lamp(centre, normal, side1, side2, [e * area for e in emission], lights, "circular")
    else:
        raise ValueError("a lamp is neither a parallelogram nor a disc")


def lamp(centre, normal, side1, side2, intensity, lights, shape):
    # (Its outermost lights are half a cell inside.)
    side1, side2 = ([x * (lights - 1) / lights for x in side] for side in (side1, side2))
    return (
        f"light_source {{ {vector(along(centre, SKIN, normal))} color {color(faded(intensity))} spotlight radius 90 falloff 90 tightness 1"
        f" point_at {vector(along(centre, 1, normal))} area_light {vector(side1)}, {vector(side2)}, {lights}, {lights} {shape} adaptive 1 jitter"
        f" area_illumination on fade_distance {FADE} fade_power 2 }}"
    )


def emitter(positions, faces, material, lights):
    behind = list(positions)
    for face in faces:
        normal = area_vector([positions[i] for i in face])
        for i in face:
            behind[i] = along(positions[i], -SKIN / math.hypot(*normal), normal)
    glow = f"texture {{ pigment {{ {color(material['emission'])} }} finish {{ ambient 0 diffuse 0 emission 1 }} }} no_shadow no_radiosity"
    yield mesh2(positions, faces, glow)
    yield mesh2(behind, faces, matt(material["lambert"]))
    for face in faces:
        yield from lamps([positions[i] for i in face], material["emission"], lights)


def surfaces(scene, lights):
    whole = {}
    for shape in scene["shape"]:
        material = scene["material"][shape["material"]]
        if "sphere" in shape:
            ball = shape["sphere"]
            yield f"sphere {{ {vector(ball['center'])}, {ball['radius'] * UNIT:.6g} {matt(material['lambert'])} }}"
        elif "emission" in material:
            yield from emitter(shape["mesh"]["positions"], shape["mesh"]["faces"], material, lights)
        else:
            positions, faces = whole.setdefault(shape["material"], ([], []))
            faces += [[i + len(positions) for i in face] for face in shape["mesh"]["faces"]]
            positions += shape["mesh"]["positions"]
    for name, (positions, faces) in whole.items():
        yield mesh2(positions, faces, matt(scene["material"][name]["lambert"]))


def light(one):
    strength = one["intensity"]
    fade = f"color {color(faded(strength))} fade_distance {FADE} fade_power 2"
    if "point" in one:
        return f"light_source {{ {vector(one['point'])} {fade} }}"
    if "spot" in one:
        spot = one["spot"]
        cone = f"spotlight radius {spot['cutoff']} falloff {spot['cutoff']} tightness 0 point_at {vector(spot['look_at'])}"
        return f"light_source {{ {vector(spot['position'])} {fade} {cone} }}"
    sun = [1e4 * x for x in one["distant"]["to_light"]]
    return f"light_source {{ {vector(sun)} color {color([s / math.pi for s in strength])} parallel point_at <0,0,0> }}"


def scene_text(scene, aspect, count, bound, lights):
    yield "#version 3.7;\nglobal_settings { assumed_gamma 1.0 max_trace_level 20 ambient_light rgb 0"
    yield f"  radiosity {{ count {count} error_bound {bound} pretrace_start 0.08 pretrace_end 0.02 recursion_limit 8"
    yield "    nearest_count 8 low_error_factor 0.5 gray_threshold 0 minimum_reuse 0.005 brightness 1 adc_bailout 0.002 } }"
    camera = scene["camera"]["main"]
    across = 2 * math.degrees(math.atan(aspect * math.tan(math.radians(camera["fov_y"] / 2))))
    # POV-Ray is left-handed: the picture is mirrored back by the camera's right vector.
    yield f"camera {{ perspective location {vector(camera['position'])} direction z right {-aspect!r}*x up y angle {across!r} look_at {vector(camera['look_at'])} }}"
    if "environment" in scene:
        yield f"sky_sphere {{ pigment {{ {color(scene['environment']['radiance'])} }} }}"
    yield from map(light, scene.get("light", {}).values())
    yield from surfaces(scene, lights)


if __name__ == "__main__":
    scene = tomllib.loads(pathlib.Path(sys.argv[1]).read_text())
    text = scene_text(scene, float(sys.argv[3]), int(sys.argv[4]), float(sys.argv[5]), int(sys.argv[6]))
    pathlib.Path(sys.argv[2]).write_text("\n".join(text) + "\n")
