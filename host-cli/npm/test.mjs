// Tests the package as its user has it: packed, installed, bundled by Vite, and run in a headless Chromium.
// usage: PHOTONCARD=PROGRAM node host-cli/npm/test.mjs MODULE.wasm

import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { extname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { inflateSync } from "node:zlib";

const VERSIONS = { typescript: "5.9.3", vite: "8.3.8" };
const KINDS = { ".bin": "application/octet-stream", ".html": "text/html", ".js": "text/javascript", ".wasm": "application/wasm", ".gltf": "model/gltf+json" };
const POLICY = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'";
const BROWSERS = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
// Milliseconds.
const LIMIT = 120000, LOOK = 50;

const [module] = process.argv.slice(2), { PHOTONCARD: program } = process.env;
if (!module || !program) {
    console.error("usage: PHOTONCARD=PROGRAM node host-cli/npm/test.mjs MODULE.wasm");
    process.exit(2);
}
const here = fileURLToPath(new URL(".", import.meta.url));
const cornell = join(here, "../../scenes/cornell.gltf");
const room = mkdtempSync(join(tmpdir(), "photoncard-npm-"));
const project = join(room, "project"), scenes = join(project, "public");

// A picture that takes a moment and leaves no setting to pilot renders.
const SMALL = `size: [64, 64], quality: "paper", cards: 2, arguments: "${
    "--photons 2000 --gather-rays 4 --neighbors 10 --shadow-rays 1 --spp 2"}".split(" ")`;

// The page of a user. What must not compile is marked; the compiler fails where it does.
const PAGE = `
import { render, type Result } from "photoncard";

const text = (bytes: Uint8Array) => btoa(Array.from(bytes, byte => String.fromCharCode(byte)).join(""));

const plain = async (result: Result) => ({
    ...result,
    pixels: text(new Uint8Array(result.pixels.buffer)),
    layers: Object.fromEntries(Object.entries(result.layers).map(([name, values]) => [name, text(new Uint8Array(values.buffer))])),
    exr: text(await result.exr()),
    png: text(await result.png()),
});

// @ts-expect-error
const noQuality: Parameters<typeof render>[1] = { quality: "best" };
// @ts-expect-error
const noScene: Parameters<typeof render>[0] = 7;

Object.assign(globalThis, { render, plain, noQuality, noScene });
`;

function run(program, words, folder) {
    return execFileSync(program, words, { cwd: folder, encoding: "utf8", stdio: ["ignore", "pipe", "inherit"] });
}

// Packs twice, and installs and bundles the package.
function build() {
    const pack = folder => run(join(here, "pack.sh"), [module, join(room, folder)], process.cwd()).trim();
    const [first, second] = ["first", "second"].map(pack);
    assert(readFileSync(first).equals(readFileSync(second)), "two runs made different packages");
    mkdirSync(join(scenes, "parts/data"), { recursive: true });
    for (const name of ["cornell.gltf", "scene.glb"]) cpSync(cornell, join(scenes, name));
    const whole = readFileSync(cornell, "utf8"), [, data] = /"data:[^,"]*,([^"]*)"/.exec(whole);
    writeFileSync(join(scenes, "parts/cornell.gltf"), whole.replace(/"data:[^"]*"/, '"data/box%201.bin"'));
    writeFileSync(join(scenes, "parts/data/box 1.bin"), Buffer.from(data, "base64"));
    writeFileSync(join(project, "package.json"), JSON.stringify({ private: true, type: "module" }));
    writeFileSync(join(project, "index.html"), `<!doctype html><link rel="icon" href="data:,"><script type="module" src="/main.ts"></script>`);
    writeFileSync(join(project, "main.ts"), PAGE);
    const tools = Object.entries(VERSIONS).map(([name, version]) => `${name}@${version}`);
    run("npm", ["install", "--silent", "--no-audit", "--no-fund", "--save-exact", first, ...tools], project);
    const compiler = ["--noEmit", "--strict", "--target", "es2022", "--module", "esnext", "--moduleResolution", "bundler", "main.ts"];
    run("npx", ["tsc", ...compiler], project);
    run("npx", ["vite", "build", "--logLevel", "warn"], project);
    return join(project, "dist");
}

// A plain server of a folder's files: no header isolates the page.
async function served(folder) {
    const files = new Map(readdirSync(folder, { recursive: true }).map(path => [`/${path}`, join(folder, path)]));
    const server = createServer(({ url }, answer) => {
        const path = url === "/" ? "/index.html" : decodeURI(url), kind = KINDS[extname(path)];
        if (!files.has(path) || !kind) return answer.writeHead(404).end();
        answer.writeHead(200, { "Content-Type": kind, "Content-Security-Policy": POLICY }).end(readFileSync(files.get(path)));
    });
    await new Promise(ready => server.listen(0, "127.0.0.1", ready));
    return { server, origin: `http://127.0.0.1:${server.address().port}` };
}

// A page in Chromium with its workers and what all of them ask of the network, by the pipes of its protocol.
class Browser {
    requests = [];
    workers = new Set();
    #waiting = new Map();
    #id = 0;
    #rest = "";

    async open(address) {
        const name = BROWSERS.find(name => process.env.PATH.split(":").some(folder => existsSync(join(folder, name))));
        assert(name, "there is no Chromium");
        const profile = join(room, "profile");
        this.child = spawn(name, ["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--remote-debugging-pipe",
            `--user-data-dir=${profile}`, "about:blank"], { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
        this.child.stdio[4].setEncoding("utf8").on("data", data => this.#hear(data));
        const { targetId } = await this.call("Target.createTarget", { url: "about:blank" });
        const { sessionId } = await this.call("Target.attachToTarget", { targetId, flatten: true });
        this.page = sessionId;
        await this.#follow(sessionId);
        await this.call("Page.enable", {}, sessionId);
        await this.call("Page.navigate", { url: address }, sessionId);
        await this.until(() => this.value("typeof render === 'function'"), "the page does not begin");
    }

    call(method, params = {}, sessionId = undefined) {
        const id = ++this.#id;
        this.child.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId })}\0`);
        return new Promise((resolve, reject) => this.#waiting.set(id, { resolve, reject, method }));
    }

    #hear(data) {
        const messages = (this.#rest + data).split("\0");
        this.#rest = messages.pop();
        for (const { id, error, result, method, params } of messages.map(text => JSON.parse(text))) {
            const waiting = this.#waiting.get(id);
            if (error) waiting.reject(new Error(`${waiting.method}: ${error.message}`));
            else waiting?.resolve(result);
            this.#waiting.delete(id);
            if (method === "Network.requestWillBeSent") this.requests.push(params.request.url);
            if (method === "Target.attachedToTarget") this.#attach(params);
            if (method === "Target.detachedFromTarget") this.workers.delete(params.sessionId);
        }
    }

    async #attach({ sessionId, targetInfo }) {
        if (targetInfo.type === "worker") this.workers.add(sessionId);
        await this.#follow(sessionId);
        await this.call("Runtime.runIfWaitingForDebugger", {}, sessionId);
    }

    // Attaches to the workers of a page or a worker before they ask for anything.
    async #follow(sessionId) {
        await this.call("Network.enable", {}, sessionId);
        await this.call("Target.setAutoAttach", { autoAttach: true, waitForDebuggerOnStart: true, flatten: true }, sessionId);
    }

    async value(expression) {
        const { result, exceptionDetails } = await this.call("Runtime.evaluate",
            { expression, awaitPromise: true, returnByValue: true }, this.page);
        if (exceptionDetails) throw new Error(`${expression}: ${exceptionDetails.exception?.description}`);
        return result.value;
    }

    async until(test, reason) {
        const end = Date.now() + LIMIT;
        while (!await test()) {
            assert(Date.now() < end, reason);
            await new Promise(later => setTimeout(later, LOOK));
        }
    }

    async close() {
        if (!this.child) return;
        const ended = new Promise(resolve => this.child.once("exit", resolve));
        await this.call("Browser.close");
        await ended;
    }
}

// The channels of an EXR of floats in blocks of 16 lines, compressed by ZIP.
function channelsOf(exr) {
    let at = 8;
    const text = () => exr.toString("utf8", at, (at = exr.indexOf(0, at) + 1) - 1);
    const attributes = {};
    for (let name = text(); name !== ""; name = text()) {
        text();
        attributes[name] = exr.subarray(at + 4, at += 4 + exr.readInt32LE(at));
    }
    assert.equal(attributes.compression[0], 3, "the EXR is not compressed by ZIP");
    const names = [...attributes.channels.toString("latin1").matchAll(/([A-Za-z.]+)\0\x02\0\0\0/g)].map(([, name]) => name);
    const [width, height] = [8, 12].map(place => attributes.dataWindow.readInt32LE(place) + 1);
    const channels = Object.fromEntries(names.map(name => [name, new Float32Array(width * height)]));
    for (let first = 0, entry = at; first < height; first += 16, entry += 8) {
        const chunk = Number(exr.readBigUInt64LE(entry)), rows = Math.min(16, height - first);
        const size = rows * width * names.length * 4, packed = exr.subarray(chunk + 8, chunk + 8 + exr.readInt32LE(chunk + 4));
        const bytes = packed.length === size ? packed : unfiltered(inflateSync(packed));
        for (let row = 0, from = 0; row < rows; row++) {
            for (const name of names) {
                for (let x = 0; x < width; x++, from += 4) channels[name][(first + row) * width + x] = bytes.readFloatLE(from);
            }
        }
    }
    return channels;
}

// Differences of bytes, the even ones before the odd ones, as they were.
function unfiltered(bytes) {
    for (let at = 1; at < bytes.length; at++) bytes[at] = bytes[at - 1] + bytes[at] - 128;
    const half = Math.ceil(bytes.length / 2);
    return Buffer.from(bytes.map((_, at) => bytes[at % 2 === 0 ? at / 2 : half + (at - 1) / 2]));
}

// Checks a picture against that of its command line, by the program.
function checkPicture(result, size) {
    assert.deepEqual([result.width, result.height], size);
    const folder = mkdtempSync(join(room, "command-"));
    cpSync(scenes, folder, { recursive: true });
    run("sh", ["-c", `photoncard() { "$PHOTONCARD" "$@" --quiet; }; ${result.command}`], folder);
    const file = readFileSync(join(folder, "picture.exr")), exr = Buffer.from(result.exr, "base64");
    assert(exr.equals(file), `the EXR differs from that of ${result.command}`);
    const channels = channelsOf(file);
    checkValues("pixels", result.pixels, ["R", "G", "B"].map(name => channels[name]));
    for (const [layer, values] of Object.entries(result.layers)) {
        const parts = layer === "N" ? ["X", "Y", "Z"] : ["R", "G", "B"];
        checkValues(layer, values, layer === "Z" ? Array(3).fill(channels.Z) : parts.map(part => channels[`${layer}.${part}`]));
    }
    run(program, ["tonemap", "picture.exr", "-o", "picture.png"], folder);
    assert(Buffer.from(result.png, "base64").equals(readFileSync(join(folder, "picture.png"))), "the PNG differs from that of the command");
}

// Compares bits: a NaN is a value too.
function checkValues(name, base64, channels) {
    const bytes = Buffer.from(base64, "base64");
    const expected = Float32Array.from({ length: 3 * channels[0].length }, (_, at) => channels[at % 3][Math.floor(at / 3)]);
    assert(expected.some(value => value !== expected[0]), `${name}: the picture has one value`);
    assert(bytes.equals(Buffer.from(expected.buffer)), `${name} differs from the EXR`);
}

async function rejection(browser, expression) {
    return browser.value(`${expression}.then(() => null, error => ({
        isError: error instanceof Error, isAbort: error?.name === "AbortError", text: error?.message }))`);
}

const tests = {
    async "a picture is that of its command, bit for bit"(browser) {
        const result = await browser.value(`(async () => {
            window.told = [];
            return plain(await render("cornell.gltf", { ${SMALL}, progress: ({ samples, of, width, height, pixels }) =>
                told.push({ samples, of, isWhole: pixels.length === 3 * width * height, isLit: pixels.some(value => value > 0) }) }));
        })()`);
        checkPicture(result, [64, 64]);
        const told = await browser.value("told");
        assert(told.every(({ of, isWhole }) => of === 2 && isWhole), JSON.stringify(told));
        assert(told.every(({ samples }, at) => samples >= (told[at - 1]?.samples ?? 0)), "samples become fewer");
        assert.deepEqual([told[0].samples, told.at(-1).samples, told.at(-1).isLit], [0, 2, true]);
    },

    async "two renders at once have their own pictures"(browser) {
        const [first, second] = await browser.value(`(async () => {
            const of = async path => (await fetch(path)).arrayBuffer();
            const bytes = await of("cornell.gltf"), data = new Uint8Array(await of("parts/data/box 1.bin"));
            const files = new Map([["./parts/data/box 1.bin", data], ["parts/cornell.gltf", new Blob([await of("parts/cornell.gltf")])]]);
            return Promise.all((await Promise.all([
                render(files, { ${SMALL} }),
                render(bytes, { ${SMALL}, size: [48, 40], layers: ["direct", "N", "Z"], set: { "light.emission": [9, 10, 11] },
                    camera: { position: [0.1, 0.2, 1.5], lookAt: [0, 0, 0], fov: 50 } }),
            ])).map(plain));
        })()`);
        checkPicture(first, [64, 64]);
        checkPicture(second, [48, 40]);
        assert.match(second.command, /light.emission=9,10,11/);
        assert.deepEqual(Object.keys(second.layers), ["direct", "N", "Z"]);
    },

    async "abort ends the workers"(browser) {
        await browser.value(`window.control = new AbortController();
            window.aborted = render("cornell.gltf", { ${SMALL}, size: [1024, 1024], signal: control.signal }); aborted.catch(() => { }); 0`);
        await browser.until(() => browser.workers.size === 3, "there are no workers: a host and two cards");
        await browser.value("control.abort()");
        const { isAbort } = await rejection(browser, "aborted");
        assert(isAbort, "the promise is not rejected by the signal's reason");
        await browser.until(() => browser.workers.size === 0, "workers have survived the abort");
        assert((await rejection(browser, `render("cornell.gltf", { signal: control.signal })`)).isAbort, "a signal of before is not seen");
    },

    async "what cannot be rendered is refused with a sentence"(browser) {
        for (const [call, said] of [
            [`render(new Uint8Array([1, 2, 3]))`, /scene\.glb/],
            [`fetch("cornell.gltf").then(answer => answer.text()).then(text =>
                render({ "a.gltf": new TextEncoder().encode(text.replace(/data:[^"]*/, "lost.bin")) }))`, /lost\.bin: No such file/],
            [`render({ "a.txt": new Uint8Array(1) })`, /none of the files is a scene/],
            [`render({ "a.glb": "text" })`, /a\.glb is neither/],
            [`render("missing.glb")`, /missing\.glb .* 404/],
            [`render("cornell.gltf", { ${SMALL}, set: { "lamp.colour": 1 } })`, /lamp/],
            [`render("cornell.gltf", { arguments: ["--sides", "3"] })`, /--sides/],
            [`render("cornell.gltf", { ${SMALL}, layers: ["beauty"] })`, /beauty/],
            [`render("cornell.gltf", { ${SMALL}, progress() { throw new Error("of the caller"); } })`, /^of the caller$/],
        ]) {
            const refused = await rejection(browser, call);
            assert(refused?.isError && said.test(refused.text), `${call}: ${JSON.stringify(refused)}`);
            console.log(`    ${refused.text.split("\n")[0]}`);
        }
    },

    async "workers end, and no request leaves the origin"(browser, origin) {
        await browser.until(() => browser.workers.size === 0, "workers have survived their renders");
        assert.equal(await browser.value("crossOriginIsolated"), false);
        assert(browser.requests.some(url => url.endsWith(".wasm")), "requests of workers are not seen");
        assert.deepEqual(browser.requests.filter(url => !url.startsWith(`${origin}/`) && !url.startsWith("data:")), []);
    },
};

const browser = new Browser();
let server;
try {
    const site = await served(build());
    server = site.server;
    await browser.open(`${site.origin}/`);
    for (const [name, act] of Object.entries(tests)) {
        await act(browser, site.origin);
        console.log(`ok: ${name}`);
    }
} finally {
    await browser.close();
    server?.close();
    rmSync(room, { recursive: true, force: true, maxRetries: 10, retryDelay: 200 });
}
