// The path tracer of the package for WebGPU that does all of a path in one kernel. The kernels of the other one (wavefront), its default, are refused as of
// three 0.187: "an array element type cannot contain a runtime-sized array".

import { RenderTarget, WebGPURenderer } from "three/webgpu";
import { WebGPUPathTracer } from "three-gpu-pathtracer/webgpu";

const BOUNCES = 32;

// Asks for surfaces without gloss. The picture is a fifth too dark all the same; the package's material takes the energy of a gloss off without regard
// to the factor of KHR_materials_specular. The light has the lamp's emission, which the eye does not see then.
function match(scene, lamps) {
    scene.traverse(({ material }) => {
        if (material) material.ior = 1;
    });
    for (const { material } of lamps) material.emissiveIntensity = 0;
}

async function deviceOf() {
    const adapter = await navigator.gpu?.requestAdapter();
    if (!adapter) throw new Error("there is no adapter for WebGPU");
    const { vendor, architecture, device, description } = adapter.info;
    return [vendor, architecture, device, description].filter(Boolean).join(" ");
}

// Rows from the bottom, of rows from the top.
function turned(pixels, size) {
    const found = new Float32Array(pixels.length), row = 4 * size;
    for (let y = 0; y < size; y++) found.set(pixels.subarray(row * y, row * (y + 1)), row * (size - 1 - y));
    return found;
}

export async function open(canvas, size, _, { scene, camera, lamps }) {
    const device = await deviceOf();
    const renderer = new WebGPURenderer({ canvas, antialias: false });
    await renderer.init();
    if (!renderer.backend.isWebGPUBackend) throw new Error("the renderer fell back to WebGL");
    renderer.setPixelRatio(1);
    renderer.setSize(size, size);
    // Chromium's process for graphics ends when SwiftShader is to show a canvas of WebGPU: what is shown goes nowhere.
    renderer.setRenderTarget(new RenderTarget(size, size));
    const tracer = new WebGPUPathTracer(renderer);
    tracer.useMegakernel(true);
    Object.assign(tracer, { renderDelay: 0, minSamples: 0, fadeDuration: 0, dynamicLowRes: false });
    Object.assign(tracer, { maxBounces: BOUNCES, clampIndirect: 0, filterGlossyFactor: 0 });
    match(scene, lamps);
    tracer.setScene(scene, camera);
    return {
        device,
        compiled: 0,
        async step() {
            tracer.renderSample();
            await renderer.backend.device.queue.onSubmittedWorkDone();
            return Math.floor((await tracer.getSampleCountsAsync()).avg);
        },
        async pixels() {
            return turned(new Float32Array(await renderer.backend.copyTextureToBuffer(tracer.target, 0, 0, size, size, 0)), size);
        },
        async show() { },
    };
}
