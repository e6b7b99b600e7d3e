// Exposure and curve as the panel has them.

import { shortest } from "./camera.js";
import { MODES, automaticScale, greatest, modeOf } from "./tone.js";

// Milliseconds between measurements of a picture that is not settled, and pixels of it that are looked at.
const WAIT = 150;
const PIXELS = 20000;

export class Exposure {
    #inputs = Object.fromEntries(
        ["exposure", "automatic", "stops", "curve"].map(id => [id, document.getElementById(id)]));
    #scale = 1;
    // Exposure, which the slider has rounded, and whether an edit has made it stay.
    #stops = 0;
    #isHeld = false;
    #measuredAt = -Infinity;

    // `changed()` is called when the picture must be shown otherwise.
    constructor(changed) {
        const { exposure, automatic, curve } = this.#inputs;
        exposure.addEventListener("input", () => {
            this.#stops = Number(exposure.value);
            this.#release();
            automatic.checked = false;
        });
        automatic.addEventListener("input", () => this.#release());
        for (const input of [exposure, automatic, curve]) {
            input.addEventListener("input", () => {
                this.renew();
                changed();
            });
        }
    }

    // Keeps an automatic exposure as it is: with a measured one, a light that is changed would look as
    // before.
    hold() {
        const { automatic } = this.#inputs;
        if (!automatic.checked) return;
        automatic.checked = false;
        this.#isHeld = true;
        this.#showHeld();
    }

    // Measures again, if an edit has held the exposure.
    relax() {
        if (!this.#isHeld) return;
        this.#inputs.automatic.checked = true;
        this.#release();
        this.renew();
    }

    // Takes what a link states: {exposure, tonemap}; otherwise exposure is automatic, and the curve stays.
    take({ exposure, tonemap }) {
        const { automatic, curve } = this.#inputs;
        automatic.checked = !Number.isFinite(exposure);
        if (!automatic.checked) this.#inputs.exposure.value = this.#stops = exposure;
        if ([...curve.options].some(({ value }) => value === tonemap)) curve.value = tonemap;
        this.#release();
        this.renew();
    }

    #release() {
        this.#isHeld = false;
        this.#showHeld();
    }

    #showHeld() {
        document.getElementById("held").hidden = !this.#isHeld;
    }

    // The picture is measured again.
    renew() {
        this.#measuredAt = -Infinity;
    }

    // Mapping of a layer to the screen. A settled picture is measured as `photoncard tonemap` does it, others
    // in passing.
    of(layer, picture, isSettled) {
        const { exposure, automatic, stops, curve } = this.#inputs;
        const mode = modeOf(layer);
        const isLight = mode === MODES.light;
        const age = performance.now() - this.#measuredAt;
        if (isLight && !automatic.checked) {
            this.#scale = Math.fround(2 ** Math.fround(this.#stops));
        } else if ((isLight || mode === MODES.amount) && (isSettled ? age === Infinity : age > WAIT)) {
            const stride = isSettled ? 1 : Math.ceil(picture.data.length / 4 / PIXELS);
            this.#scale = Math.fround(measured(layer, picture.data, stride));
            this.#measuredAt = performance.now();
            if (isLight) exposure.value = this.#stops = Math.log2(this.#scale);
        }
        if (isLight) stops.textContent = Math.log2(this.#scale).toFixed(1);
        return { mode, scale: this.#scale, curve: curve.value };
    }

    // Fields of `save`: null is the automatic exposure.
    get asked() {
        const { automatic, curve } = this.#inputs;
        return { exposure: automatic.checked ? null : Math.fround(this.#stops), tonemap: curve.value };
    }

    // Options of the command line, as far as they are not the defaults.
    get options() {
        const { exposure, tonemap } = this.asked;
        return (exposure === null ? "" : ` --exposure ${shortest(exposure)}`) +
            (tonemap === "reinhard" ? "" : ` --tonemap ${tonemap}`);
    }
}

function measured(layer, data, stride) {
    if (modeOf(layer) === MODES.light) return automaticScale(data, stride);
    // Distances have no useful maximum under the sky.
    return layer === "Z" ? 2 * automaticScale(data, stride) : 1 / (greatest(data, stride) || 1);
}
