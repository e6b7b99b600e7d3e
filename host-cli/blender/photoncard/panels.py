"""Panels of the engine, and those of Blender that apply to it."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from .engine import IDENTIFIER

_EXCLUDED = {"DATA_PT_light", "RENDER_PT_simplify_greasepencil", "VIEWLAYER_PT_filter", "WORLD_PT_mist"}
_OF_EEVEE = {
    "DATA_PT_EEVEE_light",
    "DATA_PT_camera_dof",
    "DATA_PT_camera_dof_aperture",
    "DATA_PT_spot",
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_settings",
    "EEVEE_MATERIAL_PT_settings_surface",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
    "MATERIAL_PT_preview",
    "VIEWLAYER_PT_layer_passes",
    "VIEWLAYER_PT_layer_passes_cryptomatte",
    "VIEWLAYER_PT_layer_passes_lightgroups",
    "VIEWLAYER_PT_override",
}


class _Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    COMPAT_ENGINES = {IDENTIFIER}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine in cls.COMPAT_ENGINES

    def _split(self) -> bpy.types.UILayout:
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        return self.layout


class PHOTONCARD_PT_sampling(_Panel, bpy.types.Panel):
    """Quality and limits."""

    bl_label = "Sampling"
    bl_context = "render"

    def draw(self, context: bpy.types.Context) -> None:
        """Shows the settings."""
        layout, settings = self._split(), context.scene.photoncard
        layout.prop(settings, "quality")
        layout.prop(settings, "limit")
        if settings.limit == "TIME":
            layout.prop(settings, "time")
        elif settings.limit == "NOISE":
            layout.prop(settings, "noise")
        layout.prop(settings, "use_denoising")
        layout.prop(settings, "caustics")
        if settings.caustics == "PHOTONS":
            layout.prop(settings, "caustic_photons")


class PHOTONCARD_PT_cards(_Panel, bpy.types.Panel):
    """Cards that render."""

    bl_label = "Cards"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Shows the list of cards."""
        layout, cards = self.layout, context.scene.photoncard.cards
        if not cards:
            layout.label(text="An emulated chip for each processor core")
        for index, card in enumerate(cards):
            row = layout.row(align=True)
            row.prop(card, "address", text="")
            row.operator("photoncard.card_remove", text="", icon="REMOVE").index = index
        layout.operator("photoncard.card_add", icon="ADD")


class PHOTONCARD_OT_card_add(bpy.types.Operator):
    """Add a card that renders"""

    bl_idname = "photoncard.card_add"
    bl_label = "Add Card"
    bl_options = {"UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Adds a card."""
        context.scene.photoncard.cards.add()
        return {"FINISHED"}


class PHOTONCARD_OT_card_remove(bpy.types.Operator):
    """Remove the card"""

    bl_idname = "photoncard.card_remove"
    bl_label = "Remove Card"
    bl_options = {"UNDO"}

    index: bpy.props.IntProperty()

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Removes the card."""
        context.scene.photoncard.cards.remove(self.index)
        return {"FINISHED"}


class PHOTONCARD_PT_film(_Panel, bpy.types.Panel):
    """Background of the picture."""

    bl_label = "Film"
    bl_context = "render"

    def draw(self, context: bpy.types.Context) -> None:
        """Shows the settings."""
        layout = self._split()
        layout.prop(context.scene.render, "film_transparent")
        layout.prop(context.scene.photoncard, "use_bake")


class PHOTONCARD_PT_materials(_Panel, bpy.types.Panel):
    """Bakes of materials."""

    bl_label = "Materials"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Shows the settings."""
        layout, settings = self._split(), context.scene.photoncard
        layout.prop(settings, "use_material_bake")
        column = layout.column()
        column.active = settings.use_material_bake
        column.prop(settings, "bake_size")


class PHOTONCARD_PT_passes(_Panel, bpy.types.Panel):
    """Passes."""

    bl_label = "Data and Light"
    bl_context = "view_layer"
    bl_parent_id = "VIEWLAYER_PT_layer_passes"

    def draw(self, context: bpy.types.Context) -> None:
        """Shows the passes."""
        layout, layer = self._split(), context.view_layer
        column = layout.column(heading="Data")
        for name in ("use_pass_z", "use_pass_position", "use_pass_normal"):
            column.prop(layer, name)
        column.prop(layer.photoncard, "use_pass_albedo")
        column = layout.column(heading="Light")
        for name in ("use_pass_direct", "use_pass_indirect", "use_pass_caustics"):
            column.prop(layer.photoncard, name)


class PHOTONCARD_PT_object(_Panel, bpy.types.Panel):
    """Visibility to the camera, and the light group."""

    bl_label = "photoncard"
    bl_context = "object"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """True for objects with faces or light."""
        kinds = {"MESH", "CURVE", "SURFACE", "FONT", "META", "LIGHT"}
        return super().poll(context) and context.object is not None and context.object.type in kinds

    def draw(self, context: bpy.types.Context) -> None:
        """Shows the settings."""
        layout = self._split()
        layout.prop(context.object, "visible_camera", text="Visible to Camera")
        layout.prop_search(
            context.object, "lightgroup", context.view_layer, "lightgroups", text="Light Group"
        )


class PHOTONCARD_PT_world(_Panel, bpy.types.Panel):
    """Light group of the world."""

    bl_label = "photoncard"
    bl_context = "world"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """True if there is a world."""
        return super().poll(context) and context.world is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Shows the setting."""
        self._split().prop_search(
            context.world, "lightgroup", context.view_layer, "lightgroups", text="Light Group"
        )


CLASSES = (
    PHOTONCARD_OT_card_add,
    PHOTONCARD_OT_card_remove,
    PHOTONCARD_PT_sampling,
    PHOTONCARD_PT_cards,
    PHOTONCARD_PT_film,
    PHOTONCARD_PT_materials,
    PHOTONCARD_PT_passes,
    PHOTONCARD_PT_object,
    PHOTONCARD_PT_world,
)


def _shared_panels() -> Iterator[type]:
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", ())
        if panel.__name__ in _OF_EEVEE or "BLENDER_RENDER" in engines and panel.__name__ not in _EXCLUDED:
            yield panel


def register() -> None:
    """Adds the panels, and the engine to those of Blender."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.add(IDENTIFIER)


def unregister() -> None:
    """Removes them."""
    for panel in _shared_panels():
        panel.COMPAT_ENGINES.discard(IDENTIFIER)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
