// What links to a host have in common: numbered messages, and acknowledgement of tiles as they come.

// Bytes of tiles after which they are acknowledged: a fourth of those that may be on the way.
const SHARE = 1 << 20;

export class Link {
    #received = 0;
    #acknowledged = 0;
    #id = 0;

    // `handlers` has `message(object)`, `tile(buffer)`, which takes files too, and `changed(isOpen)`. A link has `isOpen`, `isBusy`, `post(data)`
    // and `drop()`.
    constructor(handlers) {
        this.handlers = handlers;
    }

    // Begins to count anew, as the host does.
    restart() {
        this.#received = this.#acknowledged = 0;
    }

    take(data) {
        if (typeof data === "string") {
            this.handlers.message(JSON.parse(data));
        } else {
            this.#received += data.byteLength;
            this.handlers.tile(data);
            this.#acknowledge();
        }
    }

    // Sends a message. Returns its number, by which `state` tells what it holds; 0 if there is no connection.
    send(message) {
        if (!this.isOpen) return 0;
        this.post(JSON.stringify({ ...message, id: ++this.#id }));
        return this.#id;
    }

    // Sends bytes of a file that was announced. Returns whether there is a connection.
    upload(bytes) {
        if (this.isOpen) this.post(bytes);
        return this.isOpen;
    }

    // Whoever takes tiles in slowly gets fewer; drawings do not hold them up.
    #acknowledge() {
        if (this.#received < this.#acknowledged + SHARE) return;
        this.#acknowledged = this.#received;
        this.send({ type: "shown", bytes: this.#received });
    }
}
