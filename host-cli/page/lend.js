// The page that lends cards to `photoncard view --browser-cards`: each is a worker behind a WebSocket of its own.

// Milliseconds before a lost connection is opened again; twice as many each time.
const FIRST_WAIT = 500;
const MAX_WAIT = 16000;
// Milliseconds for which a connection lasts that is not taken for a failing one.
const SOUND = 30000;
// Milliseconds between two looks at the bytes that were sent.
const LOOK = 500;

const byId = id => document.getElementById(id);
const address = `${location.protocol.replace("http", "ws")}//${location.host}/card${location.search}`;

class LentCard {
    #module;
    #socket = null;
    #worker = null;
    #chip = "";
    #timer = 0;
    #wait = FIRST_WAIT;
    #isEnded = false;
    // Bytes sent to the host.
    sent = 0;

    constructor(module) {
        this.#module = module;
        this.#open();
    }

    #open() {
        const socket = new WebSocket(address), opened = performance.now();
        socket.binaryType = "arraybuffer";
        this.#socket = socket;
        socket.onmessage = ({ data }) => {
            if (typeof data === "string") this.#serve(data);
            else this.#worker?.postMessage(data, [data]);
        };
        socket.onclose = () => {
            if (this.#isEnded) return;
            if (performance.now() - opened > SOUND) this.#wait = FIRST_WAIT;
            this.#timer = setTimeout(() => this.#open(), this.#wait);
            this.#wait = Math.min(2 * this.#wait, MAX_WAIT);
        };
    }

    // Serves the next host. The card's memory stays, so that a host need not send the same scene again.
    #serve(chip) {
        if (this.#worker && chip === this.#chip) return;
        this.#worker?.terminate();
        const worker = new Worker(new URL("./chip.js", import.meta.url), { type: "module" });
        [this.#worker, this.#chip] = [worker, chip];
        worker.onmessage = ({ data }) => {
            if (worker !== this.#worker || !(data instanceof ArrayBuffer) || !this.isOpen) return;
            this.sent += data.byteLength;
            this.#socket.send(data);
        };
        worker.onerror = event => {
            event.preventDefault();
            if (worker === this.#worker) this.#fail(event.message ?? "its worker cannot start");
        };
        worker.postMessage({ module: this.#module, chip });
    }

    // The host takes a card whose connection has ended for lost.
    #fail(reason) {
        tell(`A card has stopped, and is started again: ${reason}`);
        this.#worker.terminate();
        this.#worker = null;
        this.#socket.close();
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

const tell = fault => byId("fault").textContent = fault;

const cards = [];
let module = null, before = 0, ended = 0;

function lend(count) {
    for (const card of cards.splice(count)) {
        ended += card.sent;
        card.end();
    }
    while (cards.length < count) cards.push(new LentCard(module));
    show();
}

function show() {
    const open = cards.filter(card => card.isOpen).length;
    const sent = cards.reduce((sum, card) => sum + card.sent, ended);
    // What has stopped works again.
    if (sent > before && open === cards.length) tell("");
    const works = sent > before ? "they work" : "they wait";
    before = sent;
    byId("state").textContent = !module ? "The card's program is being loaded." : cards.length === 0 ? "No card is lent."
        : open === 0 ? "The render has no room for a card, or has ended: it is asked again."
            : `${open} ${open === 1 ? "card is" : "cards are"} lent: ${works}; ${(sent / 1e6).toFixed(1)} MB sent.`;
}

async function begin(wait) {
    try {
        module = await WebAssembly.compileStreaming(fetch("photoncard.wasm"));
    } catch (error) {
        tell(`The card's program cannot be loaded, and is asked for again: ${error.message}`);
        setTimeout(begin, wait, Math.min(2 * wait, MAX_WAIT));
        return;
    }
    tell("");
    lend(Number(byId("count").value));
}

const count = byId("count");
count.value = Math.min(navigator.hardwareConcurrency || 1, count.max);
count.addEventListener("change", () => {
    count.value = Math.max(0, Math.min(Math.floor(count.value) || 0, count.max));
    if (module) lend(Number(count.value));
});
show();
begin(FIRST_WAIT);
setInterval(show, LOOK);
