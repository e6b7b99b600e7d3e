// The worker that is the host: it holds the scene, traces photons, and deals tiles to the workers that are cards.
//
// From the page: {open: {files, arguments}}, {pause: boolean}, a text (a message of the view), bytes (a part of a file). To the page: a text, bytes
// (a tile or a file), {lock: name}, {opened}, {failed: reason}, {said: line}.

import { Instance, awaitEnd, holdLock } from "./instance.js";
import { soonCaller } from "./soon.js";

// Milliseconds until a host that waits looks at its clocks.
const LOOK = 20;

const compiled = WebAssembly.compileStreaming(fetch(new URL("./photoncard.wasm", import.meta.url)));
const cards = new Map();
// The last line that the module has printed: before it ends, it says why.
let line = "";
let host = null, isOpen = false, isPaused = false, timer = 0;
// Where texts of the module go: before the view is open, the reason why it cannot be.
let told = () => { };

const soon = soonCaller(turn);

// Renders until the view waits; a fault of the module ends the view, and not the page.
function turn() {
    clearTimeout(timer);
    if (!isOpen || isPaused) return;
    try {
        if (host.exports.go_on() === 1) soon();
        else timer = setTimeout(turn, LOOK);
    } catch (error) {
        stop(error);
    }
}

// A fault of the module. Its own words say more than the browser's, such as that memory is short.
function stop(error) {
    const isTrap = error instanceof WebAssembly.RuntimeError && line;
    fail(`the renderer has stopped: ${isTrap ? line : error.message}`);
}

function fail(reason) {
    isOpen = false;
    for (const worker of cards.values()) worker.terminate();
    cards.clear();
    host = null;
    postMessage({ failed: reason });
}

function lose(index, worker, reason) {
    if (cards.get(index) !== worker || !host) return;
    worker.terminate();
    cards.delete(index);
    postMessage({ said: `card ${index + 1} has stopped: ${reason}` });
    host.exports.lose_card(index);
    soon();
}

const functions = {
    start_card(instance, index, at, length) {
        const worker = new Worker(new URL("./chip.js", import.meta.url), { type: "module" });
        cards.get(index)?.terminate();
        cards.set(index, worker);
        worker.onmessage = ({ data }) => {
            if (cards.get(index) !== worker || !host) return;
            if (data.lock) return awaitEnd(data.lock, () => lose(index, worker, "its worker was ended"));
            host.give(data);
            host.exports.receive_from_card(index);
            soon();
        };
        worker.onerror = event => {
            event.preventDefault();
            lose(index, worker, event.message ?? "its worker cannot start");
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
    let reason = "the scene cannot be shown";
    told = text => reason = text;
    host = await Instance.of(await compiled, files, functions, said => {
        line = said;
        postMessage({ said });
    });
    host.giveText(JSON.stringify(words));
    if (host.exports.open_view() !== 0) return fail(reason);
    told = text => postMessage(text);
    isOpen = true;
    postMessage({ opened: true });
    soon();
}

onmessage = ({ data }) => {
    if (data?.open) {
        open(data.open).catch(stop);
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
            stop(error);
        }
    }
};

holdLock(lock => postMessage({ lock }));
