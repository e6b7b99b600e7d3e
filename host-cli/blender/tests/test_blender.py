"""Tests in Blender: `python -m unittest test_blender` with the package bpy, and the zip in PHOTONCARD_ZIP.

The zip is installed as a user installs it. Radiance is compared with that of Cycles. PHOTONCARD_PICTURES
names a folder for pictures of both side by side.
"""

from __future__ import annotations

import importlib
import os
import sys
import tempfile
import time
import unittest
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import installed  # noqa: E402
from installed import MODULE, TOLERANCE, draft, setUpModule, tearDownModule  # noqa: E402, F401

import bpy  # noqa: E402
import numpy as np  # noqa: E402
import rendering  # noqa: E402
import scenes  # noqa: E402


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


class Viewports(unittest.TestCase):
    """Drawing needs a window; the picture that is drawn does not."""

    def settle(self, viewport: Any, is_right: Any = lambda _: True) -> np.ndarray:
        """Follows the scene's camera until the picture is settled and right."""
        module = importlib.import_module(f"{MODULE}.viewport")
        end = time.monotonic() + 120
        while time.monotonic() < end:
            depsgraph = bpy.context.evaluated_depsgraph_get()
            ob = bpy.context.scene.camera.evaluated_get(depsgraph)
            size = (48, 32)
            projection = ob.calc_matrix_camera(depsgraph, x=size[0], y=size[1])
            lens = module.lens_of(ob) if ob.data.type == "PERSP" else None
            camera = module.camera_of(ob.matrix_world.inverted(), projection, size, 0.0, lens)
            viewport.follow(camera, size, depsgraph)
            self.assertEqual(viewport.error, "")
            picture = viewport.picture()
            if picture is not None and viewport.status() == "Done" and is_right(picture):
                return picture
            time.sleep(0.05)
        self.fail("the viewport does not settle")

    def test_the_picture_is_that_of_a_render_and_follows_changes(self) -> None:
        module = importlib.import_module(f"{MODULE}.viewport")
        for make in (scenes.plan, scenes.product):
            scene = draft(make())
            scene.render.film_transparent = False
            scene.render.resolution_x, scene.render.resolution_y = 48, 32
            with tempfile.TemporaryDirectory() as folder:
                rendered = rendering.colour(rendering.passes(scene, "PHOTONCARD", Path(folder)))
            viewport = module.Viewport(lambda: None)
            try:
                shown = self.settle(viewport, lambda picture: picture.shape == (32, 48, 4))
                np.testing.assert_allclose(shown[::-1, :, :3].mean(), rendered.mean(), rtol=TOLERANCE)
                # A shift or a turn of the camera would show elsewhere what is bright.
                profiles = [each.mean(axis=(0, 2)) for each in (shown[::-1, :, :3], rendered)]
                self.assertGreater(np.corrcoef(*profiles)[0, 1], 0.98)
                for light in bpy.data.lights:
                    light.energy = 0
                bpy.context.view_layer.update()
                viewport._changed_at = 0.0
                darker = self.settle(viewport, lambda picture: picture.mean() < 0.9 * shown.mean())
                self.assertLess(darker[..., :3].mean(), 0.9 * shown[..., :3].mean())
            finally:
                viewport.free()


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


if __name__ == "__main__":
    installed.run()
