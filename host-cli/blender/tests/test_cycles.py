"""Compares lights, nodes and shaders with Cycles: run it as `test_blender.py`."""

from __future__ import annotations

import importlib
import math
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import installed  # noqa: E402
from installed import MODULE, draft, setUpModule, tearDownModule  # noqa: E402, F401

import bpy  # noqa: E402
import numpy as np  # noqa: E402
import rendering  # noqa: E402
import scenes  # noqa: E402


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
        """The picture of a value on the quad, by glTF's texture coordinates, the top line first."""
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


if __name__ == "__main__":
    installed.run()
