// A kept picture over the present one, up to a line that a slider moves.

import { displayOn } from "./display.js";
import { putAt } from "./zoom.js";
import { Picture } from "./picture.js";

const byId = id => document.getElementById(id);

export class Compare {
    #kept = null;
    #camera = null;
    #display = null;
    #place = [0, 0, 0, 0];

    // `changed()` is called when the pictures must be shown otherwise, `go(camera)` moves to where one was
    // kept.
    constructor(changed, go) {
        this.changed = changed;
        byId("split").addEventListener("input", () => this.#cut());
        byId("drop-kept").addEventListener("click", () => this.drop());
        byId("go-kept").addEventListener("click", () => this.#camera && go(this.#camera));
    }

    get isOn() {
        return this.#kept !== null;
    }

    // Keeps a picture, and where it was taken.
    keep(picture, camera) {
        this.#kept = new Picture([...picture.size]);
        this.#kept.data.set(picture.data);
        this.#kept.mark(() => [-1, -1]);
        this.#camera = camera;
        this.#display ??= displayOn(byId("kept"), this.changed);
        this.#show();
    }

    drop() {
        this.#kept = null;
        this.#show();
    }

    #show() {
        for (const id of ["kept", "edge", "compare"]) byId(id).hidden = !this.isOn;
        this.#cut();
        this.changed();
    }

    // The kept picture is left of the line.
    #cut() {
        const share = Number(byId("split").value) / 100;
        const [left, top, width, height] = this.#place;
        byId("kept").style.clipPath = `inset(0 ${100 - 100 * share}% 0 0)`;
        Object.assign(byId("edge").style, { left: `${left + share * width}px`, top: `${top}px`, height: `${height}px` });
    }

    // Shows both by one exposure, at the same place.
    draw(tone) {
        if (this.isOn) this.#display.draw(this.#kept, tone);
    }

    // The picture has another place [left, top, width, height] on the stage.
    layOut(place) {
        this.#place = place;
        putAt(byId("kept"), place);
        this.#cut();
    }
}
