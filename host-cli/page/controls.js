// Mouse, touch, wheel and keys on the picture, as moves of the camera.

import { depth, dollied, flown, kept, length, middle, panned, projected, roomOf, sub, turned, zoomed } from "./camera.js";

const TURN = 0.006; // radians for each pixel of a drag
const WHEEL = 0.0012; // share of the distance for each pixel of the wheel
const CLICK = 4; // pixels that a click may move
const REST = 200; // milliseconds after the last turn of the wheel

// Direction of each key: [axis, sign]. Axes: right, up, forward, then yaw, pitch, zoom.
const KEYS = {
    KeyA: [0, -1], KeyD: [0, 1], KeyQ: [1, -1], KeyE: [1, 1], KeyS: [2, -1], KeyW: [2, 1],
    ArrowLeft: [3, 1], ArrowRight: [3, -1], ArrowDown: [4, -1], ArrowUp: [4, 1],
    Minus: [5, 1], Equal: [5, -1], NumpadSubtract: [5, 1], NumpadAdd: [5, -1],
};

export class Controls {
    // Centre of turns, by the last click on a surface; null for the middle of the scene.
    centre = null;
    #pointers = new Map();
    #held = new Set();
    #moved = 0;
    #resting = 0;
    // Where an orbit would be without walls, for as long as it lasts: it finds its distance again.
    #free = null;

    // `view` has `camera`, `scene` (bounds), `size` (the picture's, pixels), `steers`, `staysInside` and
    // `movesPicture`, and takes `move(camera, isMoving)`, `wall()`, `pick([x, y])`, `cursor([x, y] or null)`,
    // `magnify(factor, [x, y] of the window)` and `slide([dx, dy])` of the picture on the stage.
    constructor(canvas, view) {
        Object.assign(this, { canvas, view });
        const listen = (target, type, act) => target.addEventListener(type, act.bind(this), { passive: false });
        listen(canvas, "pointerdown", this.#down);
        listen(canvas, "pointermove", this.#drag);
        listen(canvas, "pointerup", this.#up);
        listen(canvas, "pointercancel", this.#up);
        listen(canvas, "pointerleave", () => this.view.cursor(null));
        listen(canvas, "contextmenu", event => event.preventDefault());
        listen(canvas, "wheel", this.#wheel);
        listen(window, "keydown", this.#key);
        listen(window, "keyup", event => this.#held.delete(event.code));
        listen(window, "blur", () => this.#held.clear());
    }

    // Pixel of the picture at an event.
    #place(event) {
        const box = this.canvas.getBoundingClientRect();
        const shares = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
        return this.view.size.map((side, axis) => Math.min(Math.max(Math.floor(shares[axis] * side), 0), side - 1));
    }

    // Centre of a turn: the chosen one as long as it is in the picture.
    turnCentre(camera = this.view.camera) {
        const { scene, size } = this.view;
        const place = this.centre && projected(camera, this.centre, size);
        const isSeen = place && place.every((value, axis) => value >= 0 && value <= size[axis]);
        return isSeen ? this.centre : middle(camera, scene);
    }

    #down(event) {
        this.canvas.focus();
        this.canvas.setPointerCapture(event.pointerId);
        this.#pointers.set(event.pointerId, [event.clientX, event.clientY]);
        if (this.#pointers.size === 1) this.#moved = 0;
        event.preventDefault();
    }

    #drag(event) {
        const last = this.#pointers.get(event.pointerId);
        if (!last) {
            this.view.cursor(this.#place(event));
            return;
        }
        const place = [event.clientX, event.clientY];
        const [dx, dy] = sub(place, last);
        this.#moved += Math.hypot(dx, dy);
        if (this.#moved < CLICK || !(this.view.steers || this.view.movesPicture)) return;
        const others = [...this.#pointers].filter(([id]) => id !== event.pointerId).map(([, other]) => other);
        this.#pointers.set(event.pointerId, place);
        if (others.length > 0) this.#pinched(last, place, others[0]);
        else if (this.view.movesPicture) this.view.slide([dx, dy]);
        else this.#dragged(event, dx, dy);
    }

    #dragged({ buttons, shiftKey }, dx, dy) {
        const { camera } = this.view;
        if (buttons & 4 || shiftKey) this.#go(this.#pan(camera, [dx, dy], this.turnCentre()), true);
        else if (buttons & 2) this.#go(turned(camera, camera.position, -dx * TURN, -dy * TURN), true);
        else this.orbit(-dx * TURN, -dy * TURN);
    }

    // Turns about the centre, by radians.
    orbit(yaw, pitch) {
        this.#free ??= this.view.camera;
        const centre = this.turnCentre(this.#free);
        const free = turned(this.#free, centre, yaw, pitch);
        this.#go(free, true, centre);
        this.#free = free;
    }

    // Ends a move: the camera rests.
    rest() {
        this.#free = null;
        this.view.move(this.view.camera, false);
    }

    // Moves the camera as far as walls let it, about a centre or anyhow.
    #go(next, isMoving, centre = null) {
        const { camera, scene, staysInside } = this.view;
        const room = staysInside ? roomOf(camera, scene) : null;
        const there = room ? kept(next, room, centre) : next;
        this.#free = null;
        this.view.move(there, isMoving);
        if (there !== next) this.view.wall();
    }

    // Two fingers: their middle pans, their distance dollies.
    #pinched(last, place, other) {
        const [before, now] = [last, place].map(finger => Math.max(length(sub(finger, other)), 1));
        const shift = sub(place, last).map(value => value / 2);
        if (this.view.movesPicture) {
            this.view.slide(shift);
            this.view.magnify(now / before, place.map((value, axis) => (value + other[axis]) / 2));
            return;
        }
        const centre = this.turnCentre();
        this.#go(dollied(this.#pan(this.view.camera, shift, centre), centre, before / now), true);
    }

    #pan(camera, shift, centre) {
        return panned(camera, shift, this.canvas.getBoundingClientRect().height, camera.angles ? length(sub(centre, camera.position)) : depth(camera, centre));
    }

    #up(event) {
        if (!this.#pointers.delete(event.pointerId) || this.#pointers.size > 0) return;
        if (this.#moved >= CLICK && this.view.movesPicture) return;
        if (this.#moved >= CLICK) this.rest();
        else if (event.type === "pointerup" && event.button === 0) this.view.pick(this.#place(event));
    }

    #wheel(event) {
        event.preventDefault();
        const pixels = event.deltaY * [1, 16, 400][event.deltaMode];
        const factor = Math.exp(Math.min(Math.max(pixels * WHEEL, -1), 1));
        if (event.ctrlKey || this.view.movesPicture) {
            this.view.magnify(1 / factor, [event.clientX, event.clientY]);
            return;
        }
        if (!this.view.steers) return;
        const { camera } = this.view;
        this.#go(event.altKey ? zoomed(camera, factor) : dollied(camera, this.turnCentre(), factor), true);
        clearTimeout(this.#resting);
        this.#resting = setTimeout(() => this.rest(), REST);
    }

    #key(event) {
        const isTyping = event.target.closest?.("input, select, textarea");
        if (!KEYS[event.code] || isTyping || event.ctrlKey || event.metaKey || event.altKey) return;
        event.preventDefault();
        if (!this.view.steers) return;
        if (this.#held.size === 0) this.#fly(performance.now());
        this.#held.add(event.code);
        this.isFast = event.shiftKey;
    }

    // Moves the camera from frame to frame as long as keys are held.
    #fly(last) {
        requestAnimationFrame(now => {
            const seconds = Math.min(Math.max(now - last, 8), 100) / 1000;
            const rates = [0, 0, 0, 0, 0, 0];
            for (const code of this.#held) rates[KEYS[code][0]] += KEYS[code][1];
            const isHeld = this.#held.size > 0 && this.view.steers;
            if (isHeld) {
                this.#go(this.#flown(rates.map(rate => rate * seconds)), true);
                this.#fly(now);
            } else {
                this.rest();
                this.#held.clear();
            }
        });
    }

    #flown([right, up, forward, yaw, pitch, zoom]) {
        const { camera, scene } = this.view;
        const speed = length(sub(scene.high, scene.low)) * (this.isFast ? 0.5 : 0.15);
        const there = flown(camera, [right, up, forward].map(share => share * speed));
        return zoomed(turned(there, there.position, yaw, pitch), Math.exp(zoom));
    }
}
