// The Cornell box by a page of `photoncard page` and by three-gpu-pathtracer, both in headless Chromium that renders in software: errors against
// the path-traced reference over seconds and CPU seconds, and what equal errors take.
//
// usage: node --experimental-websocket tests/peers/three_pathtracer.mjs PHOTONCARD MODULE FOLDER [--seconds 130] [--cards 2] [--qualities draft,good]
//        [--variants area-light,lambertian,loaded,webgpu]
// MODULE is the WebAssembly module of the page, and Chromium that of $CHROMIUM or of the path. First: `npm install three three-gpu-pathtracer
// three-mesh-bvh xatlas-web` in FOLDER, which also takes the pictures. It takes a machine without other work.
// Seconds count from the navigation to the page; CPU seconds are those of all processes of Chromium.

import { execFileSync } from "node:child_process";
import { createServer } from "node:http";
import { mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { parseArgs } from "node:util";
import { Tab } from "./chromium.mjs";
import { Reference, png, reached } from "./three_pathtracer/errors.mjs";

const { values: options, positionals } = parseArgs({
    allowPositionals: true,
    options: {
        seconds: { type: "string", default: "130" }, cards: { type: "string", default: "2" }, qualities: { type: "string", default: "draft,good" },
        variants: { type: "string", default: "area-light,lambertian,loaded,webgpu" },
    },
});
const [program, wasm, stated] = positionals;
if (!stated) {
    console.error("usage: node --experimental-websocket tests/peers/three_pathtracer.mjs PHOTONCARD MODULE FOLDER [--seconds S] [--cards N] ..");
    process.exit(2);
}
const HERE = dirname(fileURLToPath(import.meta.url)), ROOT = resolve(HERE, "../.."), folder = resolve(stated);
const SCENE = join(ROOT, "scenes/cornell.gltf"), REFERENCE = join(ROOT, "tests/references/cornell.exr");
const KINDS = { html: "text/html", js: "text/javascript", css: "text/css", wasm: "application/wasm", svg: "image/svg+xml" };
// What a page with WebGPU takes beside the flags of all.
const WEBGPU = ["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--enable-features=Vulkan"];
// Seconds that a page may take beside those that it is asked to render.
const LIMIT = 600;

const { EXRLoader } = await import(pathToFileURL(join(folder, "node_modules/three/examples/jsm/loaders/EXRLoader.js")));
const { FloatType } = await import(pathToFileURL(join(folder, "node_modules/three/build/three.module.js")));

// Turns rows from the bottom into rows from the top.
function turned(width, height, values) {
    const pixels = new Float32Array(values.length), row = 4 * width;
    for (let y = 0; y < height; y++) pixels.set(values.subarray(row * y, row * (y + 1)), row * (height - 1 - y));
    return { width, height, pixels };
}

function decoded(exr) {
    const { width, height, data } = new EXRLoader().setDataType(FloatType).parse(exr.buffer.slice(exr.byteOffset, exr.byteOffset + exr.length));
    return turned(width, height, data);
}

// Serves files; `find` gives the file of a path.
async function serve(find) {
    const server = createServer(({ url }, answer) => {
        const path = decodeURIComponent(url.split("?")[0]);
        try {
            const file = find(path === "/" ? "/index.html" : path), bytes = readFileSync(file);
            answer.writeHead(200, { "Content-Type": KINDS[file.split(".").pop()] ?? "application/octet-stream" }).end(bytes);
        } catch {
            answer.writeHead(404).end();
        }
    }).listen(0, "127.0.0.1");
    await new Promise(act => server.once("listening", act));
    return { address: `http://127.0.0.1:${server.address().port}/`, end: () => server.close() };
}

const truth = decoded(readFileSync(REFERENCE)), reference = new Reference(truth);
const size = [truth.width, truth.height];

// Has photoncard's page keep every whole picture that it shows.
const KEEP = `(() => {
    let shown;
    window.peer = { taken: [], first: 0 };
    Object.defineProperty(window, "photoncard", { get: () => shown, set: value => {
        shown = value;
        const { picture } = value, put = picture.put.bind(picture);
        picture.put = tile => {
            const isTaken = put(tile);
            if (isTaken) peer.first ||= performance.now();
            if (isTaken && picture.isWhole) {
                const { step, samples, version, size, data } = picture;
                peer.taken.push({ time: performance.now(), step, samples, version, size: [...size], pixels: data.slice() });
            }
            return isTaken;
        };
    } });
})()`;

// The EXR that the page's button saves.
async function saved(tab) {
    await tab.value(`(() => {
        URL.createObjectURL = blob => {
            blob.arrayBuffer().then(bytes => peer.bytes = new Uint8Array(bytes));
            return "blob:none";
        };
        HTMLAnchorElement.prototype.click = () => { };
        document.getElementById("save-exr").click();
    })()`);
    if (!await tab.until("peer.bytes", LIMIT)) throw new Error("the page saves no EXR");
    const text = await tab.value("btoa(Array.from(peer.bytes, byte => String.fromCharCode(byte)).join(''))");
    return Buffer.from(text, "base64");
}

// Pictures that a page has kept, with their errors and costs.
async function points(tab, decode) {
    const origin = await tab.origin(), found = [];
    const kept = await tab.value("peer.taken.map(({ pixels, ...rest }) => rest)");
    for (const [number, { time, ...rest }] of kept.entries()) {
        const picture = decode(await tab.floats(`peer.taken[${number}].pixels`));
        found.push({ ...rest, picture, seconds: time / 1000, cpu: tab.cpuBetween(origin, origin + time), errors: reference.errors(picture) });
    }
    return found;
}

async function photoncard(quality, site) {
    const tab = await Tab.open({ before: KEEP });
    const command = `photoncard render scenes/cornell.gltf --quality ${quality} --size ${size.join("x")} --filter box --card emulated:${options.cards}`;
    await tab.go(`${site.address}#${encodeURIComponent(command)}`);
    if (!await tab.until("window.photoncard?.isSettled", LIMIT)) throw new Error(`${command} does not settle`);
    const settled = await tab.value("performance.now()"), first = await tab.value("peer.first"), origin = await tab.origin();
    const cpu = tab.cpuBetween(origin, origin + settled);
    const shown = await tab.value("document.getElementById('command').textContent");
    writeFileSync(join(folder, `photoncard-${quality}-page.png`), await tab.screenshot());
    const pictures = await points(tab, pixels => ({ width: size[0], height: size[1], pixels }));
    const exr = await saved(tab), picture = decoded(exr);
    await tab.close();
    writeFileSync(join(folder, `photoncard-${quality}.exr`), exr);
    return { name: `photoncard ${quality}`, shown, first: first / 1000, pictures, picture, seconds: settled / 1000, cpu, errors: reference.errors(picture) };
}

async function three(variant, site) {
    const tab = await Tab.open({ flags: variant === "webgpu" ? WEBGPU : [] });
    await tab.go(`${site.address}?variant=${variant}&size=${size[0]}&seconds=${options.seconds}`);
    const isEnded = await tab.until("window.peer?.ended", Number(options.seconds) + LIMIT);
    const { error, loaded, compiled, drawn, device } = await tab.value("({ ...peer, taken: null })");
    if (error || !isEnded) console.error(`three-gpu-pathtracer, ${variant}: ${error ?? "does not end"}`);
    writeFileSync(join(folder, `three-${variant}-page.png`), await tab.screenshot());
    const pictures = await points(tab, values => turned(...size, values));
    await tab.close();
    return { name: `three ${variant}`, device, loaded: loaded / 1000, compiled: compiled / 1000, drawn: drawn / 1000, pictures };
}

const percent = share => (100 * share).toFixed(2);
const cells = ({ relMSE, blocks, median, p95, mean }) => [relMSE.toExponential(2), percent(Math.sqrt(blocks)), percent(median), percent(p95), mean.toFixed(4)];
const row = values => console.log(`| ${values.join(" | ")} |`);

function head(...names) {
    row(names);
    console.log(`|${"---|".repeat(names.length)}`);
}

function printPoints(runs) {
    head("picture", "step", "samples", "s", "CPU s", "relMSE", "blocks, %", "median, %", "95th, %", "mean");
    for (const { name, pictures } of runs) {
        for (const { step = 1, samples, seconds, cpu, errors } of pictures) row([name, step, samples, seconds.toFixed(1), cpu.toFixed(1), ...cells(errors)]);
    }
    for (const { name, picture, seconds, cpu, errors } of runs) {
        if (picture) row([`${name}, settled`, 1, "", seconds.toFixed(1), cpu.toFixed(1), ...cells(errors)]);
    }
}

// Pictures of photoncard with which the peers are compared: the first with all pixels, and the settled one.
function compared({ name, pictures, ...settled }) {
    const whole = pictures.find(({ step }) => step === 1);
    return [...whole ? [{ ...whole, name: `${name}, first whole` }] : [], { ...settled, name: `${name}, settled` }];
}

// The noise of the reference is taken off both errors.
function printEqual(own, peers) {
    head("equal", "as", "error", "s", "CPU s", "peer", "samples", "s", "CPU s", "s, times", "CPU, times", "");
    for (const { name, seconds, cpu, errors } of own.flatMap(compared)) {
        for (const peer of peers.filter(({ pictures }) => pictures.length > 1)) {
            for (const measure of ["relMSE", "blocks"]) {
                const at = reached(peer.pictures, measure, errors[measure]);
                if (!at) continue;
                const shown = measure === "relMSE" ? errors.relMSE.toExponential(2) : `${percent(Math.sqrt(errors.blocks))} %`;
                row([measure, name, shown, seconds.toFixed(1), cpu.toFixed(1), peer.name, at.samples.toFixed(1), at.seconds.toFixed(1), at.cpu.toFixed(1),
                    (at.seconds / seconds).toFixed(1), (at.cpu / cpu).toFixed(1), at.how]);
            }
        }
    }
}

mkdirSync(folder, { recursive: true });
rmSync(join(folder, "site"), { recursive: true, force: true });
execFileSync(resolve(program), ["page", join(folder, "site"), "--scene", SCENE, "--module", resolve(wasm)], { stdio: "inherit" });
const ownSite = await serve(path => join(folder, "site", path));
const peerSite = await serve(path => {
    if (path === "/scene.gltf") return SCENE;
    return path.startsWith("/node_modules/") ? join(folder, path) : join(HERE, "three_pathtracer", path);
});
const own = [], peers = [];
for (const quality of options.qualities.split(",").filter(Boolean)) own.push(await photoncard(quality, ownSite));
for (const variant of options.variants.split(",").filter(Boolean)) peers.push(await three(variant, peerSite));

for (const { name, shown, first, pictures } of own) {
    const whole = pictures.find(({ step }) => step === 1);
    console.log(`${name}: first tile ${first.toFixed(1)} s, first whole picture of all pixels ${whole?.seconds.toFixed(1)} s; ${shown}`);
}
for (const { name, device, loaded, compiled, drawn } of peers) {
    const seconds = [loaded, compiled, drawn].map(time => time.toFixed(1));
    console.log(`${name}: ${device}; scene loaded ${seconds[0]} s, shader translated ${seconds[1]} s, first sample drawn ${seconds[2]} s`);
}
console.log();
printPoints([...own, ...peers]);
console.log();
printEqual(own, peers);
const last = [...own.map(({ picture }) => picture), ...peers.flatMap(({ pictures }) => pictures.slice(-1).map(({ picture }) => picture))];
writeFileSync(join(folder, "pictures.png"), png([truth, ...last]));
writeFileSync(join(folder, "figures.json"), JSON.stringify({ own, peers }, (key, value) => key === "picture" ? undefined : value, 1));
ownSite.end();
peerSite.end();
process.exit(0);
