// Exposure, curve and overlay as the panel has them.

import { shortest } from "./camera.js";
import { MODES, automaticScale, greatest, modeOf } from "./tone.js";

// Milliseconds between automatic exposures of a picture that is not settled, and pixels of it that are looked at.
const WAIT = 150;
const PIXELS = 20000;

export class Exposure {
    #inputs = Object.fromEntries(
        ["exposure", "automatic", "stops", "curve", "overlay"].map(id => [id, document.getElementById(id)]));
    #scale = 1;
    #measuredAt = -Infinity;

    // `changed()` is called when the picture must be shown otherwise.
    constructor(changed) {
        const { exposure, automatic, curve, overlay } = this.#inputs;
        exposure.addEventListener("input", () => automatic.checked = false);
        for (const input of [exposure, automatic, curve, overlay]) {
            input.addEventListener("input", () => {
                this.renew();
                changed();
            });
        }
    }

    // The automatic exposure is measured again.
    renew() {
        this.#measuredAt = -Infinity;
    }

    // Mapping of a layer to the screen. A settled picture is measured as `photoncard tonemap` does it, others in passing.
    of(layer, picture, isSettled) {
        const { exposure, automatic, stops, curve, overlay } = this.#inputs;
        const mode = modeOf(layer);
        if (mode === MODES.amount) {
            // Distances have no useful maximum under the sky.
            const scale = layer === "Z" ? 2 * automaticScale(picture.data) : 1 / (greatest(picture.data) || 1);
            return { mode, scale, curve: "none", byCard: overlay.value === "card" };
        }
        const age = performance.now() - this.#measuredAt;
        if (!automatic.checked) {
            this.#scale = Math.fround(2 ** Number(exposure.value));
        } else if (mode === MODES.light && (isSettled ? age === Infinity : age > WAIT)) {
            const stride = isSettled ? 1 : Math.ceil(picture.data.length / 4 / PIXELS);
            this.#scale = Math.fround(automaticScale(picture.data, stride));
            this.#measuredAt = performance.now();
            exposure.value = Math.log2(this.#scale);
        }
        stops.textContent = Math.log2(this.#scale).toFixed(1);
        return { mode, scale: this.#scale, curve: curve.value, byCard: overlay.value === "card" };
    }

    // Fields of `save`: null is the automatic exposure.
    get asked() {
        const { exposure, automatic, curve } = this.#inputs;
        return { exposure: automatic.checked ? null : Math.fround(exposure.value), tonemap: curve.value };
    }

    // Options of the command line, as far as they are not the defaults.
    get options() {
        const { exposure, tonemap } = this.asked;
        return (exposure === null ? "" : ` --exposure ${shortest(exposure)}`) +
            (tonemap === "reinhard" ? "" : ` --tonemap ${tonemap}`);
    }
}
