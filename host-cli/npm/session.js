// A view that ends with its settled picture.

import { LocalHost } from "./local.js";
import { Picture } from "./picture.js";
import { decoded, fileOf } from "./tiles.js";

// Milliseconds between two calls of `progress`.
const PACE = 100;

export class Session {
    notices = [];
    #picture = new Picture();
    #state = null;
    // Samples a pixel of the last whole pass.
    #samples = 0;
    #files = new Map();
    #toldAt = -Infinity;
    #end;
    #ended = new Promise((_, reject) => this.#end = reject);
    // Looks whether that has come which is waited for.
    #look = () => { };
    #host = new LocalHost({
        message: message => this.#take(message),
        tile: buffer => this.#takeBytes(buffer),
        changed() { },
        failed: reason => this.end(new Error(reason)),
        said: line => this.notices.push(line),
    });

    constructor(progress) {
        this.progress = progress;
        // Whoever waits has the reason; without anybody it is none of the page's errors.
        this.#ended.catch(() => { });
    }

    open(files, words) {
        this.#host.open(files, words);
    }

    // Ends whatever waits by a reason.
    end(reason) {
        this.#end(reason);
        this.close();
    }

    // Ends the host with its cards.
    close() {
        this.#host.close();
    }

    // The state with which the whole picture has come, after the message of a number.
    settled(id = 0) {
        return this.#until(() => this.#state?.settled && this.#state.id >= id ? this.#state : undefined);
    }

    // Values of a layer: three for each pixel.
    async layer(name) {
        this.#picture.restart(this.#picture.version);
        await this.settled(this.#host.send({ type: "layer", name }));
        return this.pixels;
    }

    // Bytes of a file of the picture.
    saved(fields) {
        this.#host.send({ type: "save", download: true, ...fields });
        return this.#until(() => this.#files.get(fields.name));
    }

    // Three values for each pixel, row by row from the top.
    get pixels() {
        const { data } = this.#picture;
        const pixels = new Float32Array(data.length / 4 * 3);
        for (let from = 0, to = 0; from < data.length; from += 4, to += 3) {
            pixels[to] = data[from];
            pixels[to + 1] = data[from + 1];
            pixels[to + 2] = data[from + 2];
        }
        return pixels;
    }

    // The first value of `find()` other than undefined.
    #until(find) {
        const found = new Promise(resolve => {
            this.#look = () => {
                const value = find();
                if (value !== undefined) resolve(value);
            };
            this.#look();
        });
        return Promise.race([this.#ended, found]);
    }

    #take(message) {
        if (message.type === "error") return this.end(new Error(message.text));
        if (message.type !== "state") return;
        this.#state = message;
        this.#picture.resize(message.size);
        this.#look();
    }

    #takeBytes(buffer) {
        const file = fileOf(buffer);
        if (file) {
            this.#files.set(file.name, file.bytes);
            return this.#look();
        }
        const tile = decoded(buffer);
        if (tile && this.#picture.put(tile) && !this.#state.settled) this.#tell();
    }

    // Tells whoever renders how far the picture has come.
    #tell() {
        const { isWhole, step, samples, filled, size: [width, height] } = this.#picture;
        const now = performance.now();
        const isDue = this.progress && (isWhole || now >= this.#toldAt + PACE);
        const part = Math.min(filled / (width * height), 1);
        const reached = step > 1 ? 0 : this.#samples + part * (samples - this.#samples);
        if (isWhole && step === 1) this.#samples = samples;
        if (!isDue) return;
        this.#toldAt = now;
        const session = this;
        try {
            this.progress({ samples: reached, of: this.#state.spp, width, height, get pixels() { return session.pixels; } });
        } catch (error) {
            this.end(error);
        }
    }
}
