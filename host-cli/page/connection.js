// The WebSocket to the command: opened again when it is lost, and acknowledged as tiles come.

const FIRST_WAIT = 250;
const MAX_WAIT = 4000;
// Bytes that may wait to be sent before a camera or a part of a file is left for later.
const MAX_WAITING = 16384;
// Bytes of tiles after which they are acknowledged: a fourth of those that may be on the way.
const SHARE = 1 << 20;

export class Connection {
    #socket = null;
    #wait = FIRST_WAIT;
    #received = 0;
    #acknowledged = 0;
    #id = 0;

    // `handlers` has `message(object)`, `tile(buffer)`, which takes files too, and `changed(isOpen)`.
    constructor(address, handlers) {
        Object.assign(this, { address, handlers });
        this.#open();
    }

    #open() {
        const socket = new WebSocket(this.address);
        socket.binaryType = "arraybuffer";
        this.#socket = socket;
        this.#received = this.#acknowledged = 0;
        socket.onopen = () => this.handlers.changed(true);
        socket.onmessage = ({ data }) => this.#take(data);
        socket.onclose = () => {
            this.handlers.changed(false);
            setTimeout(() => this.#open(), this.#wait);
            this.#wait = Math.min(2 * this.#wait, MAX_WAIT);
        };
    }

    #take(data) {
        this.#wait = FIRST_WAIT;
        if (typeof data === "string") {
            this.handlers.message(JSON.parse(data));
        } else {
            this.#received += data.byteLength;
            this.handlers.tile(data);
            this.#acknowledge();
        }
    }

    get isOpen() {
        return this.#socket.readyState === WebSocket.OPEN;
    }

    get isBusy() {
        return this.#socket.bufferedAmount > MAX_WAITING;
    }

    // Sends a message. Returns its number, by which `state` tells what it holds; 0 if there is no connection.
    send(message) {
        if (!this.isOpen) return 0;
        this.#socket.send(JSON.stringify({ ...message, id: ++this.#id }));
        return this.#id;
    }

    // Sends bytes of a file that was announced. Returns whether there is a connection.
    upload(bytes) {
        if (this.isOpen) this.#socket.send(bytes);
        return this.isOpen;
    }

    // Whoever takes tiles in slowly gets fewer; drawings do not hold them up.
    #acknowledge() {
        if (this.#received < this.#acknowledged + SHARE) return;
        this.#acknowledged = this.#received;
        this.send({ type: "shown", bytes: this.#received });
    }

    // Closes the socket, as a lost connection would.
    drop() {
        this.#socket.close();
    }
}
