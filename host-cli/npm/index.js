// Renders a scene in workers of this page: one is the host, others are cards.

import { Session } from "./session.js";

// Name of a scene whose bytes have none.
const NAMELESS = "scene.glb";
// Each card is a worker with a card memory of its own.
const MAX_CARDS = 16;

const isScene = name => /\.(glb|gltf)$/i.test(name);

export async function render(scene, options = {}) {
    const { signal, progress, layers: shown = [], exposure = null, tonemap = "reinhard" } = options;
    signal?.throwIfAborted();
    const { name, files } = await filesOf(scene, signal);
    const words = wordsOf(options);
    signal?.throwIfAborted();
    const session = new Session(progress);
    const abort = () => session.end(signal.reason);
    signal?.addEventListener("abort", abort);
    try {
        session.open(files, [...words, "--", name]);
        const { size: [width, height], command } = await session.settled();
        const pixels = session.pixels;
        const exr = await session.saved({ name: "picture.exr" });
        const png = await session.saved({ name: "picture.png", exposure, tonemap });
        const layers = {};
        for (const layer of shown) layers[layer] = await session.layer(layer);
        return { width, height, pixels, layers, command, notices: session.notices, exr: async () => exr, png: async () => png };
    } finally {
        signal?.removeEventListener("abort", abort);
        session.close();
    }
}

// The files of a scene, and which of them is the scene itself.
async function filesOf(scene, signal) {
    if (typeof scene === "string" || scene instanceof URL) return fetched(scene, signal);
    const isOne = scene instanceof Blob || scene instanceof ArrayBuffer || ArrayBuffer.isView(scene);
    const named = isOne ? [[isScene(scene.name) ? scene.name : NAMELESS, scene]]
        : scene instanceof Map ? [...scene] : Object.entries(scene);
    const files = new Map();
    for (const [path, content] of named) files.set(plain(path), await bytesOf(path, content));
    const name = [...files.keys()].find(isScene);
    if (!name) throw new Error("none of the files is a scene: a scene is a file .glb or .gltf, with the files that it names");
    return { name, files };
}

async function fetched(url, signal) {
    const answer = await fetch(url, { signal });
    if (!answer.ok) throw new Error(`${url} cannot be had: the server answers ${answer.status}`);
    const last = decodeURIComponent(new URL(answer.url).pathname.split("/").pop());
    const name = isScene(last) ? last : NAMELESS;
    return { name, files: new Map([[name, new Uint8Array(await answer.arrayBuffer())]]) };
}

// A path as the module looks for it.
const plain = path => path.split("/").filter(part => part !== "" && part !== ".").join("/");

// A copy of a file's bytes: they move to the host.
async function bytesOf(path, content) {
    if (content instanceof Blob) return new Uint8Array(await content.arrayBuffer());
    if (content instanceof ArrayBuffer) return new Uint8Array(content.slice());
    if (ArrayBuffer.isView(content)) return new Uint8Array(content.buffer, content.byteOffset, content.byteLength).slice();
    throw new TypeError(`${path} is neither a Uint8Array, an ArrayBuffer nor a Blob`);
}

// The options as words of `photoncard view`.
function wordsOf({ size, quality, camera = {}, set = {}, layers = [], cards, arguments: more = [] }) {
    const stated = {
        "size": size?.join("x"),
        "quality": quality,
        "camera": camera.name,
        "camera-at": camera.position,
        "look-at": camera.lookAt,
        "up": camera.up,
        "fov": camera.fov,
        "aov": layers.length > 0 ? layers : undefined,
        "card": `emulated:${cards ?? Math.min(navigator.hardwareConcurrency ?? 1, MAX_CARDS)}`,
    };
    const options = Object.entries(stated).filter(([, value]) => value !== undefined);
    const assignments = Object.entries(set).map(([name, value]) => ["set", `${name}=${value}`]);
    return [...[...options, ...assignments].map(([option, value]) => `--${option}=${value}`), ...more];
}
