"""Settings of a scene, passes of a view layer, and the extension's preferences."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from .command import Settings

_QUALITIES = (
    ("draft", "Draft", "A look at the scene: visible noise"),
    ("good", "Good", "A picture to show: without visible noise in a room"),
    ("final", "Final", "A picture to keep"),
)
_LIMITS = (
    ("NONE", "None", "The quality decides when the picture is done"),
    ("TIME", "Time", "Add samples until the time is over"),
    ("NOISE", "Noise", "Add samples until the noise is below a share of the picture's mean"),
)
_CAUSTICS = (
    ("AUTO", "Automatic", "As many photons as the quality needs, if the scene focuses light"),
    (
        "OFF",
        "Off",
        "No caustic map: focused light is noisy, and that of lamps without size is lost",
    ),
    ("PHOTONS", "Photons", "A stated number of photons"),
)


class Card(bpy.types.PropertyGroup):
    """A card that renders."""

    address: StringProperty(
        name="Address",
        description="Address as of --card: emulated[:CHIPS], tcp:HOST:PORT, unix:PATH or serial:PATH",
        default="emulated",
    )


class SceneSettings(bpy.types.PropertyGroup):
    """Settings of a scene."""

    quality: EnumProperty(name="Quality", items=_QUALITIES, default="good")
    limit: EnumProperty(name="Limit", items=_LIMITS, default="NONE")
    time: FloatProperty(
        name="Time", description="Time of a frame", default=60, min=1, soft_max=3600, subtype="TIME_ABSOLUTE"
    )
    noise: FloatProperty(
        name="Noise",
        description="Standard error of the pixels over the mean of the picture",
        default=0.01,
        min=1e-4,
        max=1,
        precision=4,
    )
    use_denoising: BoolProperty(
        name="Denoise", description="Remove noise by Open Image Denoise, with fewer samples", default=False
    )
    caustics: EnumProperty(name="Caustics", items=_CAUSTICS, default="AUTO")
    caustic_photons: IntProperty(
        name="Photons", description="Photons in the caustic map", default=500_000, min=1, max=100_000_000
    )
    use_bake: BoolProperty(
        name="Bake World Nodes",
        description="Render a Sky Texture and other nodes of the world to a map by Cycles before each frame",
        default=True,
    )
    use_material_bake: BoolProperty(
        name="Bake Procedural Materials",
        description="Bake procedural textures, bumps and other nodes of materials to images by Cycles before "
        "each frame",
        default=False,
    )
    bake_size: IntProperty(
        name="Resolution",
        description="Texels a side of the images of each material on each mesh",
        default=1024,
        min=16,
        max=8192,
        subtype="PIXEL",
    )
    cards: CollectionProperty(type=Card)

    def command_settings(self, size: tuple[int, int]) -> Settings:
        """What the command is told."""
        photons = {"AUTO": None, "OFF": 0, "PHOTONS": self.caustic_photons}
        return Settings(
            size,
            quality=self.quality,
            seconds=self.time if self.limit == "TIME" else None,
            noise=self.noise if self.limit == "NOISE" else None,
            is_denoised=self.use_denoising,
            caustic_photons=photons[self.caustics],
            cards=[card.address for card in self.cards if card.address],
        )


class ViewLayerSettings(bpy.types.PropertyGroup):
    """Passes of a view layer that Blender has no property for."""

    use_pass_direct: BoolProperty(
        name="Direct", description="Emission, and light of lamps and the world that arrives directly"
    )
    use_pass_indirect: BoolProperty(name="Indirect", description="Light that surfaces have reflected before")
    use_pass_caustics: BoolProperty(
        name="Caustics", description="Light that mirrors, glass and glossy surfaces focus"
    )
    use_pass_albedo: BoolProperty(
        name="Denoising Albedo", description="Albedo of the visible surfaces, 0 to 1"
    )


class Preferences(bpy.types.AddonPreferences):
    """Preferences of the extension."""

    bl_idname = __package__

    program: StringProperty(
        name="Program",
        description="Program photoncard to render with. Empty: the extension's own, else the one of PATH",
        subtype="FILE_PATH",
    )

    def draw(self, context: bpy.types.Context) -> None:
        """Shows the preferences."""
        self.layout.prop(self, "program")


def program_stated() -> str:
    """The program of the preferences; empty by default."""
    addon = bpy.context.preferences.addons.get(__package__)
    return bpy.path.abspath(addon.preferences.program) if addon else ""


CLASSES = (Card, SceneSettings, ViewLayerSettings, Preferences)


def register() -> None:
    """Adds the settings to scenes and view layers."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.photoncard = PointerProperty(type=SceneSettings)
    bpy.types.ViewLayer.photoncard = PointerProperty(type=ViewLayerSettings)


def unregister() -> None:
    """Removes the settings."""
    del bpy.types.ViewLayer.photoncard
    del bpy.types.Scene.photoncard
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
