// The worker that is the host: it holds the scene, traces photons, and deals tiles to the workers that are cards.
//
// From the page: {open: {files, arguments}}, {pause: boolean}, a text (a message of the view), bytes (a part of a file). To the page: a text, bytes
// (a tile or a file), {opened}, {failed: reason}, {said: line}.

import { Instance } from "./instance.js";
import { soonCaller } from "./soon.js";

// Milliseconds until a host that waits looks at its clocks.
const LOOK = 20;

const compiled = WebAssembly.compileStreaming(fetch(new URL("./photoncard.wasm", import.meta.url)));
const cards = new Map();
let host = null, isOpen = false, isPaused = false, timer = 0;
// Where texts of the module go: before the view is open, the reason why it cannot be.
let told = () => { };
let queue = Promise.resolve();

const soon = soonCaller(turn);

// Renders until the view waits; a fault of the module ends the view, and not the page.
function turn() {
    clearTimeout(timer);
    if (!isOpen || isPaused) return;
    try {
        if (host.exports.go_on() === 1) soon();
        else timer = setTimeout(turn, LOOK);
    } catch (error) {
        fail(`the renderer has stopped: ${error.message}`);
    }
}

function fail(reason) {
    isOpen = false;
    for (const worker of cards.values()) worker.terminate();
    cards.clear();
    host = null;
    postMessage({ failed: reason });
}

const functions = {
    start_card(instance, index, at, length) {
        const worker = new Worker(new URL("./chip.js", import.meta.url), { type: "module" });
        cards.get(index)?.terminate();
        cards.set(index, worker);
        worker.onmessage = ({ data }) => {
            if (cards.get(index) !== worker || !host) return;
            host.give(data);
            host.exports.receive_from_card(index);
            soon();
        };
        worker.onerror = event => {
            event.preventDefault?.();
            if (cards.get(index) !== worker || !host) return;
            postMessage({ said: `card ${index + 1} has stopped: ${event.message ?? "its worker ended"}` });
            host.exports.lose_card(index);
            soon();
        };
        const chip = instance.text(at, length);
        compiled.then(module => worker.postMessage({ module, chip }));
    },
    send_to_card(instance, index, at, length) {
        const bytes = instance.copied(at, length);
        cards.get(index)?.postMessage(bytes, [bytes]);
    },
    end_card(_, index) {
        cards.get(index)?.terminate();
        cards.delete(index);
    },
    tell_text: (instance, at, length) => told(instance.text(at, length)),
    tell_bytes(instance, at, length) {
        const bytes = instance.copied(at, length);
        postMessage(bytes, [bytes]);
    },
};

async function open({ files, arguments: words }) {
    isOpen = false;
    for (const worker of cards.values()) worker.terminate();
    cards.clear();
    let reason = "the scene cannot be shown";
    told = text => reason = text;
    host = await Instance.of(await compiled, files, functions, line => postMessage({ said: line }));
    host.giveText(JSON.stringify(words));
    if (host.exports.open_view() !== 0) return fail(reason);
    told = text => postMessage(text);
    isOpen = true;
    postMessage({ opened: true });
    soon();
}

onmessage = ({ data }) => {
    if (data?.open) {
        queue = queue.then(() => open(data.open)).catch(error => fail(`the renderer has stopped: ${error.message}`));
    } else if (data?.pause !== undefined) {
        isPaused = data.pause;
        soon();
    } else if (isOpen) {
        try {
            if (typeof data === "string") {
                host.giveText(data);
                host.exports.receive_text();
            } else {
                host.give(data);
                host.exports.receive_bytes();
            }
            soon();
        } catch (error) {
            fail(`the renderer has stopped: ${error.message}`);
        }
    }
};
