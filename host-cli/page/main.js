// The page of `photoncard view`: connects the command, the picture and the controls.

import { Bookmarks } from "./bookmarks.js";
import { extent, pose, projected, roomOf, rounded, shortest } from "./camera.js";
import { Compare } from "./compare.js";
import { Connection } from "./connection.js";
import { Controls } from "./controls.js";
import { displayOn } from "./display.js";
import { Surroundings, isMap } from "./environment.js";
import { Exposure } from "./exposure.js";
import { element } from "./fields.js";
import { History } from "./history.js";
import { Inspector } from "./inspector.js";
import { LocalHost } from "./local.js";
import { Overlay } from "./overlay.js";
import { Pace } from "./pace.js";
import { Panel } from "./panel.js";
import { Picture } from "./picture.js";
import { Saving } from "./saving.js";
import { Start } from "./start.js";
import { copy, hint, hush, setText, showStatus, tell } from "./status.js";
import { decoded, fileOf } from "./tiles.js";
import { Times } from "./times.js";
import { MODES } from "./tone.js";
import { Turntable } from "./turntable.js";
import { Zoom, putAt } from "./zoom.js";

const byId = id => document.getElementById(id);

// What the page that steers may use alone.
const STEERED = "#mix, #lights, #materials, #techniques, #camera, #fov, #side, #reset, #denoise, #rotation, #map, #turntable";

// Greatest number of cards of a page that has its own host.
const MAX_CARDS = 16;

// What the layers are for those who look at pictures.
const LAYERS = {
    radiance: "picture", direct: "direct light", indirect: "indirect light", caustic: "caustics", albedo: "albedo, colour of surfaces",
    N: "N, normals", Z: "Z, depth", P: "P, positions",
};
const canvas = byId("picture");
const drawing = new Pace(draw), sending = new Pace(sendMoves);
const display = displayOn(canvas, () => drawing.soon());
const picture = new Picture();
const times = new Times();
const history = new History();
const zoom = new Zoom();
const inspector = new Inspector();

// State of the command as last received, and the requests of this page.
let scene = null, state = null, isOpen = false, steers = false;
let camera = null, isCameraOwn = false, toSend = null;
const asked = {
    layer: "radiance", side: "512", size: null, started: null, camera: "", cameraId: 0, cursor: undefined,
    edits: new Map(), mixes: new Map(), saveId: 0,
    // Numbers of the last message that has made a picture, and of that one when something was refused.
    changed: 0, refused: 0,
};
// Tone of the picture as it was drawn last.
let drawn = null;
// Pixel under the pointer; null for none.
let pointed = null;

// Whether the host is in this page, or the command at the other end of a socket.
const hasHost = document.querySelector("meta[name=host]").content === "page";
const handlers = { message: take, tile: takeTile, changed: open => { isOpen = open; show(); } };
const connection = hasHost
    ? new LocalHost({ ...handlers, failed: reason => start.show(reason), said: line => panel.notice(line) })
    : new Connection(`${location.protocol.replace("http", "ws")}//${location.host}/socket${location.search}`, handlers);
const exposure = new Exposure(show);
const overlay = new Overlay(picture, showLayer);

// Shows the status, and the picture in the next frame.
function show() {
    document.body.classList.toggle("reading", !scene);
    drawing.soon();
    sending.soon();
    showStatus(isOpen, hasHost, state, png());
}

const send = (what, message) => {
    const id = connection.send(message);
    if (what) {
        times.sent(id, what);
        asked.changed = id;
    }
    return id;
};

const panel = new Panel(
    (name, value) => {
        exposure.hold();
        asked.edits.set(name, value);
        sending.soon();
    },
    (name, value) => send(name, { type: "setting", name, value }),
    (name, value) => {
        exposure.hold();
        asked.mixes.set(name, value);
        sending.soon();
    });

const view = {
    get camera() { return camera; },
    get scene() { return scene; },
    get size() { return picture.size; },
    get steers() { return steers && camera !== null; },
    move(next, isMoving) {
        // A drag may end after another scene was asked for.
        if (!camera) return;
        camera = next;
        isCameraOwn = true;
        toSend = { isMoving };
        byId("camera").value = "";
        if (!isMoving) noteCamera();
        sending.soon();
        showCentre();
    },
    get staysInside() { return byId("inside").checked; },
    get movesPicture() { return isPressed("hand"); },
    wall: () => hint("The wall of the room is here. Untick \u201cstay in the room\u201d to go through it."),
    magnify(factor, place) {
        const box = byId("stage").getBoundingClientRect();
        zoomBy(factor, [place[0] - box.left, place[1] - box.top]);
    },
    slide(by) {
        zoom.shift(by, fitting());
        layOut();
    },
    pick(at) {
        // A finger has no other way to point.
        this.cursor(at);
        if (scene) send("", { type: "pick", at });
    },
    cursor(at) {
        asked.cursor = pointed = at;
        sending.soon();
        showValue();
    },
};
const controls = new Controls(canvas, view);

// Goes to a camera that was kept.
const visit = place => place && view.steers && view.move(place, false);
const bookmarks = new Bookmarks(() => camera, visit);
const compare = new Compare(() => drawing.soon(), visit);
const turntable = new Turntable(
    yaw => view.steers && controls.orbit(yaw, 0),
    () => {
        press("turntable", false);
        controls.rest();
    },
    () => Number(byId("period").value));
const surroundings = new Surroundings({
    send: message => send("environment", message),
    upload: bytes => connection.upload(bytes),
    isBusy: () => connection.isBusy,
    told: tell,
    takes: files => !start || byId("start").hidden && files.every(isMap),
});
// Cards of a page that has its own host: each is a worker with a card memory of its own.
const cards = Math.max(1, Math.min(navigator.hardwareConcurrency ?? 1, MAX_CARDS));
const start = hasHost ? new Start({ open, hasView: () => connection.isRunning, cards }) : null;
const saving = new Saving(fields => asked.saveId = send("", { type: "save", ...fields, ...exposure.asked }));

const isPressed = id => byId(id).getAttribute("aria-pressed") === "true";
const press = (id, value) => byId(id).setAttribute("aria-pressed", value);

// Begins the view of other files, with the arguments of a view. What a person has changed of the scene before is not of this one.
function open(files, words, shown) {
    turntable.stop();
    scene = state = camera = toSend = pointed = null;
    isCameraOwn = false;
    Object.assign(asked, { layer: "radiance", size: null, started: null, camera: "", cursor: undefined });
    asked.edits.clear();
    asked.mixes.clear();
    history.clear();
    controls.centre = null;
    compare.drop();
    zoom.fit();
    picture.clear();
    exposure.take(shown ?? {});
    panel.forgetNotices();
    hush();
    show();
    // A link may state cards.
    const own = words.some(word => /^--card(=|$)/.test(word)) ? [] : ["--card", `emulated:${cards}`];
    connection.open(files, [...words, ...own]);
    connection.pause(document.hidden);
}

function take(message) {
    const act = {
        hello, state: takeState,
        cards: ({ cards }) => panel.cards(cards),
        saved: ({ path }) => saving.saved(path),
        announced: () => surroundings.begin(),
        picked: ({ point }) => { controls.centre = point; showCentre(); },
        steers: ({ value }) => setSteers(value),
        error({ text, id }) {
            tell(text);
            asked.refused = asked.changed;
            if (id && id === asked.cameraId) followCamera();
            if (id && id === asked.saveId) saving.refused();
            surroundings.refused(id);
            if (state) panel.update(state, true);
        },
    }[message.type];
    act?.(message);
}

function hello(message) {
    if (scene === null) asked.side = message.size_stated ? "" : asked.side || "512";
    scene = { ...message.scene, isNew: scene?.name !== message.scene.name };
    byId("scene").textContent = document.title = scene.name;
    show();
    panel.show(scene);
    panel.showGroups(message.light_groups);
    const options = (id, entries) =>
        byId(id).replaceChildren(...entries.map(([value, textContent]) => element("option", { value, textContent })));
    options("layer", message.layers.map(name => [name, LAYERS[name] ?? name]));
    options("camera", [["", "—"], ...scene.cameras.map(({ name }, index) => [index, name])]);
    options("side", [["", "as started"], ...[128, 256, 512, 1024].map(side => [side, `${side} pixels`]), ["window", "the window's"]]);
    byId("layer").value = asked.layer;
    byId("side").value = asked.side;
    saving.open(message.out);
    bookmarks.open(scene.name);
    surroundings.show(message.environment ?? null);
    byId("denoise").parentElement.hidden = !message.denoises;
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
    for (const field of document.querySelectorAll(STEERED)) field.inert = !steers;
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
    if (scene.isNew) {
        scene.isNew = false;
        byId("inside").checked = roomOf(camera, scene) !== null;
        noteCamera();
    }
    // What was refused is of no interest once something else was done.
    if (asked.changed > asked.refused && message.id >= asked.changed) hush();
    byId("denoise").checked = message.denoised;
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
    const file = fileOf(buffer);
    if (file) return saving.offer(file);
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
    noteCamera();
    showCentre();
}

// The camera has come to rest.
function noteCamera() {
    history.note(camera);
    byId("undo").disabled = !history.canUndo;
    byId("redo").disabled = !history.canRedo;
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

const stageSize = () => {
    const box = byId("stage").getBoundingClientRect();
    return [box.width, box.height];
};

// Size of the picture on the stage, as large as it can be.
function fitting() {
    const stage = stageSize(), { size } = picture;
    // A picture of the window's size is shown pixel by pixel.
    const isExact = stage.every((side, axis) => Math.floor(side) === size[axis]);
    const factor = isExact ? 1 : Math.min(...stage.map((side, axis) => side / size[axis]));
    return size.map(side => side * factor);
}

// Places the canvas on the stage: in the middle, or as it was magnified and shifted.
function layOut() {
    const place = zoom.place(stageSize(), fitting());
    putAt(canvas, place);
    compare.layOut(place);
    setText("zoom-fit", `${Math.round(100 * zoom.factor)} %`);
    showCentre();
}

// Magnifies the picture about a point of the stage.
function zoomBy(factor, at = stageSize().map(side => side / 2)) {
    zoom.by(factor, at, stageSize(), fitting());
    layOut();
}

function draw() {
    const isSettled = state?.settled && picture.version === state.version;
    const tone = exposure.of(asked.layer, picture, isSettled);
    display.draw(picture, { ...tone, ...overlay.tone, isPreview: !isSettled && tone.mode === MODES.light });
    compare.draw({ ...tone, overlay: 0, greatest: 1 });
    times.drawn(picture);
    setText("times", times.text);
    drawn = tone;
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
    const factor = canvas.offsetWidth / picture.size[0];
    byId("centre").style.left = `${canvas.offsetLeft + place[0] * factor}px`;
    byId("centre").style.top = `${canvas.offsetTop + place[1] * factor}px`;
}

function showValue() {
    if (drawn) inspector.show(pointed, picture, drawn);
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

const on = (id, type, act) => byId(id).addEventListener(type, act);
on("layer", "change", ({ target }) => {
    asked.layer = target.value;
    showLayer();
});
on("side", "change", ({ target }) => { asked.side = target.value; fit(); });
on("camera", "change", ({ target }) => {
    const chosen = scene?.cameras[target.value];
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
    exposure.relax();
    followCamera();
    send("reset", { type: "reset" });
});
on("steer", "click", () => send("", { type: "steer" }));
on("denoise", "change", ({ target }) => {
    picture.restart(picture.version);
    send("denoise", { type: "denoise", value: target.checked });
});
on("hush", "click", hush);
on("undo", "click", () => travel(() => history.undone()));
on("redo", "click", () => travel(() => history.redone()));
on("turntable", "click", () => isPressed("turntable") ? turntable.stop() : startTurntable());
on("zoom-in", "click", () => zoomBy(1.5));
on("zoom-out", "click", () => zoomBy(1 / 1.5));
on("zoom-fit", "click", fitPicture);
on("hand", "click", () => press("hand", !isPressed("hand")));
on("keep", "click", () => compare.keep(picture, camera));
on("inspector", "toggle", () => {
    inspector.renew();
    showValue();
});
on("workings", "toggle", ({ target }) => byId("times").hidden = !target.open);
on("copy-command", "click", ({ target }) => copy(byId("command").textContent, target));
on("copy-link", "click", ({ target }) => state && copy(`${location.href.split("#")[0]}#${encodeURIComponent(state.command + png())}`, target));
on("copy-pose", "click", ({ target }) => camera && copy(pose(camera), target));
on("toggle", "click", ({ target }) => {
    const isShown = byId("panel").hidden;
    byId("panel").hidden = !isShown;
    target.setAttribute("aria-expanded", isShown);
});

// Goes to another camera of the history, which stays as it is.
function travel(choose) {
    if (!view.steers) return;
    turntable.stop();
    visit(choose());
}

function startTurntable() {
    press("turntable", true);
    turntable.start();
}

function fitPicture() {
    zoom.fit();
    layOut();
}

// Whatever else a person does ends the turntable.
for (const type of ["pointerdown", "wheel", "keydown"]) {
    addEventListener(type, ({ target }) => target.id !== "turntable" && turntable.stop(), { capture: true, passive: true });
}

addEventListener("keydown", event => {
    if (event.target.closest?.("input:not([type=checkbox], [type=range]), textarea")) return;
    const key = event.key.toLowerCase();
    const isCommand = (event.ctrlKey || event.metaKey) && !event.altKey;
    if (isCommand && (key === "z" || key === "y")) {
        event.preventDefault();
        travel(() => key === "y" || event.shiftKey ? history.redone() : history.undone());
    }
    if (isCommand || event.altKey) return;
    if (key === "escape") hush();
    if (key === "0") fitPicture();
    if (key >= "1" && key <= "9") bookmarks.visit(Number(key) - 1);
});

let resized = 0;
new ResizeObserver(() => {
    layOut();
    clearTimeout(resized);
    resized = setTimeout(fit, 200);
}).observe(byId("stage"));

if (hasHost) {
    byId("copy-link").hidden = byId("other-scene").hidden = false;
    start.show("");
    // A page that nobody sees leaves the processor to others.
    document.addEventListener("visibilitychange", () => connection.pause(document.hidden));
    const keeper = navigator.serviceWorker;
    const isRenewed = Boolean(keeper?.controller);
    keeper?.register("offline.js").catch(error => console.info(`not offline: ${error.message}`));
    // Workers that begin from now on would be of the new version, and this page of the old one.
    keeper?.addEventListener("controllerchange", () => {
        if (!isRenewed) return;
        if (connection.isRunning) tell("There is a newer version of this page: reload it before another scene is opened.");
        else location.reload();
    });
}

// For tests and for whoever looks in the browser's console.
window.photoncard = {
    times, picture, view, connection, display, start, controls, history, zoom, turntable, exposure,
    get scene() { return scene; },
    get state() { return state; },
    // True if the picture is finished and no change of it is on its way. A change that the command refuses has no answer.
    get isSettled() {
        const isQuiet = !toSend && asked.edits.size + asked.mixes.size === 0 && (times.waiting === 0 || times.silence > 1500);
        return isOpen && isQuiet && Boolean(state?.settled) && picture.isWhole && picture.step === 1 &&
            picture.version === state.version && !drawing.isWaiting;
    },
};
