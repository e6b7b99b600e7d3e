"""Compares `photoncard bake` with Cycles' bake: errors of the same texels over CPU seconds.

    python bake_cycles.py PHOTONCARD SCENE FOLDER [--texels-per-metre N] [--samples N,N] [-- OPTION ..]

photoncard writes the scene with kept materials and its second set of coordinates. Blender imports that file,
and Cycles bakes DIFFUSE, direct and indirect without colour, into images of the same sizes with a margin of
0. Times pi, the result is the irradiance in W/m^2 that photoncard writes. All objects with a lightmap are
joined before, so that one call bakes them all. Lights are imported from the scene: the baked file has none.

Prints the CPU seconds (user and system, all threads) and errors beside a bake by Cycles of as many samples as
fit into --minutes of CPU time. Those of photoncard are of the whole command, those of Cycles of the call
that bakes, with its tree of triangles, without the import. An error is the root mean square difference of
texels and channels over the mean of the reference; that of photoncard includes its bias. Texels count if they
and their eight neighbours are in a chart and lit. Texels that have less than a twentieth of the mean light by
Cycles are inside solids or behind sheets, where photoncard continues the light around them: they are printed
apart. All bakes by Cycles have different seeds.

The Python has bpy 4.5 or later. Options after -- go to both bakes by photoncard.
"""

import argparse
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent / "cycles"))

import gltf  # noqa: E402: of the folder `cycles`
import materials  # noqa: E402
import pictures  # noqa: E402
import quality  # noqa: E402
import render  # noqa: E402

# Bakes by photoncard: the default and a finer one.
SETTINGS = {"default": "", "finer": "--spp 16 --gather-rays 64"}
# How Blender's importer reads lights by photoncard's units.
LIGHTING = {"radiometric": "COMPAT", "photometric": "SPEC", "watts": "RAW"}
UNITS_OF_DIFFUSE = np.pi
# Texels with less than this share of the mean light are inside solids or behind sheets.
DARK = 0.05
# A reference has no more samples than this.
MOST_SAMPLES = 1 << 16


@dataclass
class Bake:
    """CPU seconds and pages of irradiance, W/m^2: rows from the top."""

    cpu_s: float
    pages: list[np.ndarray]


def main() -> None:
    """See the module."""
    arguments = parse()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    table = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    # Blender reports on the standard output, where the results alone belong.
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def say(text: str) -> None:
        print(text, file=table, flush=True)

    own = {name: photoncard(arguments, name, words) for name, words in SETTINGS.items()}
    prepare(arguments, arguments.folder / "default.glb")
    pages = own["default"].pages
    seeds = enumerate(arguments.samples, start=1)
    cycles = {samples: bake(pages, samples, seed)[0] for seed, samples in seeds}
    many = arguments.samples[-1]
    most = max(many, min(int(60.0 * arguments.minutes / cycles[many].cpu_s * many), MOST_SAMPLES))
    reference, covered = bake(pages, most, 0)
    light = lit(reference, covered)
    mask = [eroded(texels) for texels in light]
    if not any(texels.any() for texels in mask):
        sys.exit("no texel has eight neighbours in its chart; state more --texels-per-metre")
    report(say, own, cycles, (most, reference), mask)
    dark = [eroded(texels) & ~lit_texels for texels, lit_texels in zip(covered, light, strict=True)]
    report_dark(say, own, reference, dark)
    show(arguments.folder, own["default"], reference, mask)
    # Blender's module may hang at the end of the process.
    os._exit(0)


def parse() -> argparse.Namespace:
    """The command's arguments; what follows -- goes to photoncard."""
    words, options = sys.argv[1:], []
    if "--" in words:
        place = words.index("--")
        words, options = words[:place], words[place + 1 :]
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("photoncard", type=Path, help="the command")
    parser.add_argument("scene", type=Path, help="a glTF file")
    parser.add_argument("folder", type=Path, help="where files go")
    parser.add_argument("--texels-per-metre", type=float, default=16.0)
    parser.add_argument("--samples", type=counts, default=[16, 64, 256], help="of Cycles, two or more")
    parser.add_argument("--minutes", type=float, default=10.0, help="CPU time of the reference")
    parser.add_argument("--light-units", choices=LIGHTING, default="radiometric", help="of its lights")
    parser.add_argument("--environment", help="a map with -z in its middle, or a radiance: R,G,B")
    arguments = parser.parse_args(words)
    arguments.options = options
    for path in (arguments.photoncard, arguments.scene):
        if not path.is_file():
            parser.error(f"{path}: there is no such file")
    return arguments


def counts(text: str) -> list[int]:
    """Rising numbers of samples."""
    numbers = [int(word) for word in text.split(",")]
    if len(numbers) < 2 or numbers != sorted(set(numbers)) or numbers[0] < 1:
        raise argparse.ArgumentTypeError("state two or more rising numbers, such as 16,64")
    return numbers


def photoncard(arguments: argparse.Namespace, name: str, words: str) -> Bake:
    """A bake by photoncard, FOLDER/NAME.glb and a page FOLDER/NAME.N.exr for each of its lightmaps."""
    output = arguments.folder / f"{name}.glb"
    for old in arguments.folder.glob(f"{name}.*.exr"):
        old.unlink()
    command = [arguments.photoncard, "bake", arguments.scene, "-o", output, "--materials", "kept", "--exr"]
    command += ["--quiet", "--texels-per-metre", arguments.texels_per_metre]
    command += ["--light-units", arguments.light_units]
    command += ["--environment", arguments.environment] if arguments.environment else []
    before = cpu(resource.RUSAGE_CHILDREN)
    command += [*words.split(), *arguments.options]
    done = subprocess.run([str(word) for word in command], check=False)
    if done.returncode != 0:
        sys.exit(f"{arguments.scene}: photoncard bake ended with {done.returncode}")
    seconds = cpu(resource.RUSAGE_CHILDREN) - before
    pages = len(list(arguments.folder.glob(f"{name}.*.exr")))
    return Bake(seconds, [pictures.read(output.with_suffix(f".{page}.exr")) for page in range(pages)])


def cpu(who: int) -> float:
    """CPU seconds of this process or of those that it started."""
    used = resource.getrusage(who)
    return used.ru_utime + used.ru_stime


def prepare(arguments: argparse.Namespace, baked: Path) -> None:
    """The baked file in Blender as one object with a lightmap, others without, and the scene's lights."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mode = LIGHTING[arguments.light_units]
    bpy.ops.import_scene.gltf(filepath=str(arguments.scene), export_import_convert_lighting_mode=mode)
    for thing in list(bpy.data.objects):
        if thing.type != "LIGHT":
            bpy.data.objects.remove(thing)
    for material in list(bpy.data.materials):
        bpy.data.materials.remove(material)
    bpy.ops.import_scene.gltf(filepath=str(baked))
    scene = bpy.context.scene
    render.settle(scene, 64, 1)
    scene.render.threads_mode = "AUTO"
    if arguments.environment:
        quality.environment(scene, arguments.environment)
    state_pages(gltf.Document(baked).json)
    render.linear_textures()
    render.scaled_normals()
    materials.make_native(scene)
    render.shade(scene, "gltf")
    join([thing for thing in scene.objects if thing.type == "MESH" and has_pages(thing)])


def state_pages(document: dict) -> None:
    """Gives each material with a lightmap the number of its page."""
    for material in bpy.data.materials:
        lightmap = material.get("photoncard", {}).get("lightmap")
        if lightmap is not None:
            image = document["images"][document["textures"][lightmap["texture"]]["source"]]
            material["page"] = int(image["name"].removeprefix("lightmap "))


def has_pages(thing: bpy.types.Object) -> bool:
    """If all materials of an object have a lightmap."""
    return all(slot.material and "page" in slot.material for slot in thing.material_slots)


def join(things: list[bpy.types.Object]) -> None:
    """Makes one object of several, selected and active."""
    if not things:
        sys.exit("the baked file has no object with a lightmap")
    bpy.ops.object.select_all(action="DESELECT")
    for thing in things:
        if "UVMap.001" not in thing.data.uv_layers:
            sys.exit(f"{thing.name}: Blender has no second UV map of it")
        thing.select_set(True)
    bpy.context.view_layer.objects.active = things[0]
    if len(things) > 1:
        bpy.ops.object.join()


def bake(pages: list[np.ndarray], samples: int, seed: int) -> tuple[Bake, list[np.ndarray]]:
    """A bake by Cycles to pages of these sizes, and the texels that it wrote."""
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.seed = samples, seed
    images = [
        bpy.data.images.new(f"page {page}", *values.shape[1::-1], alpha=True, float_buffer=True, is_data=True)
        for page, values in enumerate(pages)
    ]
    for slot in bpy.context.object.material_slots:
        aim(slot.material, images)
    before = cpu(resource.RUSAGE_SELF)
    bpy.ops.object.bake(
        type="DIFFUSE",
        pass_filter={"DIRECT", "INDIRECT"},
        target="IMAGE_TEXTURES",
        uv_layer="UVMap.001",
        margin=0,
        use_clear=True,
    )
    seconds = cpu(resource.RUSAGE_SELF) - before
    texels = [read(image) for image in images]
    for image in images:
        bpy.data.images.remove(image)
    light = Bake(seconds, [UNITS_OF_DIFFUSE * values[:, :, :3] for values in texels])
    return light, [values[:, :, 3] > 0.5 for values in texels]


def aim(material: bpy.types.Material, images: list[bpy.types.Image]) -> None:
    """Makes the image of a material's page the one that is baked to."""
    nodes = material.node_tree.nodes
    target = nodes.get("Bake") or nodes.new("ShaderNodeTexImage")
    target.name, target.image = "Bake", images[material["page"]]
    target.select, nodes.active = True, target


def read(image: bpy.types.Image) -> np.ndarray:
    """The texels of an image, rows from the top, which is the first row of glTF's coordinates."""
    width, height = image.size
    values = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(height, width, 4)[::-1].astype(float)


def lit(reference: Bake, covered: list[np.ndarray]) -> list[np.ndarray]:
    """Texels in charts that are not dark."""
    dark = DARK * values(reference, covered).sum(axis=1).mean()
    return [texels & (page.sum(axis=2) > dark) for texels, page in zip(covered, reference.pages, strict=True)]


def eroded(mask: np.ndarray) -> np.ndarray:
    """Texels whose eight neighbours are in the mask."""
    padded = np.pad(mask, 1)
    rows, columns = mask.shape
    shifts = [padded[y : y + rows, x : x + columns] for y in range(3) for x in range(3)]
    return np.logical_and.reduce(shifts)


def values(found: Bake, mask: list[np.ndarray]) -> np.ndarray:
    """The irradiance of the texels that count, a row for each."""
    return np.concatenate([page[texels] for page, texels in zip(found.pages, mask, strict=True)])


def report(
    say: Callable[[str], None],
    own: dict[str, Bake],
    cycles: dict[int, Bake],
    reference: tuple[int, Bake],
    mask: list[np.ndarray],
) -> None:
    """Prints errors and ratios of CPU seconds."""
    most, truth = reference[0], values(reference[1], mask)
    noise = Noise(cycles, most, truth, mask)
    say(
        f"reference: Cycles, {most} samples, {reference[1].cpu_s:.1f} CPU s, "
        f"noise {100.0 * noise.of(most):.2f} %; {len(truth)} texels count, mean {truth.mean():.4f} W/m^2"
    )
    for samples, found in cycles.items():
        say(f"Cycles, {samples} samples: {line(found, truth, mask)}")
    for name, found in own.items():
        say(f"photoncard, {name}: {line(found, truth, mask)}")
        error = max(rms(values(found, mask), truth) ** 2 - noise.of(most) ** 2, 0.0) ** 0.5
        if error == 0.0:
            say(f"photoncard, {name}: the noise of the reference hides its error; state more --minutes")
            continue
        samples = noise.samples(error)
        say(
            f"photoncard, {name}: error {100.0 * error:.2f} % with its bias, without the reference's noise; "
            f"Cycles takes {samples:.0f} samples and {noise.cpu(samples):.1f} CPU s for it, "
            f"{noise.cpu(samples) / found.cpu_s:.2f} times those of photoncard"
        )


def report_dark(
    say: Callable[[str], None], own: dict[str, Bake], reference: Bake, dark: list[np.ndarray]
) -> None:
    """Prints the light of dark texels."""
    count = sum(int(texels.sum()) for texels in dark)
    if count > 0:
        light = ", ".join(f"{name} {values(found, dark).mean():.4f}" for name, found in own.items())
        theirs = values(reference, dark).mean()
        say(f"dark texels: {count}, by Cycles {theirs:.4f} W/m^2, by photoncard {light}")


def line(found: Bake, truth: np.ndarray, mask: list[np.ndarray]) -> str:
    """CPU seconds, error and bias of a bake."""
    light = values(found, mask)
    off = 100.0 * np.abs(light.sum(axis=1) / truth.sum(axis=1) - 1.0)
    return (
        f"{found.cpu_s:.1f} CPU s, error {100.0 * rms(light, truth):.2f} %, "
        f"mean {100.0 * (light.mean() / truth.mean() - 1.0):+.2f} %, "
        f"texels off by {np.median(off):.2f} % in the median, 95 % within {np.percentile(off, 95):.2f} %"
    )


def rms(light: np.ndarray, truth: np.ndarray) -> float:
    """The root mean square difference over the mean of the reference."""
    return float(np.sqrt(np.mean((light - truth) ** 2)) / truth.mean())


class Noise:
    """Noise of Cycles, `1 / sqrt(samples)`, and its CPU seconds, a line through two numbers of samples."""

    def __init__(
        self, cycles: dict[int, Bake], reference: int, truth: np.ndarray, mask: list[np.ndarray]
    ) -> None:
        few, many = min(cycles), max(cycles)
        error = rms(values(cycles[many], mask), truth)
        # The reference's own noise is in what the two differ by.
        self.of_one = error / (1.0 / many + 1.0 / reference) ** 0.5
        self.a_sample = max(cycles[many].cpu_s - cycles[few].cpu_s, 0.0) / (many - few)
        self.before = max(cycles[many].cpu_s - self.a_sample * many, 0.0)

    def of(self, samples: float) -> float:
        """The noise of a number of samples."""
        return self.of_one / samples**0.5

    def samples(self, error: float) -> float:
        """The number of samples whose noise is an error, one at least."""
        return max((self.of_one / error) ** 2, 1.0)

    def cpu(self, samples: float) -> float:
        """CPU seconds of a bake."""
        return self.before + self.a_sample * samples


def show(folder: Path, own: Bake, reference: Bake, mask: list[np.ndarray]) -> None:
    """Writes PNGs of each page: photoncard, the reference, and both of the texels that count."""
    for page, (mine, theirs, texels) in enumerate(zip(own.pages, reference.pages, mask, strict=True)):
        shown = [mine, theirs, mine * texels[:, :, None], theirs * texels[:, :, None]]
        pictures.show(shown, folder / f"page-{page}.png", 0.4 / max(float(np.median(theirs[texels])), 1e-9))


if __name__ == "__main__":
    main()
