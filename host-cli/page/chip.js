// A worker that is a card: the first message has the module and the chip, all others are bytes of the host. It sends bytes, and once {lock: name}.

import { Instance, holdLock } from "./instance.js";
import { soonCaller } from "./soon.js";

let card = null;
// Bytes that came before the card was ready.
let early = [];

const soon = soonCaller(() => serve(new Uint8Array()));

function serve(bytes) {
    card.give(bytes);
    if (card.exports.serve_card() === 1) soon();
}

async function begin({ module, chip }) {
    const send = (instance, at, length) => {
        const bytes = instance.copied(at, length);
        postMessage(bytes, [bytes]);
    };
    const instance = await Instance.of(module, new Map(), { send_to_host: send }, () => { });
    instance.giveText(chip);
    if (instance.exports.open_card() !== 0) throw new Error("its chip cannot be read");
    card = instance;
    early.forEach(serve);
    early = null;
}

onmessage = ({ data }) => {
    if (!(data instanceof ArrayBuffer)) begin(data).catch(error => setTimeout(() => { throw error; }));
    else if (card) serve(data);
    else early.push(data);
};

holdLock(lock => postMessage({ lock }));
