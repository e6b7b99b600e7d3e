// The environment map: its turn, and another one that is dropped on the page or chosen from a file.

import { setText } from "./status.js";

// Whether a file is an environment map, by its name.
export const isMap = ({ name }) => /\.(hdr|exr)$/i.test(name);

const byId = id => document.getElementById(id);
// Bytes of a message; the command takes up to 64 KiB.
const SHARE = 32768;
// Milliseconds until a busy connection is asked again.
const PAUSE = 20;

export class Surroundings {
    // The file that is on its way, and the number of the message that has announced it.
    #file = null;
    #announced = 0;
    #map = null;

    // `send(message)` and `upload(bytes)` go to the command, `isBusy()` tells whether it lags behind;
    // `told(text)` is shown. `takes(files)` tells whether files that are dropped are meant for the scene that
    // is shown.
    constructor({ send, upload, isBusy, told, takes }) {
        Object.assign(this, { send, upload, isBusy, told, takes });
        const stage = byId("stage");
        const turn = byId("rotation");
        turn.addEventListener("input", () => setText("degrees", `${turn.value}°`));
        turn.addEventListener("change", () => send({ type: "turn", degrees: Number(turn.value) }));
        byId("map").addEventListener("change", ({ target }) => {
            this.#take(target.files);
            target.value = "";
        });
        // Beside the picture too: the browser would leave the page for a file that is dropped there.
        addEventListener("dragover", event => {
            event.preventDefault();
            stage.classList.add("target");
        });
        for (const type of ["dragleave", "drop"]) addEventListener(type, () => stage.classList.remove("target"));
        addEventListener("drop", event => {
            event.preventDefault();
            const files = [...event.dataTransfer.files];
            if (this.takes(files) && !byId("map").closest("[inert]")) this.#take(files);
        });
    }

    // Shows the map of a scene: {name, rotation, dropped}, or null.
    show(map) {
        this.#map = map;
        byId("rotation").disabled = map === null;
        byId("rotation").value = map?.rotation ?? 0;
        setText("degrees", `${map?.rotation ?? 0}°`);
        setText("map-name", !map ? "No map: drop a file .hdr or .exr on the picture."
            : map.dropped ? `${map.name}, dropped: for the command line, put the file into its folder.` : map.name);
    }

    #take(files) {
        const file = [...files ?? []].find(isMap);
        if (!file) return this.told("An environment map is a file .hdr or .exr.");
        if (this.#file) return this.told("Another map is still on its way.");
        this.#announced = this.send({ type: "drop", name: file.name, bytes: file.size });
        if (this.#announced > 0) this.#file = file;
    }

    // Something was refused: perhaps the message of this number that has announced a file, or the file
    // itself.
    refused(id) {
        if (id === this.#announced) this.#file = null;
        if (!this.#file) this.show(this.#map);
    }

    // The command takes the file that was announced.
    async begin() {
        const file = this.#file;
        if (!file) return;
        setText("map-name", `Sending ${file.name}.`);
        const bytes = await file.arrayBuffer();
        for (let at = 0; at < bytes.byteLength; at += SHARE) {
            while (this.isBusy()) await new Promise(act => setTimeout(act, PAUSE));
            if (this.upload(bytes.slice(at, at + SHARE))) continue;
            this.told("The connection was lost: drop the map again.");
            break;
        }
        this.#file = null;
    }
}
