"""photoncard as a render engine of Blender."""


def register() -> None:
    """Registers the engine, its settings and its panels."""
    from . import engine, panels, properties

    import bpy

    properties.register()
    bpy.utils.register_class(engine.PhotoncardEngine)
    panels.register()


def unregister() -> None:
    """Unregisters them."""
    from . import engine, panels, properties

    import bpy

    panels.unregister()
    bpy.utils.unregister_class(engine.PhotoncardEngine)
    properties.unregister()
