// Times a page that has its own host beside the native program, on equally many cards: seconds to the first and to the settled picture, and CPU
// seconds of all processes. Fails if the EXR that the page saves is not the one that the command writes, byte for byte.
//
// usage: node --experimental-websocket tests/peers/page.mjs PHOTONCARD SITE [SCENE ...]
// SITE is a folder by `photoncard page`; a SCENE is one of it, such as scenes/cornell.gltf. It takes Chromium and a machine without other work.

import { spawnSync } from "node:child_process";
import { createServer } from "node:http";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";

import { Tab } from "./chromium.mjs";

const [program, site, ...stated] = process.argv.slice(2);
if (!site) {
    console.error("usage: node --experimental-websocket tests/peers/page.mjs PHOTONCARD SITE [SCENE ...]");
    process.exit(2);
}
const scenes = stated.length > 0 ? stated : JSON.parse(readFileSync(join(site, "scenes.json"))).map(({ file }) => file);
const KINDS = { html: "text/html", js: "text/javascript", css: "text/css", wasm: "application/wasm", svg: "image/svg+xml" };
// Seconds until a picture is given up.
const LIMIT = 600;

const server = createServer(({ url }, answer) => {
    const path = decodeURIComponent(url.split("?")[0]);
    const name = path === "/" ? "index.html" : path.slice(1);
    try {
        const bytes = readFileSync(join(resolve(site), name));
        answer.writeHead(200, { "Content-Type": KINDS[name.split(".").pop()] ?? "application/octet-stream" }).end(bytes);
    } catch {
        answer.writeHead(404).end();
    }
}).listen(0, "127.0.0.1");
await new Promise(act => server.once("listening", act));
const address = `http://127.0.0.1:${server.address().port}/`;

/** The EXR that the page saves, as bytes. */
async function save(tab) {
    await tab.value(`(() => {
        URL.createObjectURL = blob => (blob.arrayBuffer().then(bytes =>
            window.taken = btoa(Array.from(new Uint8Array(bytes), byte => String.fromCharCode(byte)).join(""))), "blob:none");
        HTMLAnchorElement.prototype.click = () => { };
        document.getElementById("save-exr").click();
        return true;
    })()`);
    if (!await tab.until("window.taken", LIMIT)) throw new Error("the page saves no EXR");
    return Buffer.from(await tab.value("window.taken"), "base64");
}

async function browse(command) {
    const tab = await Tab.open(), begun = Date.now();
    try {
        await tab.go(`${address}#${encodeURIComponent(command)}`);
        if (!await tab.until("window.photoncard?.picture?.isWhole", LIMIT)) throw new Error(`no picture of ${command}`);
        const first = Date.now();
        if (!await tab.until("window.photoncard.isSettled", LIMIT)) throw new Error(`${command} does not settle`);
        const settled = Date.now(), cpu = tab.cpuBetween(begun, settled);
        const shown = await tab.value("document.getElementById('command').textContent"), saved = await save(tab);
        return { first: (first - begun) / 1000, settled: (settled - begun) / 1000, cpu, command: shown, saved };
    } finally {
        await tab.close();
    }
}

function native(command, cards) {
    const folder = mkdtempSync(join(tmpdir(), "native-"));
    try {
        const begun = performance.now();
        const words = ["-c", `TIMEFORMAT='%U %S'; cd '${resolve(site)}' && time ${command.replace("-o picture.exr", `-o ${folder}/picture.exr`)} --card emulated:${cards} --threads ${cards} --quiet`];
        const run = spawnSync("bash", words, { env: { ...process.env, PATH: `${resolve(program, "..")}:${process.env.PATH}` }, encoding: "utf8" });
        if (run.status !== 0) throw new Error(run.stderr);
        const [user, system] = run.stderr.trim().split("\n").pop().split(" ").map(Number);
        return { wall: (performance.now() - begun) / 1000, cpu: user + system, written: readFileSync(join(folder, "picture.exr")) };
    } finally {
        rmSync(folder, { recursive: true });
    }
}

console.log("| scene | cards | first, s | settled, s | CPU s | native, s | CPU s | CPU, times |");
console.log("|---|---|---|---|---|---|---|---|");
for (const scene of scenes) {
    for (const cards of [1, 2]) {
        const page = await browse(`photoncard render ${scene} --quality draft --size 256x256 --card emulated:${cards}`);
        const alone = native(page.command, cards);
        if (!page.saved.equals(alone.written)) throw new Error(`the saved EXR differs from that of ${page.command}`);
        const seconds = number => number.toFixed(1);
        console.log(`| ${scene} | ${cards} | ${seconds(page.first)} | ${seconds(page.settled)} | ${seconds(page.cpu)} | ${seconds(alone.wall)} | ${seconds(alone.cpu)} | ${seconds(page.cpu / alone.cpu)} |`);
    }
}
server.close();
process.exit(0);
