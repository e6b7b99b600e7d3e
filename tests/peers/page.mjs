// Times a page that has its own host beside the native program, on equally many cards: seconds to the first and to the settled picture, and CPU
// seconds of all processes.
//
// usage: node --experimental-websocket tests/peers/page.mjs PHOTONCARD SITE [SCENE ...]
// SITE is a folder by `photoncard page`; a SCENE is one of it, such as scenes/cornell.gltf. It takes Chromium and a machine without other work.

import { spawn, spawnSync } from "node:child_process";
import { createServer } from "node:http";
import { mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";

const [program, site, ...stated] = process.argv.slice(2);
if (!site) {
    console.error("usage: node --experimental-websocket tests/peers/page.mjs PHOTONCARD SITE [SCENE ...]");
    process.exit(2);
}
const scenes = stated.length > 0 ? stated : JSON.parse(readFileSync(join(site, "scenes.json"))).map(({ file }) => file);
const KINDS = { html: "text/html", js: "text/javascript", css: "text/css", wasm: "application/wasm", svg: "image/svg+xml" };
const TICKS = 100;

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

// CPU seconds of a process and all below it, those that have ended included.
function cpu(root) {
    const processes = readdirSync("/proc").filter(name => /^\d+$/.test(name)).flatMap(id => {
        try {
            const fields = readFileSync(`/proc/${id}/stat`, "latin1").split(") ")[1].split(" ");
            return [{ id: Number(id), parent: Number(fields[1]), ticks: [11, 12, 13, 14].reduce((sum, at) => sum + Number(fields[at]), 0) }];
        } catch {
            return [];
        }
    });
    const below = new Set([root]);
    for (let before = 0; before !== below.size;) {
        before = below.size;
        for (const { id, parent } of processes) if (below.has(parent)) below.add(id);
    }
    return processes.filter(({ id }) => below.has(id)).reduce((sum, { ticks }) => sum + ticks, 0) / TICKS;
}

async function browse(command) {
    const profile = mkdtempSync(join(tmpdir(), "page-"));
    const chromium = spawn("chromium", ["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader", "--remote-debugging-port=0", `--user-data-dir=${profile}`, "about:blank"], { stdio: ["ignore", "ignore", "pipe"] });
    const root = await new Promise(act => {
        let said = "";
        chromium.stderr.on("data", more => {
            const found = /DevTools listening on (\S+)/.exec(said += more);
            if (found) act(found[1]);
        });
    });
    const connect = async url => {
        const socket = new WebSocket(url), waiting = new Map();
        let number = 0;
        socket.onmessage = ({ data }) => {
            const { id, result } = JSON.parse(data);
            waiting.get(id)?.(result);
        };
        await new Promise(act => socket.onopen = act);
        return (method, params = {}) => new Promise(act => {
            waiting.set(++number, act);
            socket.send(JSON.stringify({ id: number, method, params }));
        });
    };
    const browser = await connect(root);
    const { targetId } = await browser("Target.createTarget", { url: "about:blank", newWindow: true });
    const call = await connect(`${root.split("/devtools/")[0]}/devtools/page/${targetId}`);
    const value = async expression => (await call("Runtime.evaluate", { expression, returnByValue: true })).result?.value;
    const begun = performance.now(), before = cpu(chromium.pid);
    await call("Page.navigate", { url: `${address}#${encodeURIComponent(command)}` });
    let first = 0;
    while (!await value("Boolean(window.photoncard?.isSettled)")) {
        if (first === 0 && await value("window.photoncard?.picture?.isWhole")) first = performance.now() - begun;
        await new Promise(act => setTimeout(act, 50));
    }
    const settled = performance.now() - begun;
    const found = { first: first / 1000, settled: settled / 1000, cpu: cpu(chromium.pid) - before, command: await value("document.getElementById('command').textContent") };
    chromium.kill();
    await new Promise(act => chromium.once("exit", act));
    rmSync(profile, { recursive: true, force: true, maxRetries: 50 });
    return found;
}

function native(command, cards) {
    const folder = mkdtempSync(join(tmpdir(), "native-"));
    const begun = performance.now();
    const words = ["-c", `TIMEFORMAT='%U %S'; cd '${resolve(site)}' && time ${command.replace("-o picture.exr", `-o ${folder}/picture.exr`)} --card emulated:${cards} --threads ${cards} --quiet`];
    const run = spawnSync("bash", words, { env: { ...process.env, PATH: `${resolve(program, "..")}:${process.env.PATH}` }, encoding: "utf8" });
    if (run.status !== 0) throw new Error(run.stderr);
    const [user, system] = run.stderr.trim().split("\n").pop().split(" ").map(Number);
    rmSync(folder, { recursive: true });
    return { wall: (performance.now() - begun) / 1000, cpu: user + system };
}

console.log("| scene | cards | first, s | settled, s | CPU s | native, s | CPU s | CPU, times |");
console.log("|---|---|---|---|---|---|---|---|");
for (const scene of scenes) {
    for (const cards of [1, 2]) {
        const page = await browse(`photoncard render ${scene} --quality draft --size 256x256 --card emulated:${cards}`);
        const alone = native(page.command, cards);
        const seconds = number => number.toFixed(1);
        console.log(`| ${scene} | ${cards} | ${seconds(page.first)} | ${seconds(page.settled)} | ${seconds(page.cpu)} | ${seconds(alone.wall)} | ${seconds(alone.cpu)} | ${seconds(page.cpu / alone.cpu)} |`);
    }
}
server.close();
process.exit(0);
