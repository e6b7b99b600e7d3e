// The beginning of a page that has its own host: scenes to choose, and files that are dropped.

import { isMap } from "./environment.js";
import { element } from "./fields.js";
import { viewOf } from "./words.js";
import { plain } from "./wasi.js";
import { unzipped } from "./zip.js";

const byId = id => document.getElementById(id);
const GIGABYTE = 1e9, MEGABYTE = 1e6;
// Bytes of files in all: they, the scene and the photons are in one memory of 4 GiB.
const MOST = 1 << 30;
// Memory that a scene takes for each byte of its files, in the host and in each card, as measured of 1 and 10 million triangles without images: packing
// takes most.
const OF_HOST = 28, OF_CARD = 6;
// What the host can have; and the share of the device's memory beyond which a scene is not opened without a question, with what is taken for that memory
// where a browser does not tell it.
const HOST_MEMORY = 2 ** 32, SHARE = 0.5, UNKNOWN_MEMORY = 4;

const sized = bytes => bytes >= GIGABYTE ? `${(bytes / GIGABYTE).toFixed(1)} GB` : `${(bytes / MEGABYTE).toFixed(1)} MB`;
// Archives of macOS have a second file `._NAME` beside each one.
const isScene = name => /(^|\/)[^./][^/]*\.(glb|gltf)$/i.test(name);
// Names may have signs that have a meaning in an address.
const addressOf = file => file.split("/").map(encodeURIComponent).join("/");

export class Start {
    #shipped = [];
    // The command of a link that needs files of the visitor.
    #linked = null;
    // Number of the last scene that was asked for: one that comes later than the next is not opened.
    #asked = 0;
    // Opens a scene that has been held back for its size.
    #anyway = null;

    // `open(files, words)` begins a view on `cards` cards; `hasView()` tells whether one goes on.
    constructor({ open, hasView, cards }) {
        Object.assign(this, { open, hasView, cards });
        byId("start-files").addEventListener("change", ({ target }) => {
            if (target.files.length > 0) this.take([...target.files].map(file => [file.name, file]));
            // The same file may be chosen again.
            target.value = "";
        });
        document.addEventListener("dragover", event => event.preventDefault());
        document.addEventListener("drop", event => this.#drop(event));
        window.addEventListener("hashchange", () => this.#follow());
        byId("other-scene").addEventListener("click", () => this.show(""));
        byId("start-back").addEventListener("click", () => this.#hide());
        byId("start-anyway").addEventListener("click", () => this.#anyway?.());
        byId("start").addEventListener("keydown", ({ key }) => key === "Escape" && this.hasView() && this.#hide());
        byId("start-memory").textContent = this.#memory;
        this.#list();
    }

    show(reason) {
        byId("start").hidden = false;
        document.body.classList.add("choosing");
        byId("start-reason").textContent = reason;
        byId("start-back").hidden = !this.hasView();
        byId("start-anyway").hidden = true;
        this.#anyway = null;
        byId("start").focus();
    }

    #hide() {
        // A scene that is still on its way is no longer wanted.
        this.#asked++;
        byId("start").hidden = true;
        document.body.classList.remove("choosing");
        byId("picture").focus();
    }

    get #memory() {
        const workers = this.cards === 1 ? "1 card, which is a worker" : `${this.cards} cards, which are workers`;
        const { deviceMemory } = navigator;
        const device = deviceMemory ? `; this device has ${deviceMemory} GB or more` : "";
        return `This browser has ${workers}. A scene of 20 MB, all of it triangles, takes about ${sized(this.#needed(20 * MEGABYTE))} of memory${device}. Files may have ${sized(MOST)} in all.`;
    }

    #needed(bytes) {
        return bytes * (OF_HOST + OF_CARD * this.cards);
    }

    // Takes files: pairs of a path and a file.
    async take(pairs) {
        await this.#open(async () => {
            const total = pairs.reduce((sum, [, file]) => sum + file.size, 0);
            if (total > MOST) throw new Error(`These files have ${sized(total)}, and a page has room for ${sized(MOST)}.`);
            const [[path, file]] = pairs;
            if (pairs.length === 1 && /\.zip$/i.test(path)) {
                return unzipped(await bytesOf(path, file), MOST).catch(error => { throw new Error(`${path}: ${error.message}.`); });
            }
            // Other files may be larger than what a scene would need.
            this.#check(pairs.map(([path]) => path));
            const files = new Map();
            for (const [path, file] of pairs) files.set(path, await bytesOf(path, file));
            return files;
        }, this.#linked);
    }

    #check(names) {
        if (names.some(isScene) || this.#linked?.isShipped) return;
        throw new Error(names.every(name => isMap({ name })) ? "An environment map needs a scene: open the scene first."
            : "None of these files is a scene: a scene is a file .glb or .gltf, with the files that it names.");
    }

    // Opens the scene among the files that a function gives, unless another one is asked for in the meantime. `view` has its options.
    async #open(read, view) {
        const asked = ++this.#asked;
        byId("start-reason").textContent = "Reading the files.";
        try {
            const files = new Map([...await read()].map(([path, bytes]) => [plain(path), bytes]));
            this.#check([...files.keys()]);
            if (view?.isShipped && ![...files.keys()].some(isScene)) files.set(view.scene, await this.#fetched(view.scene));
            if (asked === this.#asked) this.#begin(files, view);
        } catch (error) {
            if (asked === this.#asked) this.show(error.message);
        }
    }

    #begin(files, view) {
        const scenes = [...files.keys()].filter(isScene).sort((a, b) => a.split("/").length - b.split("/").length || (a < b ? -1 : 1));
        const linked = view && (scenes.find(name => name === plain(view.scene)) ?? scenes.find(name => lastOf(name) === lastOf(view.scene)));
        // The map of a link stands where the link's command has it.
        const map = linked && view.map && [...files.keys()].find(name => lastOf(name) === lastOf(view.map));
        if (map) files.set(plain(view.map), files.get(map));
        this.#run(files, linked ?? scenes[0], linked ? view : null);
    }

    #run(files, scene, view) {
        const bytes = [...files.values()].reduce((sum, file) => sum + file.length, 0);
        const needed = this.#needed(bytes);
        const begin = () => {
            this.#linked = null;
            this.#hide();
            // The parser of options would take a leading dash for one.
            this.open(files, [scene.startsWith("-") ? `./${scene}` : scene, ...view?.options ?? []], view);
        };
        const isLarge = needed > SHARE * GIGABYTE * (navigator.deviceMemory ?? UNKNOWN_MEMORY) || bytes * OF_HOST > HOST_MEMORY;
        if (!isLarge) return begin();
        this.show(`${scene}: the files have ${sized(bytes)}. If most of it is triangles, it takes about ${sized(needed)} of memory: it may be refused, or the browser may end this page.`);
        byId("start-anyway").hidden = false;
        this.#anyway = begin;
    }

    async #list() {
        try {
            this.#shipped = await (await fetch("scenes.json")).json();
        } catch {
            this.show("The list of scenes is missing: drop a scene of your own.");
        }
        byId("start-scenes").replaceChildren(...this.#shipped.map(({ file, title }) => {
            const button = element("button", { type: "button", textContent: title });
            button.addEventListener("click", () => this.#fetch(file, null));
            return button;
        }));
        this.#follow();
    }

    // Opens what the page's address states.
    #follow() {
        if (location.hash.length <= 1) return;
        const stated = linkOf(location.hash);
        if (!stated) return this.show("The address of this page is damaged: choose a scene.");
        stated.isShipped = this.#shipped.some(({ file }) => file === stated.scene);
        if (stated.isShipped && !stated.map) return this.#fetch(stated.scene, stated);
        this.#linked = stated;
        const needed = [stated.isShipped ? null : stated.scene, stated.map].filter(name => name);
        this.show(`This link is of ${needed.join(" and ")}, which ${needed.length > 1 ? "stay" : "stays"} with who has made it: drop ${needed.length > 1 ? "both files" : "the file"} here.`);
    }

    #fetch(file, view) {
        return this.#open(async () => new Map([[file, await this.#fetched(file)]]), view);
    }

    async #fetched(file) {
        const answer = await fetch(addressOf(file)).catch(() => null);
        if (!answer?.ok) throw new Error(`${file} is missing on this server.`);
        return new Uint8Array(await answer.arrayBuffer());
    }

    async #drop(event) {
        event.preventDefault();
        const entries = [...event.dataTransfer.items].map(item => item.webkitGetAsEntry?.()).filter(entry => entry);
        const files = [...event.dataTransfer.files];
        // A text may be dropped too; and maps are for the scene that is shown.
        if (files.length === 0 || byId("start").hidden && files.every(isMap)) return;
        try {
            const pairs = entries.length > 0 ? (await Promise.all(entries.map(entry => filesOf(entry, "")))).flat() : files.map(file => [file.name, file]);
            if (pairs.length === 0) throw new Error("This folder is empty.");
            await this.take(pairs);
        } catch (error) {
            this.show(error.message);
        }
    }
}

const lastOf = path => plain(path).split("/").at(-1);

// What an address links to, with the map that its command names; null if it is damaged.
function linkOf(hash) {
    try {
        const stated = viewOf(decodeURIComponent(hash.slice(1)));
        const at = stated.options.indexOf("--environment");
        return { ...stated, map: at >= 0 && isMap({ name: stated.options[at + 1] ?? "" }) ? stated.options[at + 1] : null };
    } catch {
        return null;
    }
}

async function bytesOf(path, file) {
    return new Uint8Array(await file.arrayBuffer().catch(() => { throw new Error(`${path} cannot be read: the browser has no access to it, or memory is short.`); }));
}

// The files in a dropped file or folder: pairs of a path and a file.
async function filesOf(entry, folder) {
    const path = folder + entry.name;
    if (entry.isFile) return [[path, await new Promise((take, refuse) => entry.file(take, refuse))]];
    const reader = entry.createReader(), found = [];
    for (;;) {
        const some = await new Promise((take, refuse) => reader.readEntries(take, refuse));
        if (some.length === 0) break;
        found.push(...some);
    }
    return (await Promise.all(found.map(each => filesOf(each, `${path}/`)))).flat();
}
