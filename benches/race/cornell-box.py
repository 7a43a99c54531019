"""Writes the Cornell box of crates/radiosa-testkit/data for POV-Ray: cornell-box.py OUTPUT.pov COUNT ERROR_BOUND LIGHTS

The luminaire is a grid of LIGHTS x LIGHTS spotlights of cosine power (radius and falloff of 90 degrees, tightness 1) that fade by the square of the distance: together
L A cos cos'/d^2, reflected by rho/pi.
"""

import json
import math
import pathlib
import sys

output, count, bound, lights = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
data = pathlib.Path(__file__).parent / "../../crates/radiosa-testkit/data/cornell-box/scene.json"
scene = json.loads(data.read_text())
camera = scene["camera"]


def vector(v):
    # Metres; POV-Ray is left-handed: the picture is mirrored back by the camera's right vector.
    return "<" + ",".join(repr(x * 0.001) for x in v) + ">"


text = ["#version 3.7;", "global_settings {", "  assumed_gamma 1.0", "  max_trace_level 5", "  ambient_light rgb 0"]
text += [f"  radiosity {{ count {count} error_bound {bound} pretrace_start 0.08 pretrace_end 0.02 recursion_limit 8",
         "    nearest_count 8 low_error_factor 0.5 gray_threshold 0 minimum_reuse 0.005 brightness 1 adc_bailout 0.002 }", "}"]
text += ["camera { perspective location " + vector(camera["position"]) + " direction z right -x up y",
         f"  angle {camera['fov_deg']} look_at " + vector(camera["look_at"]) + " }"]
for surface in scene["surfaces"]:
    material = scene["materials"][surface["material"]]
    rgb = "<" + ",".join(map(repr, material["reflectance"])) + ">"
    emission = material.get("emission")
    finish = "finish { ambient 0 diffuse 1 }"
    pigment = f"pigment {{ rgb {rgb} }}"
    if emission:
        pigment = "pigment { rgb <" + ",".join(map(repr, emission)) + "> }"
        finish = "finish { ambient 0 diffuse 0 emission 1 }"
    for polygon in surface["polygons"]:
        for k in range(1, len(polygon) - 1):
            corners = ", ".join(vector(p) for p in (polygon[0], polygon[k], polygon[k + 1]))
            # (What emits gathers no radiosity and casts no shadow on its own lights.)
            extra = "no_shadow no_radiosity" if emission else ""
            text.append(f"triangle {{ {corners} texture {{ {pigment} {finish} }} {extra} }}")
    if emission:
        a, b, _, d = surface["polygons"][0]
        side1, side2 = [b[i] - a[i] for i in range(3)], [d[i] - a[i] for i in range(3)]
        area = math.dist(a, b) * math.dist(a, d) * 1e-6
        centre = [a[i] + 0.5 * (side1[i] + side2[i]) for i in range(3)]
        below = [centre[0], centre[1] - 100, centre[2]]
        fade = 0.01
        color = "<" + ",".join(repr(e * area / (2 * math.pi * fade * fade)) for e in emission) + ">"
        text.append(
            f"light_source {{ {vector(centre)} color rgb {color} spotlight radius 90 falloff 90 tightness 1 point_at {vector(below)}"
            f" area_light {vector(side1)}, {vector(side2)}, {lights}, {lights} adaptive 1 jitter area_illumination on"
            f" fade_distance {fade} fade_power 2 }}"
        )
pathlib.Path(output).write_text("\n".join(text) + "\n")
