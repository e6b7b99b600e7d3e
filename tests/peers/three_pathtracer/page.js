// Renders a glTF scene with three-gpu-pathtracer, and keeps the float picture at every power of two of the samples.
//
// The address states `variant`, `size` and `seconds`. Variants:
//
// - loaded: the scene as three's loader gives it, and the path tracer's own settings;
// - lambertian: surfaces without gloss and a box filter, as in the reference, by changes of the shader; paths have at most 32 surfaces;
// - area-light: as `lambertian`, and a light that rays are sent to in place of the lamp's emission, which paths meet by chance;
// - webgpu: a light in place of the lamp's emission, by the package's path tracer for WebGPU, without changes of a shader.
//
// `peer` has the state for whoever drives the page; times are milliseconds since the page was navigated to.

import * as THREE from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";

const asked = new URLSearchParams(location.search);
const variant = asked.get("variant"), size = Number(asked.get("size")), seconds = Number(asked.get("seconds"));
const hasLight = !["loaded", "lambertian"].includes(variant);
// Distance of the light from the lamp's mesh, which would hide it.
const GAP = 0.001;

const peer = window.peer = { taken: [], ended: false, error: null, loaded: 0, compiled: 0, drawn: 0, device: "" };

// A rectangle of the lamp's extent and radiance that shines downwards: lamps of other forms are not known here.
function addLight(scene, lamp) {
    const { min, max } = new THREE.Box3().setFromObject(lamp);
    const light = new THREE.RectAreaLight(lamp.material.emissive, lamp.material.emissiveIntensity, max.x - min.x, max.z - min.z);
    light.position.set((min.x + max.x) / 2, min.y - GAP, (min.z + max.z) / 2);
    light.rotation.x = -Math.PI / 2;
    scene.add(light);
}

async function load() {
    const { scene: model, cameras } = await new GLTFLoader().loadAsync("scene.gltf");
    const scene = new THREE.Scene();
    scene.background = new THREE.Color(0, 0, 0);
    scene.add(model);
    const lamps = [];
    model.traverse(node => {
        if (!node.isMesh) return;
        // Where surfaces have one side, the path tracer follows shadow rays through fronts to the back.
        if (hasLight) node.material.side = THREE.DoubleSide;
        if (node.material.emissive?.getHex() > 0) lamps.push(node);
    });
    if (hasLight) lamps.forEach(lamp => addLight(scene, lamp));
    cameras[0].aspect = 1;
    cameras[0].updateProjectionMatrix();
    return { scene, camera: cameras[0], lamps };
}

async function render(tracer) {
    const take = async samples => {
        const pixels = await tracer.pixels();
        peer.taken.push({ samples, time: performance.now(), pixels });
    };
    let samples = 0;
    for (let due = 1; performance.now() < 1000 * seconds;) {
        samples = await tracer.step();
        if (samples > 0) {
            peer.compiled ||= tracer.compiled;
            peer.drawn ||= performance.now();
        }
        if (samples >= due) {
            await take(samples);
            while (due <= samples) due *= 2;
        }
        await new Promise(act => setTimeout(act, 0));
    }
    if (samples > (peer.taken.at(-1)?.samples ?? 0)) await take(samples);
}

async function main() {
    const { open } = await import(variant === "webgpu" ? "./webgpu.js" : "./webgl.js");
    const tracer = await open(document.getElementById("canvas"), size, variant, await load());
    peer.device = tracer.device;
    peer.loaded = performance.now();
    await render(tracer);
    await tracer.show();
}

main().catch(error => peer.error = String(error?.stack ?? error)).finally(() => peer.ended = true);
