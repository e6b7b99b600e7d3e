"""photoncard as a render engine of Blender."""


def register() -> None:
    """Registers the engine, its settings and its panels."""
    import bpy

    from . import engine, panels, properties

    properties.register()
    bpy.utils.register_class(engine.PhotoncardEngine)
    panels.register()


def unregister() -> None:
    """Unregisters them."""
    import bpy

    from . import engine, panels, properties

    panels.unregister()
    bpy.utils.unregister_class(engine.PhotoncardEngine)
    properties.unregister()
