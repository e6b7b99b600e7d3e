// The beginning of a page that has its own host: scenes to choose, and files that are dropped.

import { isMap } from "./environment.js";
import { element } from "./fields.js";
import { viewOf } from "./words.js";
import { unzipped } from "./zip.js";

const byId = id => document.getElementById(id);
// Bytes of files in all: they, the scene and the photons are in one memory of 4 GiB.
const MOST = 1 << 30;
const GIGABYTE = 1e9, MEGABYTE = 1e6;

const sized = bytes => bytes >= GIGABYTE ? `${(bytes / GIGABYTE).toFixed(1)} GB` : `${(bytes / MEGABYTE).toFixed(1)} MB`;
const isScene = name => /\.(glb|gltf)$/i.test(name);

export class Start {
    #shipped = [];
    // The command of a link whose file is not shipped.
    #linked = null;

    // `open(files, words)` begins a view.
    constructor(open) {
        this.open = open;
        byId("start-files").addEventListener("change", ({ target }) => this.take([...target.files].map(file => [file.webkitRelativePath || file.name, file])));
        document.addEventListener("dragover", event => event.preventDefault());
        document.addEventListener("drop", event => this.#drop(event));
        window.addEventListener("hashchange", () => this.#follow());
        byId("other-scene").addEventListener("click", () => this.show(""));
        this.#list();
    }

    show(reason) {
        byId("start").hidden = false;
        byId("start-reason").textContent = reason;
    }

    // Takes files: pairs of a path and a file.
    async take(pairs) {
        try {
            let files = new Map();
            const total = pairs.reduce((sum, [, file]) => sum + file.size, 0);
            if (total > MOST) throw new Error(`these files have ${sized(total)}, and a page has room for ${sized(MOST)}`);
            for (const [path, file] of pairs) files.set(path, new Uint8Array(await file.arrayBuffer()));
            const [only] = pairs;
            if (pairs.length === 1 && /\.zip$/i.test(only[0])) {
                files = await unzipped(files.get(only[0]), MOST).catch(error => { throw new Error(`${only[0]}: ${error.message}`); });
            }
            this.#begin(files);
        } catch (error) {
            this.show(error.message);
        }
    }

    #begin(files) {
        const scenes = [...files.keys()].filter(isScene).sort((a, b) => a.split("/").length - b.split("/").length || (a < b ? -1 : 1));
        const linked = scenes.find(name => name === this.#linked?.scene);
        const scene = linked ?? scenes[0];
        if (!scene) throw new Error("none of these files is a scene: a scene is a file .glb or .gltf, with the files that it names");
        this.#run(files, scene, linked ? this.#linked.options : []);
    }

    #run(files, scene, options) {
        byId("start").hidden = true;
        const bytes = [...files.values()].reduce((sum, file) => sum + file.length, 0);
        this.open(files, [scene, ...options], `${scene}, ${sized(bytes)}`);
    }

    async #list() {
        try {
            this.#shipped = await (await fetch("scenes.json")).json();
        } catch {
            this.show("the list of scenes is missing: drop a scene of your own");
        }
        byId("start-scenes").replaceChildren(...this.#shipped.map(({ file, title }) => {
            const button = element("button", { type: "button", textContent: title });
            button.addEventListener("click", () => this.#fetch(file, []));
            return button;
        }));
        this.#follow();
    }

    // Opens what the page's address states.
    #follow() {
        const stated = location.hash.length > 1 && viewOf(decodeURIComponent(location.hash.slice(1)));
        if (!stated) return;
        if (this.#shipped.some(({ file }) => file === stated.scene)) return this.#fetch(stated.scene, stated.options);
        this.#linked = stated;
        this.show(`This link is of ${stated.scene}, which stays with who has it: drop the file here.`);
    }

    async #fetch(file, options) {
        try {
            const answer = await fetch(file);
            if (!answer.ok) throw new Error(`${file} is missing on this server`);
            this.#run(new Map([[file, new Uint8Array(await answer.arrayBuffer())]]), file, options);
        } catch (error) {
            this.show(error.message);
        }
    }

    async #drop(event) {
        event.preventDefault();
        const entries = [...event.dataTransfer.items].map(item => item.webkitGetAsEntry?.()).filter(entry => entry);
        const files = [...event.dataTransfer.files];
        // Maps are for the scene that is shown.
        if (byId("start").hidden && files.every(isMap)) return;
        const pairs = entries.length > 0 ? (await Promise.all(entries.map(entry => filesOf(entry, "")))).flat() : files.map(file => [file.name, file]);
        this.take(pairs);
    }
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
