// The path tracers of the package for WebGPU.

import { WebGPURenderer } from "three/webgpu";
import { WebGPUPathTracer } from "three-gpu-pathtracer/webgpu";

const BOUNCES = 32;

// Surfaces without a share of Fresnel's reflectance. The light has the lamp's emission, which the eye does not see then.
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

export async function open(canvas, size, variant, { scene, camera, lamps }) {
    const device = await deviceOf();
    const renderer = new WebGPURenderer({ canvas, antialias: false });
    await renderer.init();
    if (!renderer.backend.isWebGPUBackend) throw new Error("the renderer fell back to WebGL");
    renderer.setPixelRatio(1);
    renderer.setSize(size, size);
    const tracer = new WebGPUPathTracer(renderer);
    if (variant === "webgpu") tracer.useMegakernel(true);
    Object.assign(tracer, { renderDelay: 0, minSamples: 0, fadeDuration: 0, dynamicLowRes: false, maxBounces: BOUNCES, clampIndirect: 0, filterGlossyFactor: 0 });
    match(scene, lamps);
    tracer.setScene(scene, camera);
    return {
        device,
        async step() {
            tracer.renderSample();
            await renderer.backend.device.queue.onSubmittedWorkDone();
            return Math.floor((await tracer.getSampleCountsAsync()).avg);
        },
        async pixels() {
            return turned(new Float32Array(await renderer.backend.copyTextureToBuffer(tracer.target, 0, 0, size, size, 0)), size);
        },
        async show() {
            tracer.pause = true;
            tracer.renderSample();
        },
    };
}
