// The path tracer of the package for WebGL.

import * as THREE from "three";
import { WebGLPathTracer } from "three-gpu-pathtracer";

// The greatest number of surfaces of a path, as the lost light is to be less than the noise.
const BOUNCES = 32;

// Passages of the shader and what they become: a box filter of one pixel, a Lambertian reflectance without Fresnel's share and retroreflection,
// and directions by its cosine alone, as half of them would be those of a gloss that does not exist.
const CHANGES = [
    [/tentFilter\( ruv\.x \) \* ssd\.x/, "( ruv.x - 0.5 ) * ssd.x"],
    [/tentFilter\( ruv\.y \) \* ssd\.y/, "( ruv.y - 0.5 ) * ssd.y"],
    [/color = \( 1\.0 - F \) \* transFactor[^;]*;/, "color = wi.z * surf.color / PI;"],
    [/float diffSpecularProb = [^;]*;/, "float diffSpecularProb = 0.0;"],
];
// The eye sees the lamp's emission, and paths have it from the light.
const SEEN = [/gl_FragColor\.rgb \+= \( surf\.emission \* state\.throughputColor \);/, "if ( state.firstRay ) gl_FragColor.rgb += surf.emission;"];

function change(material, changes) {
    for (const [passage, text] of changes) {
        if (!passage.test(material.fragmentShader)) throw new Error(`the shader has no passage ${passage}`);
        material.fragmentShader = material.fragmentShader.replace(passage, text);
    }
    // The values that the path tracer would find by itself, each with one compilation more.
    Object.assign(material.defines, { FEATURE_DOF: 0, FEATURE_FOG: 0, FEATURE_BACKGROUND_MAP: 1 });
}

function prepared(renderer, variant) {
    const tracer = new WebGLPathTracer(renderer);
    Object.assign(tracer, { renderDelay: 0, fadeDuration: 0, minSamples: 0, rasterizeScene: false, renderToCanvas: false });
    if (variant === "loaded") return tracer;
    tracer.tiles.set(1, 1);
    tracer.bounces = BOUNCES;
    change(tracer._pathTracer.material, variant === "area-light" ? [...CHANGES, SEEN] : CHANGES);
    return tracer;
}

// The name of what draws.
function deviceOf(gl) {
    return gl.getParameter(gl.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER);
}

export async function open(canvas, size, variant, { scene, camera }) {
    const renderer = new THREE.WebGLRenderer({ canvas, antialias: false, preserveDrawingBuffer: true });
    renderer.debug.onShaderError = (gl, program, vertex, fragment) => {
        throw new Error(`the shader is not compiled: ${gl.getProgramInfoLog(program)} ${gl.getShaderInfoLog(fragment)}`);
    };
    renderer.setPixelRatio(1);
    renderer.setSize(size, size);
    const tracer = prepared(renderer, variant);
    tracer.setScene(scene, camera);
    const read = (width, height) => {
        const pixels = new Float32Array(4 * width * height);
        renderer.readRenderTargetPixels(tracer.target, 0, 0, width, height, pixels);
        return pixels;
    };
    return {
        device: deviceOf(renderer.getContext()),
        // When the browser had compiled the shader; SwiftShader does so once more for the first drawing.
        compiled: 0,
        // Draws the tiles of one sample, waits for them, and returns the samples that all pixels have: 0 while the shader is compiled.
        async step() {
            do tracer.renderSample(); while (!Number.isInteger(tracer.samples));
            if (tracer.samples > 0) {
                this.compiled ||= performance.now();
                read(1, 1);
            }
            return tracer.samples;
        },
        // Rows are from the bottom.
        pixels: async () => read(size, size),
        async show() {
            Object.assign(tracer, { pausePathTracing: true, renderToCanvas: true });
            tracer.renderSample();
        },
    };
}
