// Status of the page: progress of the picture, the command line, errors, and what was copied.

const byId = id => document.getElementById(id);
const ORDINALS = { 2: "2nd", 4: "4th", 8: "8th" };
const MESSAGE_TIME = 8000;
const HINT_TIME = 4000;

const progress = {
    reading: () => "Reading the scene.",
    lost: () => "No connection: trying again. A command that was started anew prints another address.",
    refused: state => `Refused: ${state.refused}`,
    settled: () => "Finished: the command below renders this picture, to the last bit.",
    working: state => !state || state.samples === 0 ? "Waiting for the picture."
        : state.step > 1 ? `Preview: every ${ORDINALS[state.step] ?? `${state.step}th`} pixel.`
            : `Getting better: ${state.samples} of ${state.spp} samples a pixel.`,
};

// A page that has its own host reads a scene while the host is not open; before that, and when it is lost, the choice of scenes hides the status.
export function showStatus(isOpen, hasHost, state, more) {
    const name = !isOpen ? hasHost ? "reading" : "lost" : state?.refused ? "refused" : state?.settled ? "settled" : "working";
    byId("status").dataset.state = name;
    setText("progress", progress[name](state));
    if (state) setText("command", state.command + more);
}

// Leaves a text that is as it should be, so that a selection stays.
export function setText(id, text) {
    if (byId(id).textContent !== text) byId(id).textContent = text;
}

// Shows a text in an element for some time.
function flash(id, into, text, time) {
    setText(into, text);
    byId(id).hidden = false;
    clearTimeout(endings.get(id));
    endings.set(id, setTimeout(() => byId(id).hidden = true, time));
}

const endings = new Map();

// Tells what was refused, or has failed.
export const tell = text => flash("message", "reason", text, MESSAGE_TIME);

// Tells what a move has met.
export const hint = text => flash("hint", "hint", text, HINT_TIME);

// Takes a message away: it was read, or holds no longer.
export function hush() {
    byId("message").hidden = true;
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
