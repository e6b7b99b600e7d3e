"""Tests in Blender: `python -m unittest test_blender` with the package bpy, and the zip in PHOTONCARD_ZIP.

The zip is installed as a user installs it. Radiance is compared with that of Cycles. PHOTONCARD_PICTURES
names a folder for pictures of both side by side.
"""

from __future__ import annotations

import importlib
import math
import os
import sys
import tempfile
import time
import unittest
from pathlib import Path

os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="photoncard-user-")

import bpy  # noqa: E402
import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parent))

import rendering  # noqa: E402
import scenes  # noqa: E402

ZIP = os.environ.get("PHOTONCARD_ZIP", "")
MODULE = "bl_ext.user_default.photoncard"
# Noise of a draft and of Cycles' samples, and differences of the two models of reflection.
TOLERANCE = 0.05


def setUpModule() -> None:
    """Installs the zip by Blender's own operator, and enables the extension."""
    if not ZIP:
        raise unittest.SkipTest("PHOTONCARD_ZIP names no zip: make one by build.py")
    bpy.ops.preferences.addon_enable(module="cycles")
    bpy.ops.extensions.package_install_files(filepath=ZIP, repo="user_default", enable_on_install=True)


def draft(scene: bpy.types.Scene) -> bpy.types.Scene:
    """The scene with a quick quality, rendered by photoncard."""
    scene.render.engine = "PHOTONCARD"
    scene.photoncard.quality = "draft"
    rendering.use_cycles(scene, 64)
    return scene


class Pictures(unittest.TestCase):
    def compare(self, scene: bpy.types.Scene, name: str) -> dict[str, np.ndarray]:
        """Renders a scene by both engines, and compares the mean radiance."""
        with tempfile.TemporaryDirectory() as folder:
            ours = rendering.passes(scene, "PHOTONCARD", Path(folder))
            theirs = rendering.passes(scene, "CYCLES", Path(folder))
        pictures = os.environ.get("PHOTONCARD_PICTURES")
        if pictures:
            rendering.save_png(
                Path(pictures) / f"{name}.png", rendering.colour(ours), rendering.colour(theirs)
            )
        mean, expected = (rendering.colour(each).mean(axis=(0, 1)) for each in (ours, theirs))
        print(f"{name}: {mean} beside {expected} of Cycles", file=sys.stderr)
        np.testing.assert_allclose(mean, expected, rtol=TOLERANCE)
        self.assertLess(np.abs(ours["Combined.A"] - theirs["Combined.A"]).mean(), 0.01)
        return ours

    def test_an_orthographic_plan_has_the_radiance_of_cycles(self) -> None:
        self.compare(draft(scenes.plan()), "plan")

    def test_a_product_shot_has_the_radiance_of_cycles(self) -> None:
        channels = self.compare(draft(scenes.product()), "product")
        self.assertLess(channels["Combined.A"].min(), 0.01)

    def test_a_furnished_room_has_the_radiance_of_cycles(self) -> None:
        self.compare(draft(scenes.room()), "room")


class Passes(unittest.TestCase):
    def test_all_passes_are_there_with_their_values(self) -> None:
        scene = draft(scenes.plan())
        layer = bpy.context.view_layer
        named = (
            "use_pass_z",
            "use_pass_normal",
            "use_pass_position",
            "use_pass_cryptomatte_object",
            "use_pass_cryptomatte_material",
        )
        own = ("use_pass_direct", "use_pass_indirect", "use_pass_caustics", "use_pass_albedo")
        for owner, names in ((layer, named), (layer.photoncard, own)):
            for name in names:
                setattr(owner, name, True)
        bpy.ops.scene.view_layer_add_lightgroup(name="sky")
        bpy.ops.scene.view_layer_add_lightgroup(name="sun")
        scene.world.lightgroup, bpy.data.objects["sun"].lightgroup = "sky", "sun"
        try:
            with tempfile.TemporaryDirectory() as folder:
                channels = rendering.passes(scene, "PHOTONCARD", Path(folder))
        finally:
            for owner, names in ((layer, named), (layer.photoncard, own)):
                for name in names:
                    setattr(owner, name, False)
        combined = rendering.colour(channels)
        parts = sum(rendering.colour(channels, name) for name in ("Direct", "Indirect", "Caustics"))
        np.testing.assert_allclose(parts, combined, rtol=1e-3, atol=1e-4)
        groups = [rendering.colour(channels, f"Combined_{name}") for name in ("sky", "sun")]
        self.assertTrue(all(group.mean() > 0.01 for group in groups))
        self.assertTrue((groups[0] + groups[1] <= combined + 1e-4).all())
        # The ground is 8 m below the camera, and faces it.
        corner = (scenes.HEIGHT - 3, 3)
        self.assertAlmostEqual(
            float(channels["Depth.Z" if "Depth.Z" in channels else "Depth.V"][corner]), 8, delta=0.01
        )
        np.testing.assert_allclose(
            [channels[f"Normal.{axis}"][corner] for axis in "XYZ"], (0, 0, 1), atol=1e-3
        )
        # The picture is 7 m wide, its middle at 0.3 m plus a shift of 0.35 m.
        across = 0.3 + 0.35 + 7 * (3.5 / scenes.WIDTH - 0.5)
        self.assertAlmostEqual(float(channels["Position.X"][corner]), across, delta=0.03)
        self.assertAlmostEqual(float(channels["Position.Z"][corner]), 0, delta=1e-3)
        albedo = [channels[f"Denoising Albedo.{channel}"][corner] for channel in "RGB"]
        np.testing.assert_allclose(albedo, (0.6, 0.6, 0.55), atol=0.02)
        ids = channels["CryptoObject00.R" if "CryptoObject00.R" in channels else "CryptoObject00.r"]
        self.assertGreaterEqual(len(np.unique(ids)), 4)


class World(unittest.TestCase):
    def test_a_gradient_is_baked_and_as_bright_as_in_cycles(self) -> None:
        scene = draft(scenes.clear())
        scenes.quad(
            "ground",
            [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)],
            scenes.matte("ground", (0.5, 0.5, 0.5)),
        )
        scenes.box("wall", (-2, 1, 0), (2, 1.2, 1.5), scenes.matte("wall", (0.7, 0.7, 0.7)))
        scenes.camera((1, -5, 2), (0, 0, 1), lens=24)
        tree = scene.world.node_tree
        coordinates, apart = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeSeparateXYZ")
        join = tree.nodes.new("ShaderNodeCombineColor")
        tree.links.new(coordinates.outputs["Generated"], apart.inputs[0])
        for index, axis in enumerate("XYZ"):
            half = tree.nodes.new("ShaderNodeMath")
            half.operation = "MULTIPLY_ADD"
            half.inputs[1].default_value = half.inputs[2].default_value = 0.5
            tree.links.new(apart.outputs[axis], half.inputs[0])
            tree.links.new(half.outputs[0], join.inputs[index])
        tree.links.new(join.outputs[0], tree.nodes["Background"].inputs["Color"])
        scenes.world_input(scene, "Strength").default_value = 2.0
        with tempfile.TemporaryDirectory() as folder:
            ours = rendering.colour(rendering.passes(scene, "PHOTONCARD", Path(folder)))
            theirs = rendering.colour(rendering.passes(scene, "CYCLES", Path(folder)))
        # The directions of the world are those of Cycles, in the background too.
        np.testing.assert_allclose(ours[:8].mean(axis=0), theirs[:8].mean(axis=0), atol=0.02)
        np.testing.assert_allclose(
            ours.mean(axis=(0, 1)), theirs.mean(axis=(0, 1)), rtol=TOLERANCE, atol=0.01
        )

    def test_an_unsaid_world_is_named_without_baking(self) -> None:
        world = importlib.import_module(f"{MODULE}.export.world")
        notices = importlib.import_module(f"{MODULE}.notices").Notices()
        scene = scenes.clear()
        tree = scene.world.node_tree
        tree.links.new(
            tree.nodes.new("ShaderNodeTexNoise").outputs["Color"], tree.nodes["Background"].inputs["Color"]
        )
        self.assertFalse(world.world_of(scene.world, None, notices).is_lit)
        self.assertRegex(notices.lines()[0], "Noise Texture.*tick Bake World Nodes.*world")


class Brightness(unittest.TestCase):
    """Numbers of the exported lights beside what Cycles renders of each."""

    HEIGHT = 4.0
    CASES = (
        ("POINT", {"energy": 60.0, "shadow_soft_size": 0.0}),
        ("POINT", {"energy": 60.0, "shadow_soft_size": 0.2, "normalize": False}),
        ("SPOT", {"energy": 60.0, "shadow_soft_size": 0.05}),
        ("SUN", {"energy": 3.0, "angle": 0.02}),
        ("SUN", {"energy": 3000.0, "angle": 0.1, "normalize": False}),
        ("AREA", {"energy": 40.0, "size": 0.2}),
        ("AREA", {"energy": 40.0, "size": 0.2, "shape": "ELLIPSE", "size_y": 0.1, "exposure": 1.0}),
        ("AREA", {"energy": 40.0, "size": 0.2, "shape": "RECTANGLE", "size_y": 0.1, "normalize": False}),
        ("POINT", {"energy": 60.0, "shadow_soft_size": 0.0, "use_temperature": True, "temperature": 3000.0}),
    )

    def test_lights_have_the_numbers_that_cycles_renders(self) -> None:
        objects = importlib.import_module(f"{MODULE}.export.objects")
        cameras = importlib.import_module(f"{MODULE}.export.camera")
        for kind, properties in self.CASES:
            known = getattr(bpy.types, f"{kind.title()}Light").bl_rna.properties
            if not properties.keys() <= set(known.keys()):
                # Blender 4.2 has no exposure, temperature and normalization of lights.
                continue
            with self.subTest(kind=kind, **properties):
                scene = scenes.clear()
                scenes.quad(
                    "floor",
                    [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)],
                    scenes.matte("floor", (0.5, 0.5, 0.5)),
                )
                scenes.lamp("lamp", kind, (0, 0, self.HEIGHT), **properties)
                scenes.camera((0, 0, 2), (0, 0, 0), type="ORTHO", ortho_scale=0.05)
                rendering.use_cycles(scene, 256)
                scene.render.resolution_x = scene.render.resolution_y = 16
                graph = bpy.context.evaluated_depsgraph_get()
                exported = objects.export(graph, scene.camera, cameras.frame_of(scene.render)).glb.root
                with tempfile.TemporaryDirectory() as folder:
                    seen = rendering.colour(rendering.passes(scene, "CYCLES", Path(folder))).mean(axis=(0, 1))
                expected = 0.5 / math.pi * self.irradiance(exported)
                np.testing.assert_allclose(seen, expected, rtol=0.02)

    def irradiance(self, root: dict) -> np.ndarray:
        """Irradiance of the floor below the light of a document."""
        lights = root.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
        if lights:
            value = np.array(lights[0]["color"]) * lights[0]["intensity"]
            return value if lights[0]["type"] == "directional" else value / self.HEIGHT**2
        node = next(node for node in root["nodes"] if node["name"] == "lamp")
        area = node["extras"]["photoncard"]["area_light"]
        size = math.prod(area["size"]) * (math.pi / 4 if area["shape"] == "ellipse" else 1)
        return np.array(area["radiance"]) * size / self.HEIGHT**2


class Nodes(unittest.TestCase):
    """Values of node chains on an image beside what Cycles renders of them."""

    def board(self, tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
        node = tree.nodes.new("ShaderNodeTexImage")
        pixels = scenes.checker()
        pixels[:32, :, :3] *= (0.5, 1, 0.8)
        node.image = scenes.image("board", pixels)
        node.interpolation = "Closest"
        mapping = tree.nodes.new("ShaderNodeMapping")
        mapping.inputs["Location"].default_value = (0.3, 0.1, 0)
        mapping.inputs["Rotation"].default_value = (0, 0, 0.4)
        mapping.inputs["Scale"].default_value = (2, 1.5, 1)
        uv = tree.nodes.new("ShaderNodeUVMap")
        tree.links.new(uv.outputs["UV"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs["Vector"], node.inputs["Vector"])
        return node.outputs["Color"]

    def chain(
        self, tree: bpy.types.NodeTree, kind: str, settings: dict, inputs: dict, out: int
    ) -> bpy.types.NodeSocket:
        node = tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        for number, value in inputs.items():
            socket = [each for each in node.inputs if each.enabled][number]
            if value == "board":
                tree.links.new(self.board(tree), socket)
            else:
                socket.default_value = value
        return [each for each in node.outputs if each.enabled][out]

    CHAINS = (
        ("ShaderNodeGamma", {}, {0: "board", 1: 2.0}, 0),
        ("ShaderNodeInvert", {}, {0: 0.7, 1: "board"}, 0),
        ("ShaderNodeBrightContrast", {}, {0: "board", 1: 0.1, 2: 0.3}, 0),
        ("ShaderNodeHueSaturation", {}, {0: 0.6, 1: 1.3, 2: 0.8, 3: 0.9, 4: "board"}, 0),
        ("ShaderNodeRGBToBW", {}, {0: "board"}, 0),
        ("ShaderNodeValToRGB", {}, {0: "board"}, 0),
        ("ShaderNodeMath", {"operation": "MULTIPLY_ADD"}, {0: "board", 1: 0.5, 2: 0.2}, 0),
        ("ShaderNodeMath", {"operation": "POWER"}, {0: "board", 1: 1.7}, 0),
        ("ShaderNodeSeparateColor", {}, {0: "board"}, 1),
        ("ShaderNodeSeparateColor", {"mode": "HSV"}, {0: "board"}, 1),
        ("ShaderNodeCombineColor", {}, {0: 0.1, 1: "board", 2: 0.4}, 0),
        ("ShaderNodeMapRange", {}, {0: "board", 1: 0.2, 2: 0.6, 3: 0.1, 4: 0.9}, 0),
        ("ShaderNodeClamp", {}, {0: "board", 1: 0.3, 2: 0.5}, 0),
        ("ShaderNodeRGBCurve", {}, {0: 0.8, 1: "board"}, 0),
        *(
            (
                "ShaderNodeMix",
                {"data_type": "RGBA", "blend_type": mode},
                {0: 0.6, 1: "board", 2: (0.5, 0.3, 0.7, 1)},
                0,
            )
            for mode in (
                "MIX",
                "ADD",
                "MULTIPLY",
                "SUBTRACT",
                "SCREEN",
                "DIFFERENCE",
                "DIVIDE",
                "OVERLAY",
                "DARKEN",
                "LIGHTEN",
            )
        ),
        ("ShaderNodeMix", {"data_type": "FLOAT"}, {0: "board", 1: 0.2, 2: 0.9}, 0),
    )

    def test_chains_have_the_mean_that_cycles_renders(self) -> None:
        values = importlib.import_module(f"{MODULE}.export.values")
        nodes = importlib.import_module(f"{MODULE}.export.nodes")
        for kind, settings, inputs, out in self.CHAINS:
            with self.subTest(kind=kind, **settings):
                scene = scenes.clear()
                made = bpy.data.materials.new("chain")
                scenes.use_nodes(made)
                tree = made.node_tree
                emission = tree.nodes.new("ShaderNodeEmission")
                tree.links.new(self.chain(tree, kind, settings, inputs, out), emission.inputs["Color"])
                tree.links.new(emission.outputs["Emission"], tree.nodes["Material Output"].inputs["Surface"])
                scenes.quad("quad", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], made)
                scenes.camera((0, 0, 2), (0, 0, 0), type="ORTHO", ortho_scale=2)
                rendering.use_cycles(scene, 4)
                scene.cycles.pixel_filter_type = "BOX"
                scene.render.resolution_x = scene.render.resolution_y = 64
                with tempfile.TemporaryDirectory() as folder:
                    seen = rendering.colour(rendering.passes(scene, "CYCLES", Path(folder)))
                value = values.value_of(nodes.Place(emission.inputs["Color"], ()))
                # Blocks of pixels: those at the edges of texels have but four samples of Cycles.
                means = [each.reshape(8, 8, 8, 8, 3).mean(axis=(1, 3)) for each in (seen, self.shown(value))]
                np.testing.assert_allclose(*means, atol=0.04 * max(seen.max(), 1))
                np.testing.assert_allclose(
                    seen.mean(axis=(0, 1)), self.shown(value).mean(axis=(0, 1)), atol=0.006
                )

    def shown(self, value: object) -> np.ndarray:
        """The picture of a value on the quad, by glTF's transform of texture coordinates, the top line first."""
        mapping, side = value.mapping, 256
        v, u = (np.indices((side, side)) + 0.5) / side
        sine, cosine = math.sin(mapping.rotation), math.cos(mapping.rotation)
        width, height = mapping.scale
        across = cosine * width * u + sine * height * v + mapping.offset[0]
        down = -sine * width * u + cosine * height * v + mapping.offset[1]
        texels = value.texels[::-1, :, :3]
        rows, columns = (np.floor(place % 1 * 64).astype(int) for place in (down, across))
        return texels[rows, columns].reshape(64, 4, 64, 4, 3).mean(axis=(1, 3))


class Shaders(unittest.TestCase):
    """Mean radiance of surfaces beside Cycles: a sphere and a floor under a lamp and a sky."""

    def mixed(
        self, tree: bpy.types.NodeTree, kind: str, first: str, second: str, factor: object
    ) -> bpy.types.Node:
        node = tree.nodes.new(kind)
        shaders = [tree.nodes.new(name) for name in (first, second)]
        sockets = [socket for socket in node.inputs if socket.type == "SHADER"]
        for shader, socket in zip(shaders, sockets):
            if "Color" in shader.inputs:
                shader.inputs["Color"].default_value = (0.7, 0.4, 0.2, 1)
            if "Roughness" in shader.inputs and shader.bl_idname != "ShaderNodeBsdfDiffuse":
                shader.inputs["Roughness"].default_value = 0.3
            tree.links.new(shader.outputs[0], socket)
        if isinstance(factor, str):
            tree.links.new(tree.nodes.new(factor).outputs[0], node.inputs[0])
        elif factor is not None:
            node.inputs[0].default_value = factor
        return node

    CASES = (
        ("ShaderNodeMixShader", "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfAnisotropic", 0.4, 0.06),
        (
            "ShaderNodeMixShader",
            "ShaderNodeBsdfDiffuse",
            "ShaderNodeBsdfAnisotropic",
            "ShaderNodeFresnel",
            0.06,
        ),
        ("ShaderNodeMixShader", "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTransparent", 0.5, 0.06),
        ("ShaderNodeMixShader", "ShaderNodeBsdfDiffuse", "ShaderNodeEmission", 0.3, 0.06),
        ("ShaderNodeAddShader", "ShaderNodeBsdfDiffuse", "ShaderNodeEmission", None, 0.06),
        ("ShaderNodeMixShader", "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfDiffuse", 0.5, 0.06),
        (
            "ShaderNodeMixShader",
            "ShaderNodeBsdfGlass",
            "ShaderNodeBsdfTransparent",
            "ShaderNodeLightPath",
            0.1,
        ),
    )

    def test_mixed_shaders_have_the_radiance_of_cycles(self) -> None:
        for kind, first, second, factor, tolerance in self.CASES:
            with self.subTest(kind=kind, first=first, second=second, factor=factor):
                scene = draft(scenes.clear())
                made = bpy.data.materials.new("mixed")
                scenes.use_nodes(made)
                tree = made.node_tree
                node = self.mixed(tree, kind, first, second, factor)
                tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
                scenes.sphere("ball", (0, 0, 0.5), 0.5, made)
                scenes.quad(
                    "floor",
                    [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)],
                    scenes.matte("floor", (0.5, 0.5, 0.5)),
                )
                scenes.lamp("lamp", "AREA", (1, -1, 3), (0.4, 0.3, 0), energy=60, size=1)
                scenes.world_input(scene, "Color").default_value = (0.3, 0.35, 0.4, 1)
                scenes.camera((0, -3, 1.2), (0, 0, 0.4), lens=50)
                with tempfile.TemporaryDirectory() as folder:
                    ours, theirs = (
                        rendering.colour(rendering.passes(scene, engine, Path(folder)))
                        for engine in ("PHOTONCARD", "CYCLES")
                    )
                # The ball fills the middle of the picture.
                ours, theirs = (each[25:75, 55:105].mean(axis=(0, 1)) for each in (ours, theirs))
                np.testing.assert_allclose(ours, theirs, rtol=tolerance)


class Scenes(unittest.TestCase):
    """What is exported, and renders of parts and frames."""

    def exported(self, scene: bpy.types.Scene) -> object:
        """What a render exports: a render's depsgraph is another than that of the viewport."""
        engine = importlib.import_module(f"{MODULE}.engine")
        made, export = [], engine.export
        engine.export = lambda *arguments: made.append(export(*arguments)) or made[-1]
        try:
            draft(scene)
            bpy.ops.render.render()
        finally:
            engine.export = export
        return made[0]

    def test_instances_share_a_mesh_and_keep_their_names(self) -> None:
        scene = scenes.plan()
        group = bpy.data.collections.new("group")
        group.objects.link(bpy.data.objects["house"])
        copy = scenes.placed("copy", None, (0, 2, 0))
        copy.instance_type, copy.instance_collection = "COLLECTION", group
        hidden = scenes.placed("hidden", bpy.data.objects["house"].data)
        hidden.hide_render = True
        root = self.exported(scene).glb.root
        houses = [node for node in root["nodes"] if node["name"] == "house"]
        shared = {node["mesh"] for node in root["nodes"] if node["name"] in {"house", "other"}}
        self.assertEqual((len(houses), len(shared)), (2, 1))
        self.assertNotIn("hidden", [node["name"] for node in root["nodes"]])
        # Blender's (0, 2, 0) is glTF's (0, 0, -2).
        self.assertIn([0, 0, -2], [node["matrix"][12:15] for node in houses])
        bpy.data.collections.remove(group)

    def test_modifiers_slots_and_visibility_are_exported(self) -> None:
        scene = scenes.plan()
        ground = bpy.data.objects["ground"]
        array = ground.modifiers.new("array", "ARRAY")
        array.count = 3
        ground.visible_camera = False
        house = bpy.data.objects["house"].data
        house.materials.append(scenes.matte("roof", (0.2, 0.2, 0.2)))
        house.polygons[5].material_index = 1
        root = self.exported(scene).glb.root
        nodes = {node["name"]: node for node in root["nodes"]}

        def triangles(name: str) -> list[int]:
            primitives = root["meshes"][nodes[name]["mesh"]]["primitives"]
            return [root["accessors"][each["indices"]]["count"] // 3 for each in primitives]

        self.assertEqual(triangles("ground"), [6])
        self.assertEqual(triangles("house"), [10, 2])
        self.assertIs(nodes["ground"]["extras"]["photoncard"]["camera"], False)

    def test_objects_beyond_the_clipping_are_named(self) -> None:
        scene = scenes.plan()
        self.assertNotIn("clipping", " ".join(self.exported(scene).notices.lines()))
        scene.camera.data.clip_start, scene.camera.data.clip_end = 7.5, 100
        lines = [line for line in self.exported(scene).notices.lines() if "clipping" in line]
        self.assertEqual(lines, ["objects are rendered beyond the camera's clipping too: house, other"])

    def test_metalness_and_roughness_are_packed_into_one_image(self) -> None:
        scene = scenes.plan()
        made = scenes.material("packed", (1, 1, 1))
        grey = np.ones((8, 8, 4), np.float32)
        grey[..., :3] = 0.25
        scenes.texture(made, scenes.image("rough", grey, is_data=True), "Roughness")
        grey[..., :3] = 0.75
        scenes.texture(made, scenes.image("metal", grey, is_data=True), "Metallic")
        bpy.data.objects["house"].data.materials[0] = made
        images, store = [], importlib.import_module(f"{MODULE}.export.images").ImageStore
        add = store.add_pixels
        store.add_pixels = lambda self, pixels, *rest: images.append(pixels) or add(self, pixels, *rest)
        try:
            root = self.exported(scene).glb.root
        finally:
            store.add_pixels = add
        pbr = next(each for each in root["materials"] if each["name"] == "packed")["pbrMetallicRoughness"]
        self.assertIn("metallicRoughnessTexture", pbr)
        np.testing.assert_allclose(images[0][0, 0], (1, 0.25, 0.75), atol=0.003)

    def test_a_border_renders_its_part_of_the_picture(self) -> None:
        scene = draft(scenes.plan())
        with tempfile.TemporaryDirectory() as folder:
            whole = rendering.colour(rendering.passes(scene, "PHOTONCARD", Path(folder)))
            render = scene.render
            render.use_border = render.use_crop_to_border = True
            render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = (
                0.25,
                0.75,
                0.5,
                1,
            )
            part = rendering.colour(rendering.passes(scene, "PHOTONCARD", Path(folder)))
        render.use_border = False
        self.assertEqual(part.shape, (45, 80, 3))
        np.testing.assert_allclose(part, whole[:45, 40:120], atol=0.1)

    def test_an_animation_renders_each_frame_as_it_stands(self) -> None:
        scene = draft(scenes.plan())
        house = bpy.data.objects["house"]
        for frame, place in ((1, (0, 0, 0)), (2, (0, -1.2, 0))):
            house.location = place
            house.keyframe_insert("location", frame=frame)
        scene.frame_start, scene.frame_end = 1, 2
        settings = scene.render.image_settings
        if "media_type" in settings.bl_rna.properties:
            settings.media_type = "IMAGE"
        settings.file_format, settings.exr_codec = "OPEN_EXR", "ZIP"
        with tempfile.TemporaryDirectory() as folder:
            scene.render.filepath = f"{folder}/frame"
            bpy.ops.render.render(animation=True)
            frames = [rendering.exr.read(f"{folder}/frame{number:04}.exr").channels["G"] for number in (1, 2)]
        self.assertGreater(np.abs(frames[0] - frames[1]).max(), 0.2)


class Failures(unittest.TestCase):
    def test_a_scene_without_a_camera_says_what_helps(self) -> None:
        scene = draft(scenes.plan())
        scene.camera = None
        engine = importlib.import_module(f"{MODULE}.export.camera")
        graph = bpy.context.evaluated_depsgraph_get()
        objects = importlib.import_module(f"{MODULE}.export.objects")
        with self.assertRaisesRegex(engine.CameraError, "add one"):
            objects.export(graph, None, engine.frame_of(scene.render))

    def test_a_failed_run_shows_the_remedy(self) -> None:
        scene = draft(scenes.plan())
        scene.photoncard.cards.add().address = "tcp:nowhere.invalid:1"
        try:
            with self.assertRaisesRegex(RuntimeError, "nowhere.invalid"):
                bpy.ops.render.render()
        finally:
            scene.photoncard.cards.clear()

    def test_a_cancelled_render_ends_the_program(self) -> None:
        engine = importlib.import_module(f"{MODULE}.engine")
        command = importlib.import_module(f"{MODULE}.command")
        runs, started = [], time.monotonic()

        class Watched(command.Run):
            def __init__(self, *arguments: object) -> None:
                super().__init__(*arguments)
                runs.append(self)

        scene = draft(scenes.room())
        scene.photoncard.quality = "final"
        stop = lambda _: bool(runs) and time.monotonic() - started > 3  # noqa: E731
        whole, engine.command.Run = engine.command.Run, Watched
        whole_check, engine._Picture._is_cancelled = engine._Picture._is_cancelled, stop
        try:
            bpy.ops.render.render()
        finally:
            engine.command.Run = whole
            engine._Picture._is_cancelled = whole_check
        self.assertLess(time.monotonic() - started, 3 + 10)
        self.assertIsNotNone(runs[0]._process.poll())
        self.assertNotEqual(runs[0]._process.returncode, 0)


def tearDownModule() -> None:
    """Leaves nothing behind."""
    import shutil

    shutil.rmtree(os.environ["BLENDER_USER_RESOURCES"], ignore_errors=True)


if __name__ == "__main__":
    # The package bpy may hang when the interpreter ends.
    result = unittest.main(exit=False).result
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0 if result.wasSuccessful() else 1)
