"""Plain rooms (crates/radiosa/examples/diffuse_room.rs, as paths.py prepares them) by Blender's Cycles without a denoiser.

    by_cycles.py ROOM.json WxH SPP SEED OUTPUT.exr

Two threads; paths of any length, nothing clamped, a box filter of a pixel. (pip install bpy==4.5.15, which wants Python 3.11.) Lamps without size are not known
to it, and refused. Where surfaces lie in the plane of others, as in the living room, Cycles shows black.
"""

import json
import math
import pathlib
import sys

import numpy as np

BOUNCES = 1024


def rgb(of):
    return [float(x) for x in of["value"]]


def diffuse(shape):
    bsdf = shape["bsdf"]
    return rgb((bsdf["bsdf"] if bsdf["type"] == "twosided" else bsdf)["reflectance"])


def parts(room):
    """What there is by kind: shapes with a file or a ball, distant lights, the constant background, the camera."""
    scene = [part for part in json.loads(pathlib.Path(room).read_text()).values() if isinstance(part, dict)]
    kinds = {"ply", "sphere", "directional", "constant", "perspective", "path"}
    for part in scene:
        if part["type"] not in kinds:
            sys.exit(f"{room}: no {part['type']} here")
    return {kind: [part for part in scene if part["type"] == kind] for kind in kinds}


def camera_of(scene):
    camera = scene["perspective"][0]
    return np.array(camera["to_world"]["matrix"]), float(camera["fov"])


def ball(shape, n=64):
    """Corners and triangles of a sphere."""
    phi, theta = np.meshgrid(np.arange(2 * n) * math.pi / n, np.arange(n + 1) * math.pi / n)
    points = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], -1).reshape(-1, 3)
    at = lambda j, i: j * 2 * n + i % (2 * n)
    faces = [f for j in range(n) for i in range(2 * n) for f in ((at(j, i), at(j + 1, i + 1), at(j + 1, i)), (at(j, i), at(j, i + 1), at(j + 1, i + 1)))]
    return points * shape["radius"] + np.array(shape["center"]), faces


def cycles(room, size, spp, seed, out):
    import bpy
    from mathutils import Matrix, Vector

    scene = parts(room)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender = bpy.context.scene

    def material(shape):
        made = bpy.data.materials.new("m")
        made.use_nodes = True
        nodes, links = made.node_tree.nodes, made.node_tree.links
        nodes.clear()
        output, matt = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfDiffuse")
        matt.inputs["Color"].default_value = (*diffuse(shape), 1)
        shader = matt.outputs[0]
        if "emitter" in shape:
            # (Light goes out in front alone.)
            emission, dark, side, both, mix = [nodes.new(f"ShaderNode{name}") for name in ("Emission", "Emission", "NewGeometry", "AddShader", "MixShader")]
            emission.inputs["Color"].default_value = (*rgb(shape["emitter"]["radiance"]), 1)
            dark.inputs["Strength"].default_value = 0
            links.new(side.outputs["Backfacing"], mix.inputs[0])
            links.new(emission.outputs[0], mix.inputs[1])
            links.new(dark.outputs[0], mix.inputs[2])
            links.new(mix.outputs[0], both.inputs[0])
            links.new(shader, both.inputs[1])
            shader = both.outputs[0]
        links.new(shader, output.inputs[0])
        return made

    for shape in scene["ply"]:
        bpy.ops.wm.ply_import(filepath=shape["filename"], forward_axis="Y", up_axis="Z")
        made = bpy.context.object.data
        made.shade_flat()
        made.materials.append(material(shape))
    for shape in scene["sphere"]:
        points, faces = ball(shape)
        made = bpy.data.meshes.new("ball")
        made.from_pydata(points.tolist(), [], faces)
        made.materials.append(material(shape))
        blender.collection.objects.link(bpy.data.objects.new("ball", made))
    for light in scene["directional"]:
        irradiance = rgb(light["irradiance"])
        sun = bpy.data.lights.new("sun", "SUN")
        sun.angle, sun.energy, sun.color = 0, max(irradiance), [x / max(irradiance) for x in irradiance]
        made = bpy.data.objects.new("sun", sun)
        made.rotation_euler = Vector(light["direction"]).to_track_quat("-Z", "Y").to_euler()
        blender.collection.objects.link(made)
    for sky in scene["constant"]:
        blender.world = bpy.data.worlds.new("sky")
        blender.world.use_nodes = True
        blender.world.node_tree.nodes["Background"].inputs[0].default_value = (*rgb(sky["radiance"]), 1)
    to_world, fov = camera_of(scene)
    camera = bpy.data.cameras.new("camera")
    made = bpy.data.objects.new("camera", camera)
    made.matrix_world = Matrix((to_world @ np.diag([-1, 1, -1, 1])).tolist())
    camera.sensor_fit, camera.clip_start = "VERTICAL", 1e-3
    camera.angle_y = math.radians(fov)
    blender.collection.objects.link(made)
    blender.camera = made
    render, settings = blender.render, blender.cycles
    render.engine, render.threads_mode, render.threads = "CYCLES", "FIXED", 2
    render.resolution_x, render.resolution_y = map(int, size.split("x"))
    settings.samples, settings.seed, settings.use_adaptive_sampling, settings.use_denoising = spp, seed, False, False
    settings.max_bounces = settings.diffuse_bounces = BOUNCES
    settings.sample_clamp_direct = settings.sample_clamp_indirect = 0
    settings.pixel_filter_type, settings.filter_width = "BOX", 1
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.filepath = str(pathlib.Path(out).resolve())
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    room, size, spp, seed, out = sys.argv[1:]
    cycles(room, size, int(spp), int(seed), out)
