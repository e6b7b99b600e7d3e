// Headless Chromium that renders in software, driven by its DevTools protocol, and the CPU time of its processes.

import { spawn } from "node:child_process";
import { mkdtempSync, readdirSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const TICKS = 100;
// WebGL by ANGLE on SwiftShader. The watchdog would end a process that draws for ten seconds.
const FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-gpu-watchdog", "--disable-background-networking", "--remote-debugging-port=0"];
// Milliseconds between two readings of the CPU time.
const PACE = 200;
const STATED = process.env.CHROMIUM ?? "chromium";

// CPU seconds of a process and all below it, those that have ended included.
export function cpu(root) {
    const processes = readdirSync("/proc").filter(name => /^\d+$/.test(name)).flatMap(id => {
        try {
            const fields = readFileSync(`/proc/${id}/stat`, "latin1").split(") ").pop().split(" ");
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

// A connection of the protocol. Messages that answer no call go to `hear`.
async function connect(url, hear = () => { }) {
    const socket = new WebSocket(url), waiting = new Map();
    let number = 0;
    socket.onmessage = ({ data }) => {
        const message = JSON.parse(data);
        if (message.id === undefined) return hear(message);
        waiting.get(message.id)?.(message);
        waiting.delete(message.id);
    };
    await new Promise(act => socket.onopen = act);
    return async (method, params = {}) => {
        const { result, error } = await new Promise(act => {
            waiting.set(++number, act);
            socket.send(JSON.stringify({ id: number, method, params }));
        });
        if (error) throw new Error(`${method}: ${error.message}`);
        return result;
    };
}

// Complaints of a page, for whoever reads the output.
function heard({ method, params }) {
    if (method === "Runtime.exceptionThrown") {
        const { text, exception } = params.exceptionDetails;
        return `${text} ${exception?.description ?? ""}`;
    }
    if (method === "Runtime.consoleAPICalled" && ["error", "warning"].includes(params.type)) {
        return params.args.map(({ value, description }) => value ?? description).join(" ").slice(0, 2000);
    }
    return null;
}

// Removes a folder in which processes that end still write: retries of `rmSync` do not read the folder again.
async function removed(folder) {
    for (let tries = 1; ; tries++) {
        try {
            return rmSync(folder, { recursive: true, force: true });
        } catch (error) {
            if (tries === 50) throw error;
        }
        await new Promise(act => setTimeout(act, 100));
    }
}

// One page in a browser of its own.
export class Tab {
    #process;
    #profile;
    #call;
    #readings = [];
    #timer;

    static async open({ flags = [], before = "" } = {}) {
        const tab = new Tab();
        await tab.#start(flags);
        if (before) await tab.#call("Page.addScriptToEvaluateOnNewDocument", { source: before });
        return tab;
    }

    async #start(flags) {
        this.#profile = mkdtempSync(join(tmpdir(), "peer-"));
        const process = this.#process = spawn(STATED, [...FLAGS, ...flags, `--user-data-dir=${this.#profile}`, "about:blank"],
            { stdio: ["ignore", "ignore", "pipe"] });
        const root = await new Promise((act, refuse) => {
            let said = "";
            process.once("error", refuse);
            process.stderr.on("data", more => {
                const found = /DevTools listening on (\S+)/.exec(said += more);
                if (found) act(found[1]);
            });
        });
        const browser = await connect(root);
        const { targetId } = await browser("Target.createTarget", { url: "about:blank", newWindow: true });
        // Each complaint is told once.
        const told = new Set();
        this.#call = await connect(`${root.split("/devtools/")[0]}/devtools/page/${targetId}`, message => {
            const complaint = heard(message);
            if (!complaint || told.has(complaint)) return;
            told.add(complaint);
            console.error(`page: ${complaint}`);
        });
        await this.#call("Page.enable");
        await this.#call("Runtime.enable");
        this.#timer = setInterval(() => this.#read(), PACE);
    }

    #read() {
        this.#readings.push([Date.now(), cpu(this.#process.pid)]);
    }

    async go(url) {
        this.#read();
        await this.#call("Page.navigate", { url });
    }

    async value(expression) {
        const { result, exceptionDetails } = await this.#call("Runtime.evaluate", { expression, returnByValue: true, awaitPromise: true });
        if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
        return result.value;
    }

    // Waits until an expression is true; false after a limit in seconds.
    async until(expression, limit) {
        for (const begun = Date.now(); !await this.value(`Boolean(${expression})`);) {
            if (Date.now() - begun > 1000 * limit) return false;
            await new Promise(act => setTimeout(act, 50));
        }
        return true;
    }

    // Milliseconds since the epoch at which the page was navigated to.
    origin() {
        return this.value("performance.timeOrigin");
    }

    // CPU seconds from one time to another, in milliseconds since the epoch.
    cpuBetween(from, to) {
        this.#read();
        return this.#cpuAt(to) - this.#cpuAt(from);
    }

    #cpuAt(time) {
        const readings = this.#readings, after = readings.findIndex(([at]) => at >= time);
        if (after <= 0) return readings.at(after < 0 ? -1 : 0)[1];
        const [[from, low], [to, high]] = readings.slice(after - 1, after + 1);
        return low + (high - low) * (time - from) / (to - from);
    }

    // The floats of an array of the page.
    async floats(expression) {
        const text = await this.value(`(() => {
            const bytes = new Uint8Array((${expression}).slice().buffer), parts = [];
            for (let at = 0; at < bytes.length; at += 8192) parts.push(String.fromCharCode(...bytes.subarray(at, at + 8192)));
            return btoa(parts.join(""));
        })()`);
        const bytes = Buffer.from(text, "base64");
        return new Float32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
    }

    async screenshot() {
        return Buffer.from((await this.#call("Page.captureScreenshot", { format: "png" })).data, "base64");
    }

    async close() {
        clearInterval(this.#timer);
        this.#process.kill();
        await new Promise(act => this.#process.once("exit", act));
        await removed(this.#profile);
    }
}
