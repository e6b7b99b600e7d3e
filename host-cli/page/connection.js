// The WebSocket to the command: opened again when it is lost.

import { Link } from "./link.js";

const FIRST_WAIT = 250;
const MAX_WAIT = 4000;
// Bytes that may wait to be sent before a camera or a part of a file is left for later.
const MAX_WAITING = 16384;

export class Connection extends Link {
    #socket = null;
    #wait = FIRST_WAIT;

    constructor(address, handlers) {
        super(handlers);
        this.address = address;
        this.#open();
    }

    #open() {
        const socket = new WebSocket(this.address);
        socket.binaryType = "arraybuffer";
        this.#socket = socket;
        this.restart();
        socket.onopen = () => this.handlers.changed(true);
        socket.onmessage = ({ data }) => {
            this.#wait = FIRST_WAIT;
            this.take(data);
        };
        socket.onclose = () => {
            this.handlers.changed(false);
            setTimeout(() => this.#open(), this.#wait);
            this.#wait = Math.min(2 * this.#wait, MAX_WAIT);
        };
    }

    get isOpen() {
        return this.#socket.readyState === WebSocket.OPEN;
    }

    get isBusy() {
        return this.#socket.bufferedAmount > MAX_WAITING;
    }

    post(data) {
        this.#socket.send(data);
    }

    // Closes the socket, as a lost connection would.
    drop() {
        this.#socket.close();
    }
}
