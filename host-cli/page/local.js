// The link to a host in a worker of this page.

import { awaitEnd } from "./instance.js";
import { Link } from "./link.js";

// Its handlers have also `failed(reason)` and `said(line)`.
export class LocalHost extends Link {
    #worker = null;
    #isOpen = false;

    // Opens the view of a scene: its files, a map from paths to bytes, and the arguments of `photoncard view`. The files can be large: they move
    // to the host, and are not copied.
    open(files, words) {
        this.close();
        this.restart();
        const worker = new Worker(new URL("./host.js", import.meta.url), { type: "module" });
        this.#worker = worker;
        worker.onmessage = ({ data }) => worker === this.#worker && this.#hear(data, worker);
        worker.onerror = event => worker === this.#worker && this.#fail(`the renderer has stopped: ${event.message ?? "its worker cannot start"}`);
        worker.postMessage({ open: { files, arguments: words } }, [...files.values()].map(bytes => bytes.buffer));
    }

    #hear(data, worker) {
        if (typeof data === "string" || data instanceof ArrayBuffer) return this.take(data);
        if (data.lock) awaitEnd(data.lock, () => worker === this.#worker && this.#fail("the renderer has stopped: its worker was ended, perhaps as memory is short"));
        if (data.said) this.handlers.said(data.said);
        if (data.failed) this.#fail(data.failed);
        if (data.opened) {
            this.#isOpen = true;
            this.handlers.changed(true);
        }
    }

    #fail(reason) {
        this.close();
        this.handlers.failed(reason);
    }

    // Pauses the host, or lets it go on.
    pause(isPaused) {
        this.#worker?.postMessage({ pause: isPaused });
    }

    // Ends the host with its cards.
    close() {
        this.#worker?.terminate();
        this.#worker = null;
        if (this.#isOpen) {
            this.#isOpen = false;
            this.handlers.changed(false);
        }
    }

    get isOpen() {
        return this.#isOpen;
    }

    // Whether there is a view, perhaps one whose scene is still being read.
    get isRunning() {
        return this.#worker !== null;
    }

    get isBusy() {
        return false;
    }

    post(data) {
        this.#worker.postMessage(data);
    }

    // Ends the host, as a fault of it would.
    drop() {
        this.#fail("the renderer was ended");
    }
}
