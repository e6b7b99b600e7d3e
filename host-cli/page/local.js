// The link to a host in a worker of this page.

import { Link } from "./link.js";

// Its handlers have also `failed(reason)` and `said(line)`.
export class LocalHost extends Link {
    #worker = null;
    #isOpen = false;

    // Opens the view of a scene: its files, a map from paths to bytes, and the arguments of `photoncard view`.
    open(files, words) {
        this.close();
        this.restart();
        this.#worker = new Worker(new URL("./host.js", import.meta.url), { type: "module" });
        this.#worker.onmessage = ({ data }) => this.#hear(data);
        this.#worker.onerror = event => this.#fail(`the renderer cannot start: ${event.message ?? "its worker has no answer"}`);
        this.#worker.postMessage({ open: { files, arguments: words } });
    }

    #hear(data) {
        if (typeof data === "string" || data instanceof ArrayBuffer) return this.take(data);
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
