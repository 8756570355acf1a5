"""The rig drawn by Blender's path tracer, for tools/path_traced.py: our shapes and paint, its own sea, sky and light.

Blender is GPL: this is a tool beside the package, never imported by it. World axes are north, west, up; one unit of
radiance is that of white paint in full sun, as in `sim.scene.light`.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import numpy.typing as npt
from mathutils import Matrix

from shipland.camera import Camera
from shipland.frames import Pose
from shipland.rig import Rig, layout
from shipland.sim.scene import mesh
from shipland.sim.scene.light import Light, light
from shipland.sim.scene.mesh import Mesh
from shipland.sim.scene.paint import paints
from shipland.sim.scene.sea import cox_munk_variance, peak_wavelength_m
from shipland.sim.scene.ship import platform
from shipland.sim.scene.tone import Light16, encoded
from shipland.sim.scene_parameters import SceneParameters
from shipland.sim.state import SceneState

Rgb = tuple[float, float, float]
WORLD_FROM_NED = np.diag([1.0, -1.0, -1.0])
BLENDER_FROM_OPENCV = np.diag([1.0, -1.0, -1.0])
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
LAMP_RGB = (0.01, 1.0, 0.03)
PANEL_RGB = (0.02, 0.20, 0.04)
BEHIND_CUE_M = 0.001
"""The board's place, so that the cue itself stands at its own."""
WAVES = 12
"""Blender's resolution of its ocean: a grid of its square a tile."""
RIPPLES_PER_M, RIPPLE_M = 1.2, 1.5
"""Of the small waves' bumps: their scale, and their height over the root of the slopes' variance."""
SEA_M = 1500.0
"""So far out waves have a shape; beyond, they are only a roughness."""
FLAT_SEA_M = 40_000.0
LEAST_SUN_DEG = 2.0
SKY_PX = (96, 48)
CLOUD_IN_SUN = 0.3


@dataclass(frozen=True)
class Sky:
    """Sockets of the sky's nodes: its strength, its clouds' colour, and whether there are clouds."""

    strength: bpy.types.NodeSocket
    cloud_rgb: bpy.types.NodeSocket
    cover: bpy.types.NodeSocket


class Cycles:
    """Draws places under one light.

    Args:
        rig: dimensions and cue.
        parameters: light, air and sea.
        rng: of the sea, of clouds and of stains.
        samples: paths a pixel, at most.
    """

    def __init__(self, rig: Rig, parameters: SceneParameters, rng: np.random.Generator, samples: int) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self._rig, self._parts, self._light = rig, layout(rig), light(parameters)
        self._seed = int(rng.integers(2**31))
        self._folder = tempfile.TemporaryDirectory()
        self._scene = _settings(samples, self._seed)
        self._eye = _eye(self._scene)
        sky = _sky(self._light, float(np.radians(parameters.sun_elevation_deg)), self._seed)
        self._horizon_rgb = self._weigh_sky(sky)
        _sun(self._light)
        air = self._light.extinction_per_m
        self._paint = [_painted(layer, air, self._horizon_rgb) for layer in paints(rng, rig)]
        self._placed = self._ship(parameters)
        self._legs: bpy.types.Object | None = None
        self._tile_m, self._tile = _wave_tile(parameters, self._seed)
        slope = cox_munk_variance(parameters.wind_speed_mps)
        near = _water(self._light, 0.2 * slope, RIPPLE_M * float(np.sqrt(slope)), air, self._horizon_rgb)
        far = _water(self._light, slope, 0.0, air, self._horizon_rgb)
        self._tile.materials.append(near)
        flat = _flat_sea(FLAT_SEA_M, -parameters.significant_wave_height_m - 0.05)  # below every trough
        flat.data.materials.append(far)
        self._tiles: list[bpy.types.Object] = []

    def light(self, state: SceneState, camera: Camera) -> Light16:
        """The light (H,W,3) on the sensor, blue first, as `Scene.light` gives it."""
        poses = {
            "ship": state.ned_from_ship,
            "deck": state.ned_from_deck,
            "bar": state.ned_from_bar,
        }
        for thing, frame in self._placed:
            thing.matrix_world = _matrix(poses[frame])
        self._set_legs(state)
        self._set_eye(state.ned_from_camera, camera)
        self._set_tiles(state, camera)
        radiance = self._render(camera.width_px, camera.height_px)
        return np.rint(encoded(self._light.exposure * radiance)[..., ::-1]).astype(np.uint16)

    def _ship(self, parameters: SceneParameters) -> list[tuple[bpy.types.Object, str]]:
        rig, parts = self._rig, self._parts
        hull, house = platform(rig, parts)
        face, board = mesh.board(parts)
        plate = np.concatenate([face, board])
        plate[:, 0] += BEHIND_CUE_M
        ship = (("hull", hull, "ship"), ("house", house, "ship"))
        solids = (*ship, ("deck", mesh.deck(rig, parts), "deck"), ("board", plate, "bar"))
        placed = [(self._object(name, made), frame) for name, made, frame in solids]
        corners = rig.cue.points_in_bar_m
        cue = bpy.data.meshes.new("cue")
        cue.from_pydata(corners.tolist(), [], np.arange(len(corners)).reshape(-1, 4)[:, ::-1].tolist())
        lamp = parameters.lamp * self._light.dimming
        cue.materials.append(_lamp(lamp, self._light.extinction_per_m, self._horizon_rgb))
        placed.append((_linked("cue", cue), "bar"))
        return placed

    def _object(self, name: str, vertices: Mesh) -> bpy.types.Object:
        """Blender's object of one of our meshes, in its own frame."""
        made = bpy.data.meshes.new(name)
        count = len(vertices)
        faces = np.arange(count).reshape(-1, 3)
        made.from_pydata(vertices[:, 0:3].astype(float).tolist(), [], faces.tolist())
        made.uv_layers.new(name="UVMap").data.foreach_set("uv", np.ascontiguousarray(vertices[:, 6:8]).ravel())
        colour = made.color_attributes.new("albedo", "FLOAT_COLOR", "CORNER")
        rgba = np.column_stack([vertices[:, 8:11], np.ones(count)]).astype(np.float32)
        colour.data.foreach_set("color", rgba.ravel())
        for material in self._paint:
            made.materials.append(material)
        made.polygons.foreach_set("material_index", vertices[::3, 11].astype(np.int32))
        made.update()
        return _linked(name, made)

    def _set_legs(self, state: SceneState) -> None:
        if self._legs is not None:
            data = self._legs.data
            bpy.data.objects.remove(self._legs)
            bpy.data.meshes.remove(data)
        ship_from_deck = state.ned_from_ship.inverse() @ state.ned_from_deck
        self._legs = self._object("legs", mesh.legs(self._parts, ship_from_deck))
        self._legs.matrix_world = _matrix(state.ned_from_ship)

    def _set_eye(self, ned_from_camera: Pose, camera: Camera) -> None:
        eye, lens = self._eye, self._eye.data
        eye.matrix_world = _matrix(Pose(ned_from_camera.rotation @ BLENDER_FROM_OPENCV, ned_from_camera.translation_m))
        lens.type, lens.sensor_fit, lens.sensor_width = "PERSP", "HORIZONTAL", 36.0
        lens.lens = 36.0 * float(camera.matrix[0, 0]) / camera.width_px
        # Blender's picture runs from 0 to its width; ours has pixel centres at whole numbers.
        lens.shift_x = (0.5 * camera.width_px - (camera.matrix[0, 2] + 0.5)) / camera.width_px
        lens.shift_y = -(0.5 * camera.height_px - (camera.matrix[1, 2] + 0.5)) / camera.width_px
        lens.clip_start, lens.clip_end = 0.05, 2.0 * FLAT_SEA_M

    def _set_tiles(self, state: SceneState, camera: Camera) -> None:
        """Waves where the camera looks, and around the ship."""
        for tile in self._tiles:
            bpy.data.objects.remove(tile)
        corners = np.array([[x, y] for x in (-0.5, camera.width_px - 0.5) for y in (-0.5, camera.height_px - 0.5)])
        rays = np.column_stack([corners, np.ones(4)]) @ np.linalg.inv(camera.matrix).T
        flat = (rays @ state.ned_from_camera.rotation.T)[:, :2]
        ahead = flat.mean(axis=0) / max(float(np.linalg.norm(flat.mean(axis=0))), 1e-9)
        along, across = flat @ ahead, flat @ [-ahead[1], ahead[0]]
        steepest = float(np.abs(across / np.maximum(along, 1e-3)).max())
        eye, ship = state.ned_from_camera.translation_m[:2], state.ned_from_ship.translation_m[:2]
        reach = int(SEA_M / self._tile_m) + 1
        index = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2), axis=-1).reshape(-1, 2)
        centres = (index + np.rint(eye / self._tile_m)) * self._tile_m
        off = centres - eye
        ahead_m, aside_m = off @ ahead, np.abs(off @ [-ahead[1], ahead[0]])
        seen = (ahead_m > -self._tile_m) & (ahead_m < SEA_M) & (aside_m < steepest * ahead_m + 1.5 * self._tile_m)
        close = np.linalg.norm(centres - ship, axis=1) < 1.5 * self._tile_m + 10.0
        self._tiles = []
        for north, east in centres[seen | close].tolist():
            tile = _linked("sea", self._tile)
            tile.location = (north, -east, 0.0)
            self._tiles.append(tile)

    def _weigh_sky(self, sky: Sky) -> Rgb:
        """Give the clear sky the brightness that ours sheds on a level plane, then the clouds theirs.

        Returns:
            The mean colour at the horizon.
        """
        width, height = SKY_PX
        lens = self._eye.data
        lens.type, lens.panorama_type = "PANO", "EQUIRECTANGULAR"
        upright = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        self._eye.matrix_world = Matrix(np.block([[upright, np.zeros((3, 1))], [np.zeros((1, 3)), 1.0]]).tolist())
        upper = self._render(width, height)[: height // 2]
        up = np.sin(np.pi * (0.5 - (np.arange(height // 2) + 0.5) / height))
        weight = np.cos(np.arcsin(up)) * up
        mean = (upper.mean(axis=1) * weight[:, None]).sum(axis=0) / weight.sum()
        here = self._light
        wanted = 0.5 * (here.zenith_rgb + here.horizon_rgb)
        factor = float(wanted @ LUMINANCE / max(mean @ LUMINANCE, 1e-6))
        cloud = (0.45 * here.horizon_rgb + 0.25 * here.zenith_rgb + CLOUD_IN_SUN * here.sun_rgb) / factor
        sky.strength.default_value = factor
        sky.cloud_rgb.default_value = (*cloud.tolist(), 1.0)
        sky.cover.default_value = 1.0
        red, green, blue = self._render(width, height)[height // 2 - 2 : height // 2].mean(axis=(0, 1)).tolist()
        return red, green, blue

    def _render(self, width_px: int, height_px: int) -> npt.NDArray[np.float64]:
        """(h,w,3) linear RGB."""
        render = self._scene.render
        render.resolution_x, render.resolution_y, render.resolution_percentage = width_px, height_px, 100
        path = Path(self._folder.name) / "picture.exr"
        render.filepath = str(path)
        with _silent():
            bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(str(path))
        image.colorspace_settings.name = "Non-Color"
        values = np.empty(4 * width_px * height_px, np.float32)
        image.pixels.foreach_get(values)
        bpy.data.images.remove(image)
        return values.reshape(height_px, width_px, 4)[::-1, :, :3].astype(float)


@contextmanager
def _silent() -> Iterator[None]:
    """Blender tells of every picture on standard output."""
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def _matrix(ned_from_mesh: Pose) -> Matrix:
    turned = Pose(WORLD_FROM_NED @ ned_from_mesh.rotation, WORLD_FROM_NED @ ned_from_mesh.translation_m)
    return Matrix(turned.matrix().tolist())


def _linked(name: str, data: bpy.types.ID) -> bpy.types.Object:
    thing = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(thing)
    return thing


def _settings(samples: int, seed: int) -> bpy.types.Scene:
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    tracer = scene.cycles
    tracer.device, tracer.samples, tracer.seed = "CPU", samples, seed % 2**30
    tracer.use_adaptive_sampling, tracer.adaptive_threshold, tracer.adaptive_min_samples = True, 0.03, 16
    tracer.use_denoising = False
    tracer.max_bounces, tracer.diffuse_bounces, tracer.glossy_bounces = 3, 2, 2
    tracer.sample_clamp_indirect = 10.0
    tracer.pixel_filter_type = "BOX"  # a sensor's pixel gathers what falls on it
    tracer.filter_width = 1.0
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.view_settings.view_transform = "Raw"
    scene.render.use_persistent_data = True
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    return scene


def _eye(scene: bpy.types.Scene) -> bpy.types.Object:
    eye = _linked("eye", bpy.data.cameras.new("eye"))
    scene.camera = eye
    return eye


def _nodes(thing: bpy.types.ID) -> tuple[bpy.types.Nodes, bpy.types.NodeLinks]:
    thing.use_nodes = True
    thing.node_tree.nodes.clear()
    return thing.node_tree.nodes, thing.node_tree.links


def _sky(here: Light, elevation_rad: float, seed: int) -> Sky:
    """Blender's scattering sky, clear until its clouds are given a colour."""
    world = bpy.data.worlds.new("sky")
    bpy.context.scene.world = world
    nodes, links = _nodes(world)
    air = nodes.new("ShaderNodeTexSky")
    air.sky_type, air.sun_disc = "MULTIPLE_SCATTERING", False
    air.sun_elevation = max(elevation_rad, np.radians(LEAST_SUN_DEG))
    sun = WORLD_FROM_NED @ here.sun_in_ned
    air.sun_rotation = float(np.arctan2(sun[0], sun[1]))  # clockwise from +y
    where, noise, ramp, product, mix, cloud = (
        nodes.new(f"ShaderNode{name}") for name in ("TexCoord", "TexNoise", "ValToRGB", "Math", "MixRGB", "RGB")
    )
    noise.noise_dimensions = "4D"
    noise.inputs["W"].default_value = float(seed % 997)
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = 4.0, 6.0
    start = float(np.clip(0.75 - 0.5 * here.cloud_cover, 0.0, 0.9))
    ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = start, start + 0.12
    product.operation = "MULTIPLY"
    product.inputs[1].default_value = 0.0
    links.new(where.outputs["Generated"], noise.inputs["Vector"])
    links.new(noise.outputs[0], ramp.inputs[0])
    links.new(ramp.outputs[0], product.inputs[0])
    links.new(product.outputs[0], mix.inputs["Fac"])
    links.new(air.outputs[0], mix.inputs["Color1"])
    links.new(cloud.outputs[0], mix.inputs["Color2"])
    back, out = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeOutputWorld")
    links.new(mix.outputs[0], back.inputs["Color"])
    links.new(back.outputs[0], out.inputs["Surface"])
    return Sky(back.inputs["Strength"], cloud.outputs[0], product.inputs[1])


def _sun(here: Light) -> None:
    lamp = bpy.data.lights.new("sun", "SUN")
    strength = float(np.pi * here.sun_rgb.max())
    lamp.energy, lamp.angle = strength, 0.00930
    lamp.color = (here.sun_rgb / max(float(here.sun_rgb.max()), 1e-9)).tolist()
    thing = _linked("sun", lamp)
    towards = WORLD_FROM_NED @ here.sun_in_ned  # a lamp shines along its own −z
    side = np.cross([0.0, 0.0, 1.0], towards)
    side = side / np.linalg.norm(side) if np.linalg.norm(side) > 1e-6 else np.array([1.0, 0.0, 0.0])
    rotation = np.column_stack([side, np.cross(towards, side), towards])
    thing.matrix_world = Matrix(np.block([[rotation, np.zeros((3, 1))], [np.zeros((1, 3)), 1.0]]).tolist())


def _seen_through(
    nodes: bpy.types.Nodes,
    links: bpy.types.NodeLinks,
    surface: bpy.types.NodeSocket,
    extinction_per_m: float,
    horizon_rgb: Rgb,
) -> None:
    """Put the air between a surface and the camera: light lost on the way, and the horizon's gained."""
    path, product, power, loss, is_eye = (
        nodes.new("ShaderNodeLightPath"),
        *(nodes.new("ShaderNodeMath") for _ in range(4)),
    )
    product.operation, power.operation, loss.operation, is_eye.operation = (
        "MULTIPLY",
        "EXPONENT",
        "SUBTRACT",
        "MULTIPLY",
    )
    product.inputs[1].default_value = -extinction_per_m
    links.new(path.outputs["Ray Length"], product.inputs[0])
    links.new(product.outputs[0], power.inputs[0])
    loss.inputs[0].default_value = 1.0
    links.new(power.outputs[0], loss.inputs[1])
    links.new(loss.outputs[0], is_eye.inputs[0])
    links.new(path.outputs["Is Camera Ray"], is_eye.inputs[1])
    air, mix, out = (nodes.new(f"ShaderNode{name}") for name in ("Emission", "MixShader", "OutputMaterial"))
    air.inputs["Color"].default_value = (*horizon_rgb, 1.0)
    links.new(is_eye.outputs[0], mix.inputs[0])
    links.new(surface, mix.inputs[1])
    links.new(air.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], out.inputs["Surface"])


def _painted(layer: npt.NDArray[np.uint8], extinction_per_m: float, horizon_rgb: Rgb) -> bpy.types.Material:
    """Matt paint: the faces' albedo times a painted texture."""
    factor = 4.0 * (layer.astype(np.float32) / 255.0) ** 2
    size = len(factor)
    image = bpy.data.images.new("paint", size, size, float_buffer=True, is_data=True)
    image.pixels.foreach_set(np.concatenate([factor, np.ones((size, size, 1), np.float32)], axis=2).ravel())
    image.pack()
    material = bpy.data.materials.new("paint")
    nodes, links = _nodes(material)
    texture, albedo, product, matt = (
        nodes.new(f"ShaderNode{name}") for name in ("TexImage", "VertexColor", "MixRGB", "BsdfDiffuse")
    )
    texture.image, albedo.layer_name = image, "albedo"
    product.blend_type = "MULTIPLY"
    product.inputs["Fac"].default_value = 1.0
    links.new(texture.outputs[0], product.inputs["Color1"])
    links.new(albedo.outputs[0], product.inputs["Color2"])
    links.new(product.outputs[0], matt.inputs["Color"])
    _seen_through(nodes, links, matt.outputs[0], extinction_per_m, horizon_rgb)
    return material


def _lamp(lamp: float, extinction_per_m: float, horizon_rgb: Rgb) -> bpy.types.Material:
    material = bpy.data.materials.new("cue")
    nodes, links = _nodes(material)
    glow, panel, both = (nodes.new(f"ShaderNode{name}") for name in ("Emission", "BsdfDiffuse", "AddShader"))
    glow.inputs["Color"].default_value = (*LAMP_RGB, 1.0)
    face, strength = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeMath")
    strength.operation = "MULTIPLY_ADD"  # nothing backwards, onto the board
    strength.inputs[1].default_value, strength.inputs[2].default_value = -lamp, lamp
    links.new(face.outputs["Backfacing"], strength.inputs[0])
    links.new(strength.outputs[0], glow.inputs["Strength"])
    panel.inputs["Color"].default_value = (*PANEL_RGB, 1.0)
    links.new(glow.outputs[0], both.inputs[0])
    links.new(panel.outputs[0], both.inputs[1])
    _seen_through(nodes, links, both.outputs[0], extinction_per_m, horizon_rgb)
    return material


def _water(
    here: Light, slope_variance: float, ripples: float, extinction_per_m: float, horizon_rgb: Rgb
) -> bpy.types.Material:
    """A dielectric over the light that comes out of the water; waves too small to have a shape are its roughness."""
    material = bpy.data.materials.new("water")
    nodes, links = _nodes(material)
    gloss, body, share, mix = (
        nodes.new(f"ShaderNode{name}") for name in ("BsdfAnisotropic", "Emission", "Fresnel", "MixShader")
    )
    alpha = float(np.sqrt(slope_variance))  # of GGX: both directions' slope variance together is about alpha²
    gloss.inputs["Roughness"].default_value = float(np.sqrt(alpha))
    gloss.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    body.inputs["Color"].default_value = (*here.water_rgb.tolist(), 1.0)
    share.inputs["IOR"].default_value = 1.33
    if ripples > 0.0:
        where, noise, bump = (nodes.new(f"ShaderNode{name}") for name in ("NewGeometry", "TexNoise", "Bump"))
        noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = RIPPLES_PER_M, 4.0
        bump.inputs["Distance"].default_value = ripples
        links.new(where.outputs["Position"], noise.inputs["Vector"])
        links.new(noise.outputs[0], bump.inputs["Height"])
        links.new(bump.outputs[0], gloss.inputs["Normal"])
        links.new(bump.outputs[0], share.inputs["Normal"])
    links.new(share.outputs[0], mix.inputs[0])
    links.new(body.outputs[0], mix.inputs[1])
    links.new(gloss.outputs[0], mix.inputs[2])
    _seen_through(nodes, links, mix.outputs[0], extinction_per_m, horizon_rgb)
    return material


def _wave_tile(parameters: SceneParameters, seed: int) -> tuple[float, bpy.types.Mesh]:
    """A tile of Blender's ocean of the scene's significant height: its side [m], and its mesh."""
    height_m = max(parameters.significant_wave_height_m, 0.02)
    peak_m = max(float(peak_wavelength_m(height_m)), 4.0)
    tile_m = int(max(4.0 * peak_m, 40.0))
    made = _linked("ocean", bpy.data.meshes.new("ocean"))
    waves = made.modifiers.new("ocean", "OCEAN")
    waves.geometry_mode, waves.resolution, waves.viewport_resolution = "GENERATE", WAVES, WAVES
    waves.spatial_size, waves.random_seed, waves.spectrum = tile_m, seed % 10_000, "PIERSON_MOSKOWITZ"
    waves.wind_velocity = float(np.sqrt(9.81 * peak_m / (2.0 * np.pi)) * 0.88)
    waves.wave_direction = float(-np.radians(parameters.wave_direction_deg))
    waves.choppiness, waves.wave_scale_min, waves.wave_alignment = 0.8, 0.05, 0.5
    shape = bpy.data.meshes.new_from_object(made.evaluated_get(bpy.context.evaluated_depsgraph_get()))
    bpy.data.objects.remove(made)
    points = np.empty(3 * len(shape.vertices), np.float32)
    shape.vertices.foreach_get("co", points)
    points = points.reshape(-1, 3)
    points[:, 2] *= 0.25 * height_m / max(float(points[:, 2].std()), 1e-6)
    shape.vertices.foreach_set("co", points.ravel())
    shape.polygons.foreach_set("use_smooth", np.ones(len(shape.polygons), bool))
    shape.update()
    return float(tile_m), shape


def _flat_sea(half_m: float, up_m: float) -> bpy.types.Object:
    plane = bpy.data.meshes.new("far sea")
    plane.from_pydata(
        [(x * half_m, y * half_m, up_m) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], [], [(0, 1, 2, 3)]
    )
    return _linked("far sea", plane)
