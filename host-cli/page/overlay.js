// Overlay of the work of each tile: its card, or a map of heat with a legend.

import { setText } from "./status.js";
import { OVERLAYS } from "./tone.js";

const byId = id => document.getElementById(id);

// Maps of heat, by a tile's count.
const MAPS = { gathers: "gathers a pixel", records: "irradiance records a pixel", lines: "lines of DRAM a pixel" };
const NOT_COUNTED = "Lines of DRAM are counted by a view with --counters.";

// Marks of the inner pixels of a tile, and of those at its edges. Negative ones are not shown.
const NONE = [-1, -1];
function marksOf(overlay) {
    if (overlay === "none") return () => NONE;
    if (overlay === "card") return ({ card }) => [card, card + 0.5];
    return tile => {
        const mark = tile[overlay] / (tile.columns * tile.rows);
        return mark >= 0 ? [mark, mark] : NONE;
    };
}

const rounded = value => String(Number(value.toPrecision(3)));

export class Overlay {
    #label = "";
    #kind = OVERLAYS.none;

    // `changed()` is called when all tiles must come again, to be marked anew.
    constructor(picture, changed) {
        this.picture = picture;
        byId("overlay").addEventListener("input", ({ target: { value } }) => {
            this.#label = MAPS[value];
            this.#kind = OVERLAYS[value] ?? OVERLAYS.heat;
            picture.mark(marksOf(value));
            changed();
        });
    }

    // Its part of a tone (see tone.js).
    get tone() {
        return { overlay: this.#kind, greatest: this.picture.greatest || 1 };
    }

    // Shows the legend, with the value at a pixel.
    show(at) {
        byId("legend").hidden = !this.#label;
        if (!this.#label) return;
        const { greatest, isWhole } = this.picture;
        const here = at ? this.picture.markAt(at) : -1;
        byId("heat").hidden = greatest < 0;
        setText("greatest", `${rounded(greatest)} ${this.#label}`);
        setText("here", greatest < 0 && isWhole ? NOT_COUNTED : here >= 0 ? `· here ${rounded(here)}` : "");
    }
}
