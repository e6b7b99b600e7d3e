// Status of the page: progress of the picture, the command line, errors, and what was copied.

const byId = id => document.getElementById(id);
const ORDINALS = { 2: "2nd", 4: "4th", 8: "8th" };
const MESSAGE_TIME = 8000;

const progress = {
    lost: () => "No connection: trying again. A command that was started anew prints another address.",
    refused: state => `Refused: ${state.refused}`,
    settled: () => "Settled: this is the picture of the command below, to the last bit.",
    working: state => !state ? "Waiting for the first picture."
        : state.step > 1 ? `Coarse: every ${ORDINALS[state.step] ?? `${state.step}th`} pixel.`
            : `Refining: ${state.samples} of ${state.spp} samples a pixel.`,
};

export function showStatus(isOpen, state, more) {
    const name = !isOpen ? "lost" : state?.refused ? "refused" : state?.settled ? "settled" : "working";
    byId("status").dataset.state = name;
    setText("progress", progress[name](state));
    if (state) setText("command", state.command + more);
}

// Leaves a text that is as it should be, so that a selection stays.
export function setText(id, text) {
    if (byId(id).textContent !== text) byId(id).textContent = text;
}

let ending = 0;
export function tell(text) {
    byId("message").textContent = text;
    byId("message").hidden = false;
    clearTimeout(ending);
    ending = setTimeout(() => byId("message").hidden = true, MESSAGE_TIME);
}

export async function copy(text, button) {
    const label = button.dataset.label ??= button.textContent;
    const isCopied = await navigator.clipboard?.writeText(text).then(() => true, () => false) ?? selected(text);
    button.textContent = isCopied ? "Copied" : "Not allowed";
    setTimeout(() => button.textContent = label, 1500);
}

// Copies as a selection: pages of other machines have no other way. Returns whether the browser allows it.
function selected(text) {
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    const isCopied = document.execCommand("copy");
    area.remove();
    return isCopied;
}
