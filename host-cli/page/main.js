// The page of `photoncard view`: connects the command, the picture and the controls.

import { extent, pose, projected, rounded, shortest } from "./camera.js";
import { Connection } from "./connection.js";
import { Controls } from "./controls.js";
import { displayOn } from "./display.js";
import { Exposure } from "./exposure.js";
import { element } from "./fields.js";
import { Overlay } from "./overlay.js";
import { Pace } from "./pace.js";
import { Panel } from "./panel.js";
import { Picture } from "./picture.js";
import { copy, setText, showStatus, tell } from "./status.js";
import { decoded } from "./tiles.js";
import { Times } from "./times.js";

const byId = id => document.getElementById(id);
const canvas = byId("picture");
const drawing = new Pace(draw), sending = new Pace(sendMoves);
const display = displayOn(canvas, () => drawing.soon());
const picture = new Picture();
const times = new Times();

// State of the command as last received, and the requests of this page.
let scene = null, state = null, isOpen = false, steers = false;
let camera = null, isCameraOwn = false, toSend = null;
const asked = { layer: "radiance", side: "512", size: null, started: null, camera: "", cameraId: 0, cursor: undefined, edits: new Map(), mixes: new Map() };
// Pixel under the pointer; null for none.
let pointed = null;

const connection = new Connection(
    `${location.protocol.replace("http", "ws")}//${location.host}/socket${location.search}`,
    { message: take, tile: takeTile, changed: open => { isOpen = open; show(); } });
const exposure = new Exposure(show);
const overlay = new Overlay(picture, showLayer);

// Shows the status, and the picture in the next frame.
function show() {
    drawing.soon();
    sending.soon();
    showStatus(isOpen, state, png());
}

const send = (what, message) => {
    const id = connection.send(message);
    if (what) times.sent(id, what);
    return id;
};

const panel = new Panel(
    (name, value) => {
        asked.edits.set(name, value);
        sending.soon();
    },
    (name, value) => send(name, { type: "setting", name, value }),
    (name, value) => {
        asked.mixes.set(name, value);
        sending.soon();
    });

const view = {
    get camera() { return camera; },
    get scene() { return scene; },
    get size() { return picture.size; },
    get steers() { return steers && camera !== null; },
    move(next, isMoving) {
        camera = next;
        isCameraOwn = true;
        toSend = { isMoving };
        byId("camera").value = "";
        sending.soon();
        showCentre();
    },
    pick: at => scene && send("", { type: "pick", at }),
    cursor(at) {
        asked.cursor = pointed = at;
        sending.soon();
        showValue();
    },
};
const controls = new Controls(canvas, view);

function take(message) {
    const act = {
        hello, state: takeState,
        cards: ({ cards }) => panel.cards(cards),
        saved: ({ path }) => byId("saved").textContent = `saved ${path}`,
        picked: ({ point }) => { controls.centre = point; showCentre(); },
        steers: ({ value }) => setSteers(value),
        error({ text, id }) {
            tell(text);
            if (id && id === asked.cameraId) followCamera();
            if (state) panel.update(state, true);
        },
    }[message.type];
    act?.(message);
}

function hello(message) {
    if (scene === null && message.size_stated) asked.side = "";
    scene = { ...message.scene };
    byId("scene").textContent = document.title = scene.name;
    panel.show(scene);
    panel.showGroups(message.light_groups);
    const options = (id, entries) =>
        byId(id).replaceChildren(...entries.map(([value, textContent]) => element("option", { value, textContent })));
    options("layer", message.layers.map(name => [name, name]));
    options("camera", [["", "—"], ...scene.cameras.map(({ name }, index) => [index, name])]);
    options("side", [["", "as started"], ...[128, 256, 512, 1024].map(side => [side, `${side} pixels`]), ["window", "the window's"]]);
    byId("layer").value = asked.layer;
    byId("side").value = asked.side;
    byId("saved").textContent = message.out === null ? "Start the command with --out DIR to save files." : `to ${message.out}`;
    for (const id of ["save-exr", "save-png", "name"]) byId(id).disabled = message.out === null;
    picture.restart(0);
    state = null;
    setSteers(message.steers);
    if (asked.layer !== "radiance") send("", { type: "layer", name: asked.layer });
    if (isCameraOwn && steers) toSend = { isMoving: false };
}

function setSteers(value) {
    steers = value;
    asked.size = null;
    byId("spectator").hidden = steers;
    for (const field of document.querySelectorAll("#mix, #lights, #materials, #techniques, #camera, #fov, #side, #reset")) {
        field.inert = !steers;
    }
    if (steers) fit();
}

// Shows the field of view, or the height of an orthographic picture; a panorama's angles stay.
function showExtent() {
    if (!camera) return;
    const isOrthographic = camera.height !== undefined;
    const field = byId("fov");
    [field.min, field.max] = isOrthographic ? [1e-6, 1e9] : [1, 150];
    field.step = isOrthographic ? "any" : 1;
    field.parentElement.hidden = camera.angles !== undefined;
    byId("extent").textContent = isOrthographic ? "Height, metres" : "Field of view, degrees";
    field.value = isOrthographic ? shortest(camera.height) : camera.angles ? "" : shortest(camera.fov);
}

function takeState(message) {
    const isFirst = state === null;
    state = message;
    if (isFirst && times.measured.length === 0) times.opened(message.version);
    if (message.id) times.known(message.id, message.version);
    picture.resize(message.size);
    if (!isCameraOwn || !steers) camera = message.camera;
    panel.update(message);
    if (message.settled) times.settled(message.version);
    if (document.activeElement !== byId("fov")) showExtent();
    exposure.renew();
    layOut();
    show();
    if (isFirst) {
        asked.started ??= message.size;
        fit();
    }
}

function takeTile(buffer) {
    const tile = decoded(buffer);
    if (!tile || !picture.put(tile)) return;
    // The first picture after a change is shown at once, and so is every whole one.
    if (picture.isFirst || picture.isWhole) drawing.soon();
    else drawing.later();
}

// Takes the command's camera in place of this page's own.
function followCamera() {
    isCameraOwn = false;
    toSend = null;
    asked.camera = "";
    byId("camera").value = "";
    if (!state) return;
    camera = state.camera;
    showCentre();
}

// Asks for the size that the window or the panel wants.
function fit() {
    const box = byId("stage").getBoundingClientRect();
    if (!state || !steers || box.width < 1 || box.height < 1) return;
    const longer = asked.side === "window" ? 1 : Number(asked.side) / Math.max(box.width, box.height);
    const size = asked.side === "" ? asked.started
        : [box.width, box.height].map(side => Math.max(Math.floor(side * longer), 1));
    if ((asked.size ?? state.size).join() !== size.join()) send("size", { type: "size", size });
    asked.size = size;
}

// Places the canvas in the middle of the stage, as large as it can be.
function layOut() {
    const box = byId("stage").getBoundingClientRect();
    const [width, height] = picture.size;
    const fitting = Math.min(box.width / width, box.height / height);
    // A picture of the window's size is shown pixel by pixel.
    const factor = Math.floor(box.width) === width && Math.floor(box.height) === height ? 1 : fitting;
    canvas.style.width = `${width * factor}px`;
    canvas.style.height = `${height * factor}px`;
    showCentre();
}

function draw() {
    const isSettled = state?.settled && picture.version === state.version;
    display.draw(picture, { ...exposure.of(asked.layer, picture, isSettled), ...overlay.tone });
    times.drawn(picture);
    setText("times", times.text);
    showValue();
}

function sendMoves() {
    if (!isOpen || !scene) return;
    if (connection.isBusy) {
        sending.later();
        return;
    }
    if (toSend && steers) {
        const view = rounded(camera), text = JSON.stringify(view);
        // A camera that comes to rest makes no new picture.
        asked.cameraId = send(text === asked.camera ? "" : "camera", { type: "camera", ...view, moving: toSend.isMoving });
        asked.camera = text;
        toSend = null;
    }
    if (asked.cursor !== undefined) {
        send("", { type: "cursor", at: asked.cursor });
        asked.cursor = undefined;
    }
    for (const [name, value] of asked.edits) send(name, { type: "set", name, value });
    asked.edits.clear();
    // The picture stays, with other light: its tiles come again.
    if (asked.mixes.size > 0) picture.restart(picture.version);
    for (const [name, value] of asked.mixes) send("mix", { type: "mix", name, value });
    asked.mixes.clear();
}

function showCentre() {
    const place = camera && controls.centre && projected(camera, controls.centre, picture.size);
    byId("centre").hidden = !place;
    if (!place) return;
    const factor = canvas.clientWidth / picture.size[0];
    byId("centre").style.left = `${canvas.offsetLeft + place[0] * factor}px`;
    byId("centre").style.top = `${canvas.offsetTop + place[1] * factor}px`;
}

function showValue() {
    const value = pointed ? picture.at(pointed) : [];
    setText("value", value.length ? `${pointed.join(", ")}: ${value.map(part => part.toPrecision(4)).join("  ")}` : "\u00a0");
    overlay.show(pointed);
}

// Shows the layer that is asked for, or another overlay: all tiles come again.
function showLayer() {
    picture.restart(picture.version);
    exposure.renew();
    send("layer", { type: "layer", name: asked.layer });
    drawing.soon();
}

// Options of the command line that write a PNG, if the picture is shown otherwise than by default.
function png() {
    const tone = exposure.options;
    return tone && ` -o picture.png${tone}`;
}

function save(ending) {
    const name = `${byId("name").value.trim().replace(/\.(exr|png)$/i, "")}.${ending}`;
    send("", { type: "save", name, ...exposure.asked });
}

const on = (id, type, act) => byId(id).addEventListener(type, act);
on("layer", "change", ({ target }) => {
    asked.layer = target.value;
    showLayer();
});
on("side", "change", ({ target }) => { asked.side = target.value; fit(); });
on("camera", "change", ({ target }) => {
    const chosen = scene.cameras[target.value];
    if (target.value === "" || !chosen) return;
    const place = target.value;
    view.move(chosen, false);
    target.value = place;
});
// A typed value that is not possible gives way to the camera's.
on("fov", "change", showExtent);
on("fov", "input", ({ target }) => target.validity.valid && target.value !== "" && camera &&
    view.move({ ...camera, ...extent(camera, () => Number(target.value)) }, false));
on("reset", "click", () => {
    asked.edits.clear();
    asked.mixes.clear();
    followCamera();
    send("reset", { type: "reset" });
});
on("steer", "click", () => send("", { type: "steer" }));
on("save-exr", "click", () => save("exr"));
on("save-png", "click", () => save("png"));
on("copy-command", "click", ({ target }) => copy(byId("command").textContent, target));
on("copy-pose", "click", ({ target }) => camera && copy(pose(camera), target));
on("toggle", "click", ({ target }) => {
    const isShown = byId("panel").hidden;
    byId("panel").hidden = !isShown;
    target.setAttribute("aria-expanded", isShown);
});
let resized = 0;
new ResizeObserver(() => {
    layOut();
    clearTimeout(resized);
    resized = setTimeout(fit, 200);
}).observe(byId("stage"));

// For tests and for whoever looks in the browser's console.
window.photoncard = {
    times, picture, view, connection, display,
    get scene() { return scene; },
    get state() { return state; },
    // True if the picture is finished and no change of it is on its way. A change that the command refuses has no answer.
    get isSettled() {
        const isQuiet = !toSend && asked.edits.size + asked.mixes.size === 0 && (times.waiting === 0 || times.silence > 1500);
        return isOpen && isQuiet && Boolean(state?.settled) && picture.isWhole && picture.step === 1 &&
            picture.version === state.version && !drawing.isWaiting;
    },
};
