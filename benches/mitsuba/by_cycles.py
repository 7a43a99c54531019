"""A scene file of this folder by Blender's Cycles: one picture, linear RGB of single precision, and the processor seconds of drawing it.

    by_cycles.py SCENE.toml HEIGHT SPP SEED OUT.npy

Two threads, the light tree, paths of any length, nothing clamped, blurred or denoised, a box filter of a pixel (pip install bpy numpy). Where it means something else:
- Facets shadow as Smith has it, correlated with height (`shadowing = "smith-correlated"`): `metal` is 0.1 % to 0.2 % brighter.
- Rough glass lets through more, all in all up to 4 % more than arrives, where other facets lose some: `rough-glass` is 1 % brighter.
- With few samples a pixel its pictures have some error in common whatever the seed: the Cornell box with 2 is 1.5 % too dark, with 32 0.05 %.
- Balls are fine meshes with interpolated normals.

Blender's z is up; the middle of its environment maps lies along +x.
"""

import math
import os
import pathlib
import sys
import tempfile
import time

import bpy
import numpy as np
from mathutils import Matrix, Vector

import scenefile

BOUNCES = 1024
TURN = Matrix(((0, 0, -1), (-1, 0, 0), (0, 1, 0)))  # from y up and -z ahead


class Nodes:
    """Shaders of a tree of nodes."""

    def __init__(self, tree):
        self.tree = tree
        tree.nodes.clear()

    def __call__(self, kind, inputs, **settings):
        """A node's first output, or its last input if it has none."""
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for name, value in settings.items():
            setattr(node, name, value)
        for name, value in inputs.items():
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, node.inputs[name])
            else:
                node.inputs[name].default_value = value
        return node.outputs[0] if node.outputs else None

    def facets(self, n, k, alpha):
        inputs = {"IOR": n, "Extinction": k, "Roughness": math.sqrt(alpha)}
        return self("BsdfMetallic", inputs, distribution="GGX", fresnel_type="PHYSICAL_CONDUCTOR")

    def surface(self, kind, *values):
        if kind == "matt":
            return self("BsdfDiffuse", {"Color": (*values[0], 1)})
        if kind == "mirror":
            return self("BsdfGlossy", {"Color": (*values[0], 1), "Roughness": 0}, distribution="GGX")
        if kind == "metal":
            return self.facets(*values)
        if kind == "coated":
            matt, n, alpha = values
            return self("MixShader", {0: 0.5, 1: self.surface("matt", matt), 2: self.facets(n, (0, 0, 0), alpha)})
        ior, alpha = values
        return self("BsdfGlass", {"Color": (1, 1, 1, 1), "IOR": ior, "Roughness": math.sqrt(alpha or 0)}, distribution="GGX")


def material(name, meaning, emission):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes = Nodes(made.node_tree)
    shader = nodes.surface(*meaning)
    if emission:
        # Light goes out in front alone.
        geometry = nodes.tree.nodes.new("ShaderNodeNewGeometry")
        front = nodes("Math", {0: 1.0, 1: geometry.outputs["Backfacing"]}, operation="SUBTRACT")
        light = nodes("Emission", {"Color": (*emission, 1), "Strength": front})
        shader = light if meaning == ("matt", [0, 0, 0]) else nodes("AddShader", {0: shader, 1: light})
        made.cycles.emission_sampling = "FRONT"
    nodes("OutputMaterial", {"Surface": shader})
    return made


def world(sky):
    made = bpy.data.worlds.new("sky")
    made.use_nodes = True
    nodes = Nodes(made.node_tree)
    color = (*sky, 1) if isinstance(sky, list) else None
    if not color:
        image = bpy.data.images.load(os.path.abspath(sky))
        image.colorspace_settings.name = "Non-Color"
        color = nodes("TexEnvironment", {}, image=image, interpolation="Linear", projection="EQUIRECTANGULAR")
    nodes("OutputWorld", {"Surface": nodes("Background", {"Color": color, "Strength": 1})})
    return made


def load(path, height, spp, seed):
    """Makes the scene Blender's own."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene, blender = scenefile.Scene(path), bpy.context.scene
    materials = {name: material(name, *m) for name, m in scene.materials.items()}
    for name, points, faces, normals in scene.meshes:
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata([TURN @ Vector(p) for p in points], [], faces)
        mesh.polygons.foreach_set("use_smooth", [normals is not None] * len(faces))
        if normals:
            mesh.normals_split_custom_set_from_vertices([TURN @ Vector(n) for n in normals])
        mesh.materials.append(materials[name])
        blender.collection.objects.link(bpy.data.objects.new(name, mesh))
    if scene.sky:
        blender.world = world(scene.sky)

    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.clip_start = "VERTICAL", 1e-3
    camera.angle_y = math.radians(scene.camera["fov_y"])
    made = bpy.data.objects.new("camera", camera)
    position, target = (Vector(scene.camera[key]) for key in ("position", "look_at"))
    made.location = TURN @ position
    made.rotation_euler = (TURN @ (target - position)).to_track_quat("-Z", "Y").to_euler()
    blender.collection.objects.link(made)
    blender.camera = made

    render, settings = blender.render, blender.cycles
    render.engine, render.threads_mode, render.threads = "CYCLES", "FIXED", 2
    render.resolution_x, render.resolution_y = round(scene.camera["aspect"] * height), height
    settings.samples, settings.seed, settings.use_adaptive_sampling, settings.use_denoising = spp, seed, False, False
    settings.max_bounces = settings.diffuse_bounces = settings.glossy_bounces = settings.transmission_bounces = BOUNCES
    settings.sample_clamp_direct = settings.sample_clamp_indirect = settings.blur_glossy = 0
    settings.pixel_filter_type = "BOX"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"


def draw(path, height, spp, seed, out):
    load(path, int(height), int(spp), int(seed))
    with tempfile.TemporaryDirectory() as folder:
        bpy.context.scene.render.filepath = f"{folder}/picture.exr"
        start = time.process_time()
        bpy.ops.render.render(write_still=True)
        seconds = time.process_time() - start
        image = bpy.data.images.load(f"{folder}/picture.exr")
        image.colorspace_settings.name = "Non-Color"
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
    np.save(out, pixels.reshape(image.size[1], image.size[0], -1)[::-1, :, :3])
    print(seconds)


if __name__ == "__main__":
    draw(*sys.argv[1:])
