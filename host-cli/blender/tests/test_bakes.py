"""Tests of baked materials and of tiled images beside Cycles: run it as `test_blender.py`."""

from __future__ import annotations

import importlib
import os
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Any
from unittest import mock

sys.path.insert(0, str(Path(__file__).resolve().parent))

import installed  # noqa: E402
from installed import MODULE, TOLERANCE, draft, setUpModule, tearDownModule  # noqa: E402, F401

import bpy  # noqa: E402
import numpy as np  # noqa: E402
import rendering  # noqa: E402
import scenes  # noqa: E402

PICTURES = os.environ.get("PHOTONCARD_PICTURES", "")
BLOCK = 10
FLOOR = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
KINDS = (
    "cameras",
    "images",
    "libraries",
    "materials",
    "meshes",
    "node_groups",
    "objects",
    "scenes",
    "worlds",
)


def stage() -> bpy.types.Scene:
    """A scene with even light and a low lamp, whose materials are baked."""
    scene = draft(scenes.clear())
    scenes.lamp("lamp", "AREA", (-3, -2, 2), (0.9, 0, -0.9), energy=150, size=1)
    scenes.world_input(scene, "Color").default_value = (0.6, 0.6, 0.6, 1)
    scenes.camera((0, -4, 2.5), (0, 0, 0.3), lens=40)
    scene.photoncard.use_material_bake = True
    scene.photoncard.bake_size = 256
    return scene


def feed(
    made: bpy.types.Material, kind: str, coordinates: str, socket: str = "Base Color", **inputs: Any
) -> bpy.types.Node:
    """Feeds an input of a Principled BSDF by a texture node; `Scale=3` sets an input of the node."""
    tree = made.node_tree
    node, place = tree.nodes.new(kind), tree.nodes.new("ShaderNodeTexCoord")
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    tree.links.new(place.outputs[coordinates], node.inputs["Vector"])
    tree.links.new(node.outputs[0], tree.nodes["Principled BSDF"].inputs[socket])
    return node


def blocks(picture: np.ndarray) -> np.ndarray:
    """Mean colours of blocks of pixels."""
    rows, columns = picture.shape[0] // BLOCK, picture.shape[1] // BLOCK
    return picture.reshape(rows, BLOCK, columns, BLOCK, 3).mean(axis=(1, 3))


def export(scene: bpy.types.Scene, bake: Any = None) -> Any:
    """What the extension exports."""
    objects = importlib.import_module(f"{MODULE}.export.objects")
    cameras = importlib.import_module(f"{MODULE}.export.camera")
    graph = bpy.context.evaluated_depsgraph_get()
    return objects.export(graph, scene.camera, cameras.frame_of(scene.render), None, bake)


def stated() -> dict[str, object]:
    """What a user's file has and shows."""
    scene = bpy.context.scene
    described: dict[str, object] = {
        kind: {item.name for item in getattr(bpy.data, kind)} - {"Render Result"} for kind in KINDS
    }
    described["engine"], described["frame"] = scene.render.engine, scene.frame_current
    described["active"] = bpy.context.view_layer.objects.active
    for ob in scene.objects:
        described[ob.name] = (ob.data.name, ob.select_get(), [each.name for each in ob.modifiers], ob.mode)
    for mesh in bpy.data.meshes:
        described[f"mesh {mesh.name}"] = ([layer.name for layer in mesh.uv_layers], list(mesh.materials))
    for material in bpy.data.materials:
        tree = material.node_tree
        described[f"material {material.name}"] = (
            [node.name for node in tree.nodes],
            [(link.from_node.name, link.to_node.name, link.to_socket.identifier) for link in tree.links],
        )
    return described


class Bakes(unittest.TestCase):
    def compare(self, scene: bpy.types.Scene, without: float) -> None:
        """Compares means of blocks of both engines' pictures, which differ by more than `without` unbaked."""
        before = stated()
        with tempfile.TemporaryDirectory() as folder:
            ours, theirs, plain = (
                rendering.colour(self.rendered(scene, engine, is_baked, Path(folder)))
                for engine, is_baked in (("PHOTONCARD", True), ("CYCLES", False), ("PHOTONCARD", False))
            )
        self.assertEqual(stated(), before)
        if PICTURES:
            rendering.save_png(Path(PICTURES) / f"{self._testMethodName}.png", plain, ours, theirs)
        mean, expected = (each.mean(axis=(0, 1)) for each in (ours, theirs))
        error, unbaked = (self.error(each, theirs) for each in (ours, plain))
        print(
            f"{self.id()}: {mean} beside {expected}; blocks {error:.4f}, {unbaked:.4f} unbaked",
            file=sys.stderr,
        )
        np.testing.assert_allclose(mean, expected, rtol=TOLERANCE)
        self.assertLess(error, 0.03)
        # The comparison can see whether materials are baked.
        self.assertGreater(unbaked, without)

    def rendered(
        self, scene: bpy.types.Scene, engine: str, is_baked: bool, folder: Path
    ) -> dict[str, np.ndarray]:
        """Channels of a render; the scene is left as it was."""
        scene.photoncard.use_material_bake = is_baked
        try:
            return rendering.passes(scene, engine, folder)
        finally:
            scene.render.engine, scene.photoncard.use_material_bake = "PHOTONCARD", True

    def error(self, picture: np.ndarray, expected: np.ndarray) -> float:
        """Root of the mean square error of blocks, over the mean."""
        difference = blocks(picture) - blocks(expected)
        return float(np.sqrt(np.mean(difference**2)) / expected.mean())

    def test_noise_checker_and_voronoi_are_as_in_cycles(self) -> None:
        scene = stage()
        checker = scenes.matte("checker", (1, 1, 1))
        feed(checker, "ShaderNodeTexChecker", "Generated", Scale=4.0, Color1=(0.8, 0.3, 0.1, 1))
        voronoi = scenes.matte("voronoi", (1, 1, 1))
        feed(voronoi, "ShaderNodeTexVoronoi", "UV", Scale=5.0)
        tree = voronoi.node_tree
        coloured = tree.nodes["Voronoi Texture"].outputs["Color"]
        tree.links.new(coloured, tree.nodes["Principled BSDF"].inputs["Base Color"])
        noise = scenes.matte("noise", (1, 1, 1))
        ramp = noise.node_tree.nodes.new("ShaderNodeValToRGB")
        ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.45, 0.55
        noise.node_tree.links.new(
            feed(noise, "ShaderNodeTexNoise", "Object", Scale=2.0).outputs[0], ramp.inputs["Fac"]
        )
        noise.node_tree.links.new(
            ramp.outputs["Color"], noise.node_tree.nodes["Principled BSDF"].inputs["Base Color"]
        )
        scenes.quad("floor", FLOOR, voronoi)
        scenes.sphere("ball", (-0.7, 0, 0.5), 0.5, noise)
        box = scenes.box("box", (0.3, -0.3, 0), (1.1, 0.5, 0.8), checker)
        box.select_set(True)
        # Generated coordinates are those of the mesh before modifiers.
        box.modifiers.new("array", "ARRAY").count = 2
        box.modifiers.new("bend", "SIMPLE_DEFORM").angle = 0.5
        self.compare(scene, 0.1)

    def test_roughness_metalness_and_emission_are_baked_together(self) -> None:
        scene = stage()
        made = scenes.material("mixed", (0.8, 0.6, 0.3), Emission_Color=(0.2, 0.5, 1, 1))
        feed(
            made,
            "ShaderNodeTexChecker",
            "Object",
            "Metallic",
            Scale=2.0,
            Color1=(1, 1, 1, 1),
            Color2=(0, 0, 0, 1),
        )
        feed(made, "ShaderNodeTexGradient", "Generated", "Roughness")
        feed(made, "ShaderNodeTexWave", "Object", "Emission Strength", Scale=0.7)
        # An image beside nodes takes the mapping of the bakes.
        scenes.texture(made, scenes.image("board", scenes.checker()), "Base Color")
        scenes.quad("floor", FLOOR, made)
        self.compare(scene, 0.1)

    def test_a_bump_turns_normals_as_in_cycles(self) -> None:
        scene = stage()
        scenes.world_input(scene, "Color").default_value = (0.05, 0.05, 0.05, 1)
        made = scenes.matte("bump", (0.7, 0.7, 0.7))
        tree = made.node_tree
        bump = tree.nodes.new("ShaderNodeBump")
        # Gentle: steep normals turn from lamps behind the plane, which the two renderers treat otherwise.
        bump.inputs["Distance"].default_value = 0.1
        wave = feed(made, "ShaderNodeTexWave", "Object", Scale=0.3)
        tree.links.new(wave.outputs[0], bump.inputs["Height"])
        principled = tree.nodes["Principled BSDF"]
        tree.links.remove(principled.inputs["Base Color"].links[0])
        tree.links.new(bump.outputs["Normal"], principled.inputs["Normal"])
        scenes.quad("floor", FLOOR, made)
        self.compare(scene, 0.1)

    def test_a_shared_material_is_baked_for_each_object(self) -> None:
        scene = stage()
        made = scenes.matte("shared", (1, 1, 1))
        tree = made.node_tree
        # In a group, whose input the bake has to reach.
        group = bpy.data.node_groups.new("group", "ShaderNodeTree")
        group.interface.new_socket("Surface", in_out="OUTPUT", socket_type="NodeSocketShader")
        checker, place = group.nodes.new("ShaderNodeTexChecker"), group.nodes.new("ShaderNodeNewGeometry")
        checker.inputs["Scale"].default_value = 1.5
        checker.inputs["Color1"].default_value = (0.1, 0.7, 0.2, 1)
        inner, output = group.nodes.new("ShaderNodeBsdfDiffuse"), group.nodes.new("NodeGroupOutput")
        group.links.new(place.outputs["Position"], checker.inputs["Vector"])
        group.links.new(checker.outputs["Color"], inner.inputs["Color"])
        group.links.new(inner.outputs[0], output.inputs[0])
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        first = scenes.box("first", (-0.4, -0.4, 0), (0.4, 0.4, 0.8), made)
        first.location = (-0.8, 0, 0)
        other = scenes.placed("other", first.data, (0.75, 0.3, 0), (0, 0, 0.6))
        other.scale = (1, 1, 1.4)
        local = scenes.matte("local", (1, 1, 1))
        feed(local, "ShaderNodeTexChecker", "Object", Scale=1.5, Color1=(0.8, 0.1, 0.2, 1))
        scenes.quad("floor", FLOOR, local)
        scenes.box("low", (-0.3, -1.3, 0), (0.3, -0.9, 0.3), local)
        self.compare(scene, 0.1)
        bpy.data.node_groups.remove(group)

    def test_objects_of_one_mesh_share_a_bake_unless_nodes_ask_where_they_are(self) -> None:
        scene = stage()
        made = scenes.matte("noise", (1, 1, 1))
        node = feed(made, "ShaderNodeTexNoise", "Object")
        first = scenes.quad("first", FLOOR, made)
        scenes.placed("other", first.data, (5, 0, 0))
        root = self.exported(scene, lambda: False).glb.root
        self.assertEqual((len(root["materials"]), len(root["meshes"])), (1, 1))
        place = made.node_tree.nodes.new("ShaderNodeNewGeometry")
        made.node_tree.links.new(place.outputs["Position"], node.inputs["Vector"])
        root = self.exported(scene, lambda: False).glb.root
        self.assertEqual((len(root["materials"]), len(root["meshes"])), (2, 2))

    def test_a_material_of_a_library_is_baked(self) -> None:
        scene = stage()
        made = scenes.matte("linked", (1, 1, 1))
        feed(made, "ShaderNodeTexNoise", "Object")
        with tempfile.TemporaryDirectory() as folder:
            path = f"{folder}/materials.blend"
            bpy.data.libraries.write(path, {made}, fake_user=True)
            bpy.data.materials.remove(made)
            with bpy.data.libraries.load(path, link=True) as (_, wanted):
                wanted.materials = ["linked"]
            scenes.quad("floor", FLOOR, wanted.materials[0])
            exported = self.exported(scene, lambda: False)
            bpy.data.libraries.remove(bpy.data.libraries[0])
        self.assertEqual(exported.notices.lines(), [])
        self.assertIn("baseColorTexture", exported.glb.root["materials"][0]["pbrMetallicRoughness"])

    def test_overlapping_charts_are_not_baked_into_one(self) -> None:
        scene = stage()
        made = scenes.matte("shared", (1, 1, 1))
        feed(made, "ShaderNodeTexChecker", "Object", Scale=1.0, Color1=(0.1, 0.2, 0.8, 1))
        box = scenes.box("box", (-1, -0.5, 0), (0.9, 0.7, 0.9), made)
        layer = box.data.uv_layers.new(name="UVMap")
        for loop, uv in zip(layer.uv, ((0, 0), (1, 0), (1, 1), (0, 1)) * 6):
            loop.vector = uv
        self.compare(scene, 0.1)

    def test_nodes_that_fail_leave_the_file_and_are_named(self) -> None:
        scene = stage()
        made = scenes.matte("noise", (1, 1, 1))
        feed(made, "ShaderNodeTexNoise", "Object")
        scenes.quad("floor", FLOOR, made)
        baking = importlib.import_module(f"{MODULE}.baking")
        before = stated()
        with mock.patch.object(baking, "_FOLDER", "/nowhere"):
            notices = self.exported(scene, lambda: False).notices.lines()
        self.assertEqual(stated(), before)
        self.assertRegex("\n".join(notices), "materials are not baked .*Cycles.*: noise")
        self.assertRegex("\n".join(notices), "Base Color takes its unlinked value .*Noise Texture.*: noise")

    def test_a_cancelled_bake_ends_and_leaves_the_file(self) -> None:
        scene = stage()
        made = scenes.matte("noise", (1, 1, 1))
        feed(made, "ShaderNodeTexNoise", "Object")
        scenes.quad("floor", FLOOR, made)
        baking = importlib.import_module(f"{MODULE}.baking")
        before, started = stated(), []
        popen = baking.subprocess.Popen

        def watched(*arguments: Any, **named: Any) -> Any:
            started.append(popen(*arguments, **named))
            return started[-1]

        with mock.patch.object(baking.subprocess, "Popen", watched):
            with self.assertRaises(baking.BakeCancelledError):
                self.exported(scene, lambda: True)
        self.assertEqual(stated(), before)
        self.assertIsNotNone(started[0].poll())
        self.assertEqual(list(Path(bpy.app.tempdir).glob("photoncard-bake-*")), [])

    def exported(self, scene: bpy.types.Scene, is_cancelled: Any) -> Any:
        """What a render with bakes exports."""
        baking = importlib.import_module(f"{MODULE}.baking")
        run = lambda jobs, folder: baking.bake_materials(jobs, folder, 64, 1, is_cancelled)  # noqa: E731
        return export(scene, run)

    def test_textures_of_two_mappings_are_joined_by_a_bake_alone(self) -> None:
        scene = stage()
        made = scenes.matte("two", (0, 0, 0))
        first = scenes.texture(made, scenes.image("colour", scenes.checker()), "Emission Color")
        scenes.texture(made, scenes.image("strength", scenes.checker()), "Emission Strength")
        tree = made.node_tree
        mapping, place = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
        mapping.inputs["Scale"].default_value = (2, 3, 1)
        tree.links.new(place.outputs["UV"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs["Vector"], first.inputs["Vector"])
        scenes.quad("floor", FLOOR, made)
        self.assertRegex(
            "\n".join(export(scene).notices.lines()), "textures are rendered as their means .*: two"
        )
        baked = self.exported(scene, lambda: False)
        self.assertEqual(baked.notices.lines(), [])
        self.assertIn("emissiveTexture", baked.glb.root["materials"][0])

    def test_nothing_is_baked_that_gltf_says(self) -> None:
        scene = stage()
        made = scenes.matte("board", (1, 1, 1))
        scenes.texture(made, scenes.image("board", scenes.checker()), "Base Color")
        scenes.quad("floor", FLOOR, made)
        # The bake would be cancelled.
        self.assertEqual(self.exported(scene, lambda: True).notices.lines(), [])


class TiledImages(unittest.TestCase):
    COLOURS = {1001: (0.8, 0.2, 0.1), 1002: (0.1, 0.6, 0.2), 1011: (0.15, 0.2, 0.7)}

    def tiled(self, folder: str) -> bpy.types.Image:
        """An image of three tiles, each with a darker lower half."""
        for number, colour in self.COLOURS.items():
            pixels = np.ones((16, 16, 4), np.float32)
            pixels[..., :3] = colour
            pixels[:8, :, :3] *= 0.5
            tile = scenes.image("tile", pixels)
            tile.filepath_raw, tile.file_format = f"{folder}/board.{number}.png", "PNG"
            tile.save()
            bpy.data.images.remove(tile)
        made = bpy.data.images.load(f"{folder}/board.1001.png")
        made.source = "TILED"
        made.filepath = f"{folder}/board.<UDIM>.png"
        return made

    def board(self, folder: str) -> bpy.types.Scene:
        """A floor whose UV map covers the tiles."""
        scene = stage()
        picture = self.tiled(folder)
        scene.photoncard.use_material_bake = False
        made = scenes.matte("tiled", (1, 1, 1))
        scenes.texture(made, picture, "Base Color")
        corners = [(x, y, 0) for y in (-2, 0, 2) for x in (-2, 0, 2)]
        # The upper right tile is not there, and no face is.
        floor = scenes.mesh("floor", corners, [(0, 1, 4, 3), (1, 2, 5, 4), (3, 4, 7, 6)], made)
        layer = floor.data.uv_layers.new(name="UVMap")
        for loop, item in zip(floor.data.loops, layer.uv):
            x, y, _ = corners[loop.vertex_index]
            item.vector = ((x + 2) / 2, (y + 2) / 2)
        return scene

    def test_tiles_are_where_cycles_has_them(self) -> None:
        for is_packed in (False, True):
            with self.subTest(is_packed=is_packed), tempfile.TemporaryDirectory() as folder:
                scene = self.board(folder)
                if is_packed:
                    bpy.data.images["board.1001.png"].pack()
                before = stated()
                theirs = rendering.colour(rendering.passes(scene, "CYCLES", Path(folder)))
                if is_packed:
                    for file in Path(folder).glob("board*"):
                        file.unlink()
                ours = rendering.colour(rendering.passes(scene, "PHOTONCARD", Path(folder)))
                self.assertEqual(stated(), before)
                np.testing.assert_allclose(ours.mean(axis=(0, 1)), theirs.mean(axis=(0, 1)), rtol=TOLERANCE)
                difference = blocks(ours) - blocks(theirs)
                self.assertLess(float(np.sqrt(np.mean(difference**2)) / theirs.mean()), 0.03)

    def test_a_tile_without_a_file_is_named(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            scene = self.board(folder)
            Path(folder, "board.1002.png").unlink()
            lines = export(scene).notices.lines()
        self.assertRegex("\n".join(lines), r"Base Color takes its unlinked value .*board\.1002\.png.*: tiled")


if __name__ == "__main__":
    installed.run()
