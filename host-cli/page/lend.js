// The page that lends cards to `photoncard view --browser-cards`: each is a worker behind a WebSocket of its own.

const FIRST_WAIT = 500;
const MAX_WAIT = 8000;
// Milliseconds between two looks at the bytes that were sent.
const LOOK = 500;

const byId = id => document.getElementById(id);
const address = `${location.protocol.replace("http", "ws")}//${location.host}/card${location.search}`;
const compiled = WebAssembly.compileStreaming(fetch("photoncard.wasm"));

class LentCard {
    #socket = null;
    #worker = null;
    #chip = "";
    #timer = 0;
    #wait = FIRST_WAIT;
    #isEnded = false;
    // Bytes sent to the host.
    sent = 0;

    constructor() {
        this.#open();
    }

    #open() {
        const socket = new WebSocket(address);
        socket.binaryType = "arraybuffer";
        this.#socket = socket;
        socket.onmessage = ({ data }) => {
            this.#wait = FIRST_WAIT;
            if (typeof data === "string") this.#serve(data);
            else this.#worker?.postMessage(data, [data]);
        };
        socket.onclose = () => this.#isEnded || this.#retry();
    }

    // Serves the next host. The card's memory stays, so that a host need not send the same scene again.
    #serve(chip) {
        if (this.#worker && chip === this.#chip) return;
        this.#worker?.terminate();
        const worker = new Worker(new URL("./chip.js", import.meta.url), { type: "module" });
        [this.#worker, this.#chip] = [worker, chip];
        worker.onmessage = ({ data }) => {
            if (worker !== this.#worker || !(data instanceof ArrayBuffer) || this.#socket.readyState !== WebSocket.OPEN) return;
            this.sent += data.byteLength;
            this.#socket.send(data);
        };
        worker.onerror = event => {
            event.preventDefault();
            if (worker === this.#worker) this.#fail(event.message ?? "its worker cannot start");
        };
        compiled.then(module => worker.postMessage({ module, chip }), error => this.#fail(error.message));
    }

    // The host takes a card whose connection has ended for lost.
    #fail(reason) {
        byId("fault").textContent = `A card has stopped: ${reason}`;
        this.#worker?.terminate();
        this.#worker = null;
        this.#socket.close();
    }

    #retry() {
        this.#timer = setTimeout(() => this.#open(), this.#wait);
        this.#wait = Math.min(2 * this.#wait, MAX_WAIT);
    }

    get isOpen() {
        return this.#socket.readyState === WebSocket.OPEN;
    }

    end() {
        this.#isEnded = true;
        clearTimeout(this.#timer);
        this.#socket.close();
        this.#worker?.terminate();
        this.#worker = null;
    }
}

const cards = [];
let before = 0, returned = 0;

function lend(count) {
    for (const card of cards.splice(count)) {
        returned += card.sent;
        card.end();
    }
    while (cards.length < count) cards.push(new LentCard());
    show();
}

function show() {
    const open = cards.filter(card => card.isOpen).length;
    const sent = cards.reduce((sum, card) => sum + card.sent, returned);
    const works = sent > before ? "they render" : "they wait";
    before = sent;
    const lent = `${open} ${open === 1 ? "card is" : "cards are"} lent: ${works}; ${(sent / 1e6).toFixed(1)} MB of pixels sent.`;
    byId("state").textContent = cards.length === 0 ? "No card is lent." : open === 0 ? "The render does not answer: it is tried again." : lent;
}

const count = byId("count");
count.value = Math.min(navigator.hardwareConcurrency || 1, count.max);
count.addEventListener("change", () => {
    count.value = Math.max(0, Math.min(Math.floor(count.value) || 0, count.max));
    lend(Number(count.value));
});
lend(Number(count.value));
setInterval(show, LOOK);
