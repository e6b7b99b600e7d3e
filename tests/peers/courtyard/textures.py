"""Images and materials of the courtyard: base colour, metallic-roughness and normals, all from seeded noise."""

import bpy
import numpy as np

SIDE = 512
ROWS, COLUMNS = np.mgrid[:SIDE, :SIDE] / SIDE


def noise(seed, falloff=1.2, finest=SIDE):
    """Noise that repeats at the image's sides, with zero mean and unit deviation; `falloff` is that of its spectrum."""
    frequencies = np.fft.fftfreq(SIDE, 1.0 / SIDE)
    length = np.hypot(frequencies[:, None], frequencies[None, :])
    length[0, 0] = np.inf
    length[length > finest] = np.inf
    spectrum = np.fft.fft2(np.random.default_rng(seed).standard_normal((SIDE, SIDE)))
    result = np.fft.ifft2(spectrum / length**falloff).real
    return result / result.std()


def masonry(across, up, joint):
    """Blocks in courses shifted by half a block: 1 on a block and 0 in a joint, and a number of each block."""
    course = np.floor(ROWS * up)
    along = COLUMNS * across + 0.5 * (course % 2)
    block = (np.floor(along) % across) + across * course
    distance = np.minimum(edge(along) / across, edge(ROWS * up) / up)
    return np.clip(distance / joint, 0.0, 1.0), block.astype(int)


def edge(values):
    """The distance to the nearest integer."""
    return np.abs(values - np.round(values))


def shades(block, seed, deviation):
    """A brightness for each block."""
    return 1.0 + deviation * np.random.default_rng(seed).standard_normal(block.max() + 1)[block]


def tinted(colour, brightness):
    """A colour times a brightness for each texel."""
    return np.clip(np.asarray(colour) * brightness[..., None], 0.0, 1.0)


def image(name, channels, is_data):
    """A packed image of 8 bits a channel, rows from the bottom."""
    alpha = channels if channels.shape[2] == 4 else np.dstack([channels, np.ones(channels.shape[:2])])
    result = bpy.data.images.new(name, alpha.shape[1], alpha.shape[0], alpha=channels.shape[2] == 4)
    result.colorspace_settings.name = "Non-Color" if is_data else "sRGB"
    result.pixels.foreach_set(alpha.astype(np.float32).ravel())
    result.pack()
    return result


def normals(height, relief):
    """The normal texture of a height field whose repeat is as wide as `1 / relief` of its unit."""
    slopes = [(np.roll(height, -1, axis) - np.roll(height, 1, axis)) * 0.5 * SIDE * relief for axis in (1, 0)]
    vectors = np.dstack([-slopes[0], -slopes[1], np.ones_like(height)])
    return 0.5 + 0.5 * vectors / np.linalg.norm(vectors, axis=2, keepdims=True)


def gloss(roughness, metallic):
    """The metallic-roughness texture: roughness in green, metalness in blue."""
    green = np.clip(roughness, 0.05, 1.0) * np.ones((SIDE, SIDE))
    return np.dstack([np.ones_like(green), green, metallic * np.ones_like(green)])


def material(name, colours, height=None, relief=0.0, roughness=None, metallic=0.0, is_double_sided=False):
    """A Principled BSDF of image textures; a fourth channel of the colours is a mask."""
    result = bpy.data.materials.new(name)
    if result.node_tree is None:
        result.use_nodes = True
    tree = result.node_tree
    shader = tree.nodes["Principled BSDF"]
    colour = texture(tree, image(f"{name}-colour", colours, False))
    tree.links.new(colour.outputs["Color"], shader.inputs["Base Color"])
    shader.inputs["Roughness"].default_value = 0.9
    if colours.shape[2] == 4:
        cut = tree.nodes.new("ShaderNodeMath")
        cut.operation = "ROUND"
        tree.links.new(colour.outputs["Alpha"], cut.inputs[0])
        tree.links.new(cut.outputs[0], shader.inputs["Alpha"])
    if roughness is not None:
        parts = tree.nodes.new("ShaderNodeSeparateColor")
        tree.links.new(texture(tree, image(f"{name}-gloss", gloss(roughness, metallic), True)).outputs["Color"], parts.inputs[0])
        tree.links.new(parts.outputs["Green"], shader.inputs["Roughness"])
        tree.links.new(parts.outputs["Blue"], shader.inputs["Metallic"])
    if height is not None:
        bump = tree.nodes.new("ShaderNodeNormalMap")
        tree.links.new(texture(tree, image(f"{name}-normals", normals(height, relief), True)).outputs["Color"], bump.inputs["Color"])
        tree.links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    result.use_backface_culling = not is_double_sided
    return result


def texture(tree, source):
    """A node that samples an image."""
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = source
    return node


def lamp(name, colour, strength):
    """A surface that emits, in W/(sr m^2)."""
    result = bpy.data.materials.new(name)
    if result.node_tree is None:
        result.use_nodes = True
    shader = result.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    shader.inputs["Emission Color"].default_value = (*colour, 1.0)
    shader.inputs["Emission Strength"].default_value = strength
    result.use_backface_culling = True
    return result


def stone(name, colour, seed, across, up):
    """Walls of blocks."""
    flat, block = masonry(across, up, 0.012)
    grain = noise(seed, 0.9)
    colours = tinted(colour, shades(block, seed + 1, 0.07) * (0.72 + 0.28 * flat) * (1.0 + 0.06 * grain))
    return material(name, colours, flat + 0.06 * grain, 0.008, 0.85 - 0.1 * flat + 0.04 * grain)


def plain(name, colour, seed, roughness, relief=0.004, metallic=0.0, falloff=1.4):
    """A surface without joints: plaster, terracotta, bronze."""
    grain = noise(seed, falloff)
    return material(name, tinted(colour, 1.0 + 0.07 * grain), 0.2 * grain, relief, roughness + 0.06 * grain, metallic)


def paving(name, seed):
    """Slabs of two colours in a pattern of squares."""
    flat, block = masonry(4, 4, 0.008)
    square = (np.floor(ROWS * 4) + np.floor(COLUMNS * 4 + 0.5 * (np.floor(ROWS * 4) % 2))) % 2
    grain = noise(seed, 1.0)
    brightness = shades(block, seed + 1, 0.05) * (0.6 + 0.4 * flat) * (1.0 + 0.05 * grain)
    colours = np.where(square[..., None] > 0.5, tinted((0.78, 0.73, 0.64), brightness), tinted((0.60, 0.50, 0.42), brightness))
    return material(name, colours, flat + 0.04 * grain, 0.006, 0.45 + 0.1 * (1.0 - flat) + 0.05 * grain)


def fabric(name, colour, trim, seed):
    """Woven cloth with stripes and a border."""
    weave = 0.5 * np.sin(2 * np.pi * 64 * ROWS) + 0.5 * np.sin(2 * np.pi * 64 * COLUMNS)
    stripe = (edge(COLUMNS * 6) < 0.09) | (edge(ROWS) < 0.05)
    brightness = 1.0 + 0.05 * weave + 0.08 * noise(seed, 1.6)
    colours = np.where(stripe[..., None], tinted(trim, brightness), tinted(colour, brightness))
    return material(name, colours, weave, 0.001, 0.85 + 0.0 * weave, is_double_sided=True)


def wood(name, seed):
    """Planks along v."""
    plank = np.floor(COLUMNS * 6).astype(int)
    fibres = np.sin(2 * np.pi * (COLUMNS * 60 + 0.35 * noise(seed, 1.8, 24) + plank))
    flat = np.clip(edge(COLUMNS * 6) / 6 / 0.008, 0.0, 1.0)
    colours = tinted((0.46, 0.31, 0.20), shades(plank, seed + 1, 0.12) * (0.5 + 0.5 * flat) * (1.0 + 0.1 * fibres))
    return material(name, colours, flat + 0.1 * fibres, 0.004, 0.6 - 0.05 * fibres)


def leaves(name, seed):
    """A spray of leaves on a card, cut out by its alpha."""
    rng = np.random.default_rng(seed)
    alpha, shade = np.abs(COLUMNS - 0.5) < 0.012 * (1.2 - ROWS), np.full((SIDE, SIDE), 0.6)
    for index in range(15):
        angle = (0.75 - 0.02 * index) * (-1 if index % 2 else 1) + 0.15 * rng.standard_normal()
        x, y = COLUMNS - 0.5, ROWS - 0.05 - 0.055 * index
        along, across = x * np.sin(angle) + y * np.cos(angle), x * np.cos(angle) - y * np.sin(angle)
        length = 0.30 - 0.010 * index
        share = np.clip(along / length, 0.0, 1.0)
        leaf = (along > 0.0) & (along < length) & (np.abs(across) < 0.075 * np.sqrt(share) * (1.0 - share) * 2.0)
        shade = np.where(leaf, 0.8 + 0.3 * rng.random() - 0.25 * (np.abs(across) < 0.004), shade)
        alpha = alpha | leaf
    colours = np.dstack([tinted((0.36, 0.54, 0.20), shade), alpha.astype(float)])
    return material(name, colours, roughness=0.6 + 0.0 * shade, is_double_sided=True)


def all_materials():
    """The materials by their names."""
    cloths = {"red": (0.72, 0.13, 0.11), "green": (0.16, 0.46, 0.22), "blue": (0.15, 0.24, 0.60)}
    result = [
        stone("masonry", (0.80, 0.73, 0.62), 11, 4, 8),
        stone("ashlar", (0.84, 0.79, 0.70), 21, 2, 4),
        plain("marble", (0.86, 0.82, 0.75), 31, 0.40),
        plain("plaster", (0.86, 0.78, 0.66), 41, 0.90),
        plain("terracotta", (0.74, 0.44, 0.30), 51, 0.75),
        plain("bronze", (0.70, 0.55, 0.38), 61, 0.45, metallic=1.0),
        plain("roof", (0.66, 0.38, 0.26), 71, 0.85),
        plain("soil", (0.36, 0.28, 0.22), 81, 0.95, 0.02, falloff=0.8),
        paving("paving", 91),
        wood("wood", 101),
        leaves("leaves", 111),
        *(fabric(f"cloth-{name}", colour, (0.85, 0.70, 0.35), 121 + index) for index, (name, colour) in enumerate(cloths.items())),
        lamp("flame", (1.0, 0.62, 0.28), 60.0),
    ]
    return {surface.name: surface for surface in result}


def without_images(surfaces):
    """Takes the images from all materials but the leaves', which keep the means of what their images stated."""
    for surface in surfaces.values():
        tree = surface.node_tree
        if surface.name == "leaves" or not any(node.type == "TEX_IMAGE" for node in tree.nodes):
            continue
        inputs = tree.nodes["Principled BSDF"].inputs
        for node in [node for node in tree.nodes if node.type == "TEX_IMAGE"]:
            if node.image.name.endswith("-colour"):
                colours = mean(node.image)
                inputs["Base Color"].default_value = (*np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4), 1.0)
            elif node.image.name.endswith("-gloss"):
                _, inputs["Roughness"].default_value, inputs["Metallic"].default_value = map(float, mean(node.image))
            tree.nodes.remove(node)
        for node in [node for node in tree.nodes if node.type in ("NORMAL_MAP", "SEPARATE_COLOR")]:
            tree.nodes.remove(node)


def mean(source):
    """The mean of an image's texels as they are stored."""
    texels = np.empty(len(source.pixels), dtype=np.float32)
    source.pixels.foreach_get(texels)
    return texels.reshape(-1, source.channels)[:, :3].mean(axis=0)
